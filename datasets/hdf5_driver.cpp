#include "datasets/hdf5_driver.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <new>

namespace unhand::datasets::hdf5 {

#if H5_VERSION_LE(1, 10, 99)
namespace {

struct PlainFile {
  H5FD_t base;  // first, as HDF5 casts between the two
  int descriptor;
  haddr_t end_of_addresses, end_of_file;
  dev_t device;
  ino_t node;
};

PlainFile& of(H5FD_t* file) { return *reinterpret_cast<PlainFile*>(file); }
const PlainFile& of(const H5FD_t* file) { return *reinterpret_cast<const PlainFile*>(file); }

H5FD_t* open_plainly(const char* name, unsigned flags, hid_t, haddr_t) {
  if (flags & H5F_ACC_RDWR) return nullptr;
  const int descriptor = ::open(name, O_RDONLY | O_CLOEXEC);
  struct stat about {};
  if (descriptor < 0) return nullptr;
  auto* file = fstat(descriptor, &about) == 0 ? new (std::nothrow) PlainFile{} : nullptr;
  if (!file) {
    ::close(descriptor);
    return nullptr;
  }
  file->descriptor = descriptor;
  file->end_of_file = static_cast<haddr_t>(about.st_size);
  file->device = about.st_dev;
  file->node = about.st_ino;
  return &file->base;
}

herr_t close_plainly(H5FD_t* file) {
  const int failed = ::close(of(file).descriptor);
  delete &of(file);
  return failed ? -1 : 0;
}

int compare(const H5FD_t* a, const H5FD_t* b) {
  const auto &x = of(a), &y = of(b);
  if (x.device != y.device) return x.device < y.device ? -1 : 1;
  return x.node == y.node ? 0 : x.node < y.node ? -1 : 1;
}

/// What lies past the end of the file reads as zeros, as HDF5's own drivers have it; past the addresses in
/// use is an error.
herr_t read(H5FD_t* handle, H5FD_mem_t, hid_t, haddr_t address, std::size_t size, void* buffer) {
  const PlainFile& file = of(handle);
  if (address > file.end_of_addresses || size > file.end_of_addresses - address) return -1;
  auto* out = static_cast<char*>(buffer);
  while (size > 0) {
    const ssize_t n = ::pread(file.descriptor, out, size, static_cast<off_t>(address));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return -1;
    if (n == 0) {
      std::memset(out, 0, size);
      return 0;
    }
    out += n, address += static_cast<haddr_t>(n), size -= static_cast<std::size_t>(n);
  }
  return 0;
}

H5FD_class_t plain_class() {
  H5FD_class_t out{};
  out.name = "plain";
  out.maxaddr = (haddr_t{1} << 62) - 1;
  out.fc_degree = H5F_CLOSE_WEAK;
  out.open = open_plainly;
  out.close = close_plainly;
  out.cmp = compare;
  out.query = [](const H5FD_t*, unsigned long* flags) -> herr_t {
    if (flags) *flags = 0;
    return 0;
  };
  out.get_eoa = [](const H5FD_t* file, H5FD_mem_t) { return of(file).end_of_addresses; };
  out.set_eoa = [](H5FD_t* file, H5FD_mem_t, haddr_t address) -> herr_t {
    of(file).end_of_addresses = address;
    return 0;
  };
  out.get_eof = [](const H5FD_t* file, H5FD_mem_t) { return of(file).end_of_file; };
  out.read = read;
  out.write = [](H5FD_t*, H5FD_mem_t, hid_t, haddr_t, std::size_t, const void*) -> herr_t { return -1; };
  std::fill(std::begin(out.fl_map), std::end(out.fl_map), H5FD_MEM_SUPER);
  return out;
}

}  // namespace

herr_t read_plainly(hid_t access) {
  static const H5FD_class_t driver_class = plain_class();
  static const hid_t driver = H5FDregister(&driver_class);
  return driver < 0 ? -1 : H5Pset_driver(access, driver, nullptr);
}

#else

herr_t read_plainly(hid_t) { return 0; }

#endif

}  // namespace unhand::datasets::hdf5
