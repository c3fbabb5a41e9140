// Files cut short or with flipped bits: a LogError or the right answer, never a crash.
#include <random>

#include "datasets/hdf5_global_heap.hpp"
#include "hdf5_tools.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

TEST(Damage, AnyTruncationIsALogError) {
  const Scratch scratch;
  const std::string whole = scratch / "whole.h5", cut = scratch / "cut.h5";
  write_throw_log(whole, planar_log());
  const std::string bytes = bytes_of(whole);
  const unsigned seed = 20240611;
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::size_t> length(0, bytes.size() - 1);
  for (int k = 0; k < 200; ++k) {
    const std::size_t n = k == 0 ? bytes.size() - 1 : k == 1 ? 8 : length(random);
    put_bytes(cut, bytes.substr(0, n));
    try {
      read_throw_log(cut);
      ADD_FAILURE() << "read a log from its first " << n << " of " << bytes.size() << " bytes, seed " << seed;
    } catch (const LogError& error) {
      EXPECT_EQ(error.file, cut);
      EXPECT_EQ(error.path, "/");
    }
    std::filesystem::remove(cut);
  }
}

/// Where the stored bytes of a one-chunk dataset lie in the file.
std::pair<haddr_t, hsize_t> chunk_of(const std::string& file, const char* path) {
  const Editor f(file);
  const hid_t set = H5Dopen2(f.file, path, 0);
  const hid_t space = H5Dget_space(set);
  hsize_t offset[2] = {}, size = 0;
  haddr_t address = HADDR_UNDEF;
  unsigned mask = 0;
  must(H5Dget_chunk_info(set, space, 0, offset, &mask, &address, &size) >= 0);
  H5Sclose(space);
  H5Dclose(set);
  return {address, size};
}

// The checksum is what stands between a flipped bit and a wrong number.
TEST(Damage, AFlippedBitInTheDataIsALogError) {
  const Scratch scratch;
  const std::string good = scratch / "good.h5", bad = scratch / "bad.h5";
  write_throw_log(good, planar_log());
  const auto [address, size] = chunk_of(good, "/throws/002/ft/wrench");
  const std::string bytes = bytes_of(good);
  for (hsize_t k = 0; k < size; k += 37) {
    std::string flipped = bytes;
    flipped[address + k] = static_cast<char>(flipped[address + k] ^ 0x10);
    put_bytes(bad, flipped);
    expect_error([&] { read_throw_log(bad); }, bad, "/throws/002/ft/wrench", "damaged data or checksum");
  }
}

// Text of variable length lies in a heap whose objects say themselves where the next one begins.
TEST(Damage, AHeapThatDoesNotAddUpIsFound) {
  for (const std::size_t length_size : {4u, 8u}) {
    const auto sound = [&](std::initializer_list<std::pair<int, int>> objects, std::uint64_t size) {
      std::vector<std::uint8_t> heap(size, 0);
      std::size_t at = 16;
      for (const auto& [index, length] : objects) {
        heap[at] = static_cast<std::uint8_t>(index);
        heap[at + 8] = static_cast<std::uint8_t>(length);
        at += static_cast<std::size_t>(index == 0 ? length : 16 + (length + 7) / 8 * 8);
      }
      return hdf5::heap_objects_are_sound(
          size, length_size, [&](std::uint64_t from, std::span<std::uint8_t> out) {
            std::copy_n(heap.begin() + static_cast<long>(from), out.size(), out.begin());
            return true;
          });
    };
    EXPECT_TRUE(sound({{1, 5}, {2, 8}, {0, 48}}, 16 + 24 + 24 + 48));
    EXPECT_TRUE(sound({{1, 5}}, 16 + 24 + 8));  // too little left for an object
    EXPECT_FALSE(sound({{1, 5}, {0, 0}}, 16 + 24 + 48));
    EXPECT_FALSE(sound({{1, 60}}, 16 + 24));
    EXPECT_FALSE(sound({{1, 5}, {0, 49}}, 16 + 24 + 48));
  }
  std::vector<std::uint8_t> first{'G', 'C', 'O', 'L', 1, 0, 0, 0, 0, 16, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(hdf5::heap_collection_size(first, 8), 4096u);
  EXPECT_EQ(hdf5::heap_collection_size(first, 4), 4096u);
  first[0] = 'g';
  EXPECT_EQ(hdf5::heap_collection_size(first, 8), 0u);
}

// Text of variable length is a length, the address of a heap and a number in it. libhdf5 1.10 does not check
// the number, and the process that reads the file dies: of 8-byte addresses of a heap, each followed by such
// a number, all are spoilt in turn.
TEST(Damage, ATextThatIsNotInItsHeapIsALogError) {
  const Scratch scratch;
  const std::string good = scratch / "good.h5", bad = scratch / "bad.h5";
  write_throw_log(good, planar_log());
  {
    const Editor edit(good);
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, H5T_VARIABLE);
    const char* value = "made up for a test";
    edit.attribute("/", "source", text, &value);
    edit.attribute("/throws/002", "condition", text, &value);
    H5Tclose(text);
  }
  EXPECT_EQ(read_throw_log(good).source, "made up for a test");
  const std::string bytes = bytes_of(good);
  int references = 0;
  for (std::size_t heap = bytes.find("GCOL"); heap != std::string::npos;
       heap = bytes.find("GCOL", heap + 4)) {
    std::string address(8, '\0');
    for (std::size_t i = 0; i < 8; ++i) address[i] = static_cast<char>(heap >> (8 * i) & 0xff);
    for (std::size_t at = bytes.find(address); at != std::string::npos; at = bytes.find(address, at + 8)) {
      if (bytes.substr(at - 4, 4) != std::string({18, 0, 0, 0})) continue;
      ++references;
      std::string spoilt = bytes;
      spoilt[at + 11] = static_cast<char>(0xff);
      put_bytes(bad, spoilt);
      EXPECT_THROW(read_throw_log(bad), LogError) << "at byte " << at + 11;
    }
  }
  EXPECT_GE(references, 2);
}

}  // namespace
}  // namespace unhand::datasets::test
