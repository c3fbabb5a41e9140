#include "datasets/hdf5_apart.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "datasets/hdf5_handles.hpp"
#include "datasets/log_error.hpp"

namespace unhand::datasets::hdf5 {
namespace {

enum class Verdict : std::uint8_t { values = 1, refused, no_memory };
constexpr std::uint32_t kEnd = 0x454e4421;  // after the values: they are whole

constexpr int kDamageSignals[] = {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL};

/// A descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { close(); }
  void take(int number) { close(), number_ = number; }
  int number() const { return number_; }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

 private:
  int number_;
};

/// A running child; none is left behind.
class Child {
 public:
  explicit Child(pid_t id) : id_(id) {}
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() { end(); }

  /// Kills it if it still runs after a moment, and says how it ended: waitpid's status, -1 if someone else
  /// took it (a program that ignores or handles SIGCHLD).
  int end() {
    if (id_ < 0) return status_;
    for (int k = 0; k < 100; ++k) {
      if (!running(WNOHANG)) return status_;
      ::poll(nullptr, 0, 1);
    }
    ::kill(id_, SIGKILL);
    while (running(0)) {
    }
    return status_;
  }

 private:
  bool running(int how) {
    const pid_t got = ::waitpid(id_, &status_, how);
    if (got == 0 || (got < 0 && errno == EINTR)) return true;
    if (got < 0) status_ = -1;
    id_ = -1;
    return false;
  }
  pid_t id_;
  int status_ = -1;
};

/// [bytes]; 0 where the system does not say.
std::size_t address_space_in_use() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

void limit(int resource, rlim_t most) {
  rlimit now{};
  if (::getrlimit(static_cast<__rlimit_resource>(resource), &now) != 0) return;
  now.rlim_cur = std::min(most, now.rlim_max);
  ::setrlimit(static_cast<__rlimit_resource>(resource), &now);
}

/// In the child, before anything else: the parent's handlers, terminal and core files are not its business.
void settle(const Limits& limits, std::size_t in_use) {
  for (const int number : kDamageSignals) ::signal(number, SIG_DFL);
  for (const int number : {SIGXCPU, SIGPIPE}) ::signal(number, SIG_DFL);
  for (const int number : {SIGINT, SIGHUP}) ::signal(number, SIG_IGN);  // the parent decides
  if (const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC); nowhere >= 0) {
    for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, standard);
  }
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<rlim_t>(limits.cpu_seconds));
  if (in_use > 0) limit(RLIMIT_AS, in_use + limits.memory);
}

void put(PipeWriter& pipe, Verdict verdict) {
  auto byte = static_cast<std::uint8_t>(verdict);
  carry(pipe, byte);
}

/// The child's whole life after settle().
void answer(PipeWriter& pipe, Place& place, const std::function<Send(Place&)>& read) {
  try {
    const Send send = read(place);
    put(pipe, Verdict::values);
    send(pipe);
    std::uint32_t end = kEnd;
    carry(pipe, end);
  } catch (const LogError& error) {
    put(pipe, Verdict::refused);
    for (std::string text : {error.file, error.path, error.reason}) carry(pipe, text);
  } catch (const std::bad_alloc&) {
    put(pipe, Verdict::no_memory);
  }
  pipe.flush();
}

std::string how_it_ended(int status, const Limits& limits) {
  if (status >= 0 && WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    if (number == SIGXCPU)
      return fmt::format("damaged: the HDF5 library found no end in it within {} s", limits.cpu_seconds);
    if (number == SIGKILL || number == SIGTERM)
      return fmt::format("its reading gave no answer or was ended from outside (signal {})", number);
    if (number != SIGPIPE)
      return fmt::format("damaged: the HDF5 library could not read it ({})", ::sigdescr_np(number));
  }
  return "damaged: the HDF5 library could not read it";
}

}  // namespace

Place::Place()
    : text_(static_cast<char*>(
          ::mmap(nullptr, kCapacity, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
  if (text_ == MAP_FAILED) throw std::bad_alloc();
  text_[0] = '/';
}

Place::~Place() { ::munmap(text_, kCapacity); }

void Place::note(std::string_view path) noexcept {
  const std::size_t n = std::min(path.size(), kCapacity - 1);
  std::memcpy(text_, path.data(), n);
  text_[n] = '\0';
}

std::string Place::text() const { return {text_, ::strnlen(text_, kCapacity)}; }

void read_apart(const std::string& file, const std::function<Send(Place&)>& read,
                const std::function<void(PipeReader&)>& take, const Limits& limits) {
  Place place;
  Descriptor out;
  const std::size_t in_use = address_space_in_use();
  pid_t id = -1;
  {
    const Session session;  // nobody is inside HDF5, nor opens a pipe that the child would inherit
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) == 0) id = ::fork();
    const int error = errno;
    Descriptor in(ends[1]);
    out.take(ends[0]);
    if (id == 0) {
      out.close();  // where the parent is gone, nobody reads, and the next write ends the child
      settle(limits, in_use);
      PipeWriter pipe(in.number());
      try {
        answer(pipe, place, read);
      } catch (...) {
        ::_exit(1);
      }
      ::_exit(0);
    }
    if (id < 0) throw LogError(file, "/", fmt::format("no process to read it ({})", std::strerror(error)));
  }
  Child child(id);
  try {
    PipeReader pipe(out.number(), 1000 * limits.silence_seconds);
    std::uint8_t verdict = 0;
    carry(pipe, verdict);
    if (verdict == static_cast<std::uint8_t>(Verdict::refused)) {
      std::string parts[3];
      for (std::string& part : parts) carry(pipe, part);
      throw LogError(parts[0], parts[1], parts[2]);
    }
    if (verdict == static_cast<std::uint8_t>(Verdict::no_memory))
      throw LogError(file, place.text(), fmt::format("needs more than {} MiB to read", limits.memory >> 20));
    if (verdict == static_cast<std::uint8_t>(Verdict::values)) {
      take(pipe);
      std::uint32_t end = 0;
      carry(pipe, end);
      if (end == kEnd) return;
    }
  } catch (const PipeBroken&) {
  }
  out.close();
  throw LogError(file, place.text(), how_it_ended(child.end(), limits));
}

}  // namespace unhand::datasets::hdf5
