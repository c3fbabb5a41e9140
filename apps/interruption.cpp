#include "apps/interruption.hpp"

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>

namespace unhand::apps {

namespace fs = std::filesystem;

namespace {

std::atomic<int> begun{0};  // the signal
std::atomic<pid_t> child_to_end{0};
sigset_t mask_before;  // of the main thread
thread_local int depth = 0;

// Never destroyed: the thread that waits outlives main().
std::recursive_mutex& gate() {
  static auto& instance = *new std::recursive_mutex;
  return instance;
}
std::set<fs::path>& unfinished() {  // behind the gate
  static auto& instance = *new std::set<fs::path>;
  return instance;
}

[[noreturn]] void end_by(int number, const sigset_t& signals) {
  signal(number, SIG_DFL);
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  raise(number);
  _exit(128 + number);
}

void wait_for(sigset_t signals) {
  int number = 0;
  while (sigwait(&signals, &number) != 0) {
  }
  begun = number;
  if (const pid_t child = child_to_end; child > 0) kill(child, SIGKILL);
  gate().lock();
  std::error_code ignored;
  for (const fs::path& path : unfinished()) fs::remove_all(path, ignored);
  end_by(number, signals);
}

}  // namespace

void end_tidily() {
  signal(SIGXFSZ, SIG_IGN);
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction now {};
    if (sigaction(number, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) sigaddset(&signals, number);
  }
  pthread_sigmask(SIG_BLOCK, &signals, &mask_before);
  pthread_atfork(nullptr, nullptr, [] { pthread_sigmask(SIG_SETMASK, &mask_before, nullptr); });
  gate(), unfinished();
  std::thread(wait_for, signals).detach();
}

void wait_if_interrupted() {
  while (begun != 0) pause();
}

Unbroken::Unbroken() {
  if (depth == 0) wait_if_interrupted();
  gate().lock();
  ++depth;
}

Unbroken::~Unbroken() {
  --depth;
  gate().unlock();
}

void remove_if_interrupted(const fs::path& path) {
  const Unbroken here;
  std::error_code error;
  unfinished().insert(fs::absolute(path, error));
}

void keep_if_interrupted(const fs::path& path) {
  const Unbroken here;
  std::error_code error;
  unfinished().erase(fs::absolute(path, error));
}

void end_with_us(pid_t child) {
  child_to_end = child;
  if (child > 0 && begun != 0) kill(child, SIGKILL);
}

}  // namespace unhand::apps
