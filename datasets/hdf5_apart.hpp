// HDF5 files are read by a process of their own. Private to the module.
//
// libhdf5 1.10 has memory errors on damaged files: it reads behind its buffers, frees what it must not, asks
// for absurd memory. None can be told from the file beforehand without writing the library again, so it runs
// where it can do no harm: a forked child reads the log and sends its values through a pipe; this process
// never opens the file. A child that dies, spends its time or asks for too much memory is a LogError.
//
// What is assumed of the moment of the fork: no other thread is inside HDF5 (a Session is held, and a
// program's own use of HDF5 beside ours is an error already, as Debian's library is not thread-safe). Other
// threads may run: the child allocates memory, which glibc allows it, and otherwise uses nothing but HDF5,
// formatting and its own pipe. AddressSanitizer's allocator, as of GCC 12, does not allow it: a child forked
// while another thread holds its lock waits until `silence_seconds` are over. The child ends by _exit, so
// that nothing of the parent's is flushed or destroyed twice, and its standard output and error lead nowhere
// (libhdf5 prints its cache's contents to stdout on some damaged files).
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include "datasets/pipe_stream.hpp"

namespace unhand::datasets::hdf5 {

/// Where in the file the reading child is, in memory that it shares with its parent.
class Place {
 public:
  Place();
  ~Place();
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  void note(std::string_view path) noexcept;
  /// "/" before anything was noted.
  std::string text() const;

 private:
  static constexpr std::size_t kCapacity = 4096;  // bytes; longer paths are cut
  char* text_;
};

/// What a child may spend.
struct Limits {
  int cpu_seconds = 60;  // 50 million numbers, the most that a log may hold, take about 5
  std::size_t memory = std::size_t{2} << 30;  // [bytes] beyond what its parent has
  int silence_seconds = 600;                  // without a byte of an answer: a disk that does not respond
};

/// Calls `read` in a child process, there what it returned to send the values, and `take` here to receive
/// them. LogErrors of `read` are thrown here as they were there; a child that ends otherwise is a LogError
/// with the place where it was.
using Send = std::function<void(PipeWriter&)>;
void read_apart(const std::string& file, const std::function<Send(Place&)>& read,
                const std::function<void(PipeReader&)>& take, const Limits& limits = {});

/// What `read(file, place)` makes of the file in a child; `bring(pipe, value)` carries it over, for both
/// ends.
template <class Value, class Read, class Bring>
Value value_apart(const std::string& file, const Read& read, const Bring& bring) {
  Value out;
  read_apart(
      file,
      [&](Place& place) -> Send {
        return [&bring, value = read(file, &place)](PipeWriter& pipe) mutable { bring(pipe, value); };
      },
      [&](PipeReader& pipe) { bring(pipe, out); });
  return out;
}

}  // namespace unhand::datasets::hdf5
