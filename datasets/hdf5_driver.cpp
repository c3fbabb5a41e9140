#include "datasets/hdf5_driver.hpp"

#include "datasets/hdf5_global_heap.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <iterator>
#include <new>
#include <span>

namespace unhand::datasets::hdf5 {

#if H5_VERSION_LE(1, 10, 99)
namespace {

struct PlainFile {
  H5FD_t base;  // first, as HDF5 casts between the two
  int descriptor;
  haddr_t end_of_addresses, end_of_file;
  std::size_t
      length_size;  // of the lengths in the file, as its superblock says; 0 where that is not 2, 4 or 8
  dev_t device;
  ino_t node;
};

PlainFile& of(H5FD_t* file) { return *reinterpret_cast<PlainFile*>(file); }
const PlainFile& of(const H5FD_t* file) { return *reinterpret_cast<const PlainFile*>(file); }

/// What lies past the end of the file reads as zeros, as HDF5's own drivers have it.
bool read_bytes(int descriptor, haddr_t address, std::span<std::uint8_t> out) {
  while (!out.empty()) {
    const ssize_t n = ::pread(descriptor, out.data(), out.size(), static_cast<off_t>(address));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    if (n == 0) {
      std::fill(out.begin(), out.end(), std::uint8_t{0});
      return true;
    }
    out = out.subspan(static_cast<std::size_t>(n)), address += static_cast<haddr_t>(n);
  }
  return true;
}

/// The superblock is at 0, 512, 1024, 2048, ...: its version decides where it keeps the size of lengths.
std::size_t length_size_of(int descriptor, haddr_t end_of_file) {
  constexpr std::array<std::uint8_t, 8> kSignature{0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
  std::array<std::uint8_t, 16> block{};
  for (haddr_t at = 0; at < end_of_file; at = at == 0 ? 512 : 2 * at) {
    if (!read_bytes(descriptor, at, block)) return 0;
    if (!std::equal(kSignature.begin(), kSignature.end(), block.begin())) continue;
    const std::size_t size = block[8] < 2 ? block[14] : block[10];
    return size == 2 || size == 4 || size == 8 ? size : 0;
  }
  return 0;
}

/// Whether what was read at this address is no global heap, or one that HDF5 can walk through. The heap's
/// first read ends before the heap does, or with it.
bool walks(const PlainFile& file, haddr_t address, std::span<const std::uint8_t> read) {
  const std::uint64_t size = heap_collection_size(read, file.length_size);
  if (size == 0) return true;
  if (address >= file.end_of_file || size > file.end_of_file - address) return false;
  return heap_objects_are_sound(size, file.length_size, [&](std::uint64_t at, std::span<std::uint8_t> out) {
    return read_bytes(file.descriptor, address + at, out);
  });
}

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
  file->length_size = length_size_of(descriptor, file->end_of_file);
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

/// Past the addresses in use is an error, and so is a global heap (which HDF5 reads as raw data) that does
/// not add up.
herr_t read(H5FD_t* handle, H5FD_mem_t type, hid_t, haddr_t address, std::size_t size, void* buffer) {
  const PlainFile& file = of(handle);
  if (address > file.end_of_addresses || size > file.end_of_addresses - address) return -1;
  const std::span out(static_cast<std::uint8_t*>(buffer), size);
  if (!read_bytes(file.descriptor, address, out)) return -1;
  const bool may_be_heap = (type == H5FD_MEM_DRAW || type == H5FD_MEM_GHEAP) && file.length_size > 0;
  return may_be_heap && !walks(file, address, out) ? -1 : 0;
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
