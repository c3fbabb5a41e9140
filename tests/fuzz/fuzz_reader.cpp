// libFuzzer's entry; UNHAND_READER is the reader's name. Anything but LogError is a finding: it leaves here
// uncaught. HDF5 files are read by a child, as users have it (composed logs are for what is ours:
// fuzz_composed.cpp).
#include "tests/fuzz/readers.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  unhand::fuzz::read(UNHAND_READER, data, size);
  return 0;
}
