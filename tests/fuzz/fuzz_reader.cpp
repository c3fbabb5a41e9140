// libFuzzer's entry; UNHAND_READER is the reader's name. Anything but LogError is a finding: it leaves here
// uncaught.
#include "tests/fuzz/readers.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  unhand::fuzz::read(UNHAND_READER, data, size, unhand::fuzz::Process::this_one);
  return 0;
}
