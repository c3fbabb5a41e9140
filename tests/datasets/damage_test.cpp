// Files cut short or with flipped bits: a LogError or the right answer, never a crash.
#include <random>

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

}  // namespace
}  // namespace unhand::datasets::test
