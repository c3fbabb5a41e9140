#include "datasets/hdf5_global_heap.hpp"

#include <array>
#include <cstring>

namespace unhand::datasets::hdf5 {
namespace {

std::uint64_t little_endian(std::span<const std::uint8_t> bytes) {
  std::uint64_t out = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) out = out << 8 | bytes[i];
  return out;
}

/// Of the collection and of each object alike: eight bytes and a length, in multiples of eight.
constexpr std::size_t header_size(std::size_t length_size) { return (8 + length_size + 7) / 8 * 8; }
constexpr std::size_t kLargestHeader = header_size(8);

}  // namespace

std::uint64_t heap_collection_size(std::span<const std::uint8_t> bytes, std::size_t length_size) {
  if (bytes.size() < header_size(length_size) || std::memcmp(bytes.data(), "GCOL", 4) != 0) return 0;
  return little_endian(bytes.subspan(8, length_size));
}

bool heap_objects_are_sound(std::uint64_t size, std::size_t length_size, const ReadAt& read_at) {
  const std::size_t header = header_size(length_size);
  std::array<std::uint8_t, kLargestHeader> buffer{};
  const std::span bytes(buffer.data(), header);
  for (std::uint64_t at = header; at < size;) {
    const std::uint64_t left = size - at;
    if (left < header) return true;  // too little for an object: free
    if (!read_at(at, bytes)) return false;
    const std::uint64_t index = little_endian(bytes.first(2));
    const std::uint64_t length = little_endian(bytes.subspan(8, length_size));
    if (length > left) return false;
    // the free space, index 0, counts its own header
    const std::uint64_t taken = index == 0 ? length : header + (length + 7) / 8 * 8;
    if (taken == 0 || taken > left) return false;
    at += taken;
  }
  return true;
}

}  // namespace unhand::datasets::hdf5
