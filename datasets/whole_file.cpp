#include "datasets/whole_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>

namespace unhand::datasets {
namespace {

std::string words(int error) { return std::generic_category().message(error); }

/// A name beside the file that no other process or thread uses.
std::filesystem::path part_of(const std::filesystem::path& file) {
  static std::atomic<unsigned> counter{0};
  return fmt::format("{}.part-{}-{}", file.string(), getpid(), counter++);
}

}  // namespace

std::string write_whole(const std::filesystem::path& file, std::string_view bytes) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) return words(errno);
  std::string failed;
  while (!bytes.empty() && failed.empty()) {
    const ssize_t n = ::write(descriptor, bytes.data(), bytes.size());
    if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
    if (n == 0 || (n < 0 && errno != EINTR)) failed = words(n == 0 ? EIO : errno);
  }
  if (::close(descriptor) != 0 && failed.empty()) failed = words(errno);
  return failed;
}

std::string replace_whole(const std::filesystem::path& file, std::string_view bytes) {
  const std::filesystem::path part = part_of(file);
  std::string failed = write_whole(part, bytes);
  std::error_code error;
  if (failed.empty()) std::filesystem::rename(part, file, error);
  if (error) failed = error.message();
  if (!failed.empty()) std::filesystem::remove(part, error);
  return failed;
}

}  // namespace unhand::datasets
