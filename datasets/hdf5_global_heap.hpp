// HDF5's global heap, where text of variable length lies. Private to the module.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace unhand::datasets::hdf5 {

/// Fills the bytes from this place of a collection on; false where it cannot.
using ReadAt = std::function<bool(std::uint64_t at, std::span<std::uint8_t> out)>;

/// The size of the global heap collection that begins with these bytes ("GCOL", version, size in
/// `length_size` bytes); 0 where they begin none.
std::uint64_t heap_collection_size(std::span<const std::uint8_t> bytes, std::size_t length_size);

/// Whether the objects of a collection of this size follow each other without standstill or overlap up to its
/// end. HDF5 1.10 takes that for granted: an object of no size holds it for ever, one that ends outside makes
/// it read there. (HDF5 file format specification 3.0, III.E.)
bool heap_objects_are_sound(std::uint64_t size, std::size_t length_size, const ReadAt& read_at);

}  // namespace unhand::datasets::hdf5
