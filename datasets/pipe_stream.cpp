#include "datasets/pipe_stream.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace unhand::datasets {
namespace {

constexpr std::size_t kBuffer = 1 << 16;

}  // namespace

void PipeWriter::raw(const void* data, std::size_t n) {
  if (n == 0) return;
  if (buffer_.size() + n > kBuffer) flush();
  if (n >= kBuffer) return write(static_cast<const char*>(data), n);
  buffer_.append(static_cast<const char*>(data), n);
}

void PipeWriter::flush() {
  write(buffer_.data(), buffer_.size());
  buffer_.clear();
}

void PipeWriter::write(const char* data, std::size_t n) {
  while (n > 0) {
    const ssize_t done = ::write(descriptor_, data, n);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) throw PipeBroken("nobody reads");
    data += done, n -= static_cast<std::size_t>(done);
  }
}

void PipeReader::raw(void* data, std::size_t n) {
  char* out = static_cast<char*>(data);
  while (n > 0) {
    if (begin_ == end_) {
      if (n >= kBuffer) {
        const std::size_t got = read(out, n);
        out += got, n -= got;
        continue;
      }
      buffer_.resize(kBuffer);
      begin_ = 0, end_ = read(buffer_.data(), kBuffer);
    }
    const std::size_t some = std::min(n, end_ - begin_);
    std::memcpy(out, buffer_.data() + begin_, some);
    begin_ += some, out += some, n -= some;
  }
}

std::size_t PipeReader::read(char* data, std::size_t n) {
  for (;;) {
    pollfd wait{descriptor_, POLLIN, 0};
    const int ready = ::poll(&wait, 1, silence_);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) throw PipeBroken("silence");
    const ssize_t got = ::read(descriptor_, data, n);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw PipeBroken("the writer ended");
    return static_cast<std::size_t>(got);
  }
}

}  // namespace unhand::datasets
