// A file of a fuzzer's own.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace unhand::fuzz {

/// In memory where there is such a place. (A memfd has no path that HDF5 accepts.) Gone with its owner.
class ScratchFile {
 public:
  ScratchFile(const std::uint8_t* data, std::size_t size) {
    const std::filesystem::path memory = "/dev/shm";
    path_ = ((std::filesystem::exists(memory) ? memory : std::filesystem::temp_directory_path()) /
             "unhand-XXXXXX")
                .string();
    const int descriptor = mkstemp(path_.data());
    if (descriptor < 0) throw std::runtime_error("no scratch file: " + path_);
    for (std::size_t done = 0; done < size;) {
      const ssize_t n = ::write(descriptor, data + done, size - done);
      if (n <= 0) break;
      done += static_cast<std::size_t>(n);
    }
    ::close(descriptor);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  ~ScratchFile() { ::unlink(path_.c_str()); }
  std::filesystem::path path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace unhand::fuzz
