// libFuzzer's entry; UNHAND_LOG is the log's name. The reader reads in this process, where libFuzzer sees it;
// an exception is a finding.
#include "tests/fuzz/composed_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  unhand::fuzz::read_composed(UNHAND_LOG, data, size, unhand::fuzz::Process::this_one);
  return 0;
}
