#include "datasets/hdf5_lzf.hpp"

#include <hdf5.h>
#include <lzf.h>

#include <limits>

namespace unhand::datasets::hdf5 {
namespace {

constexpr H5Z_filter_t kLzf = 32000;   // as registered with The HDF Group
constexpr std::size_t kChunkSize = 2;  // which of the filter's values says how long a chunk is [byte]

/// Of one chunk; 0 where it cannot be read, as HDF5 wants it.
std::size_t decompress(unsigned flags, std::size_t count, const unsigned* values, std::size_t length,
                       std::size_t* capacity, void** buffer) {
  if (!(flags & H5Z_FLAG_REVERSE) || count <= kChunkSize) return 0;
  if (length > std::numeric_limits<unsigned>::max()) return 0;
  const unsigned chunk = values[kChunkSize];
  void* const out = chunk > 0 ? H5allocate_memory(chunk, false) : nullptr;
  if (!out) return 0;
  const unsigned written = lzf_decompress(*buffer, static_cast<unsigned>(length), out, chunk);
  if (written == 0) {
    H5free_memory(out);
    return 0;
  }
  H5free_memory(*buffer);
  *buffer = out, *capacity = chunk;
  return written;
}

}  // namespace

void read_lzf() {
  if (H5Zfilter_avail(kLzf) > 0) return;
  const H5Z_class2_t filter{H5Z_CLASS_T_VERS, kLzf, 0, 1, "lzf", nullptr, nullptr, decompress};
  H5Zregister(&filter);
}

}  // namespace unhand::datasets::hdf5
