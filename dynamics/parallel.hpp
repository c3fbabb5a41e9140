// A loop over independent items on several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace unhand::dynamics {

/// Calls work(i) for i = 0 … n − 1 on `threads` threads (0: one per core), of which the caller's is one, or
/// on as many as the system allows. Each item writes its own result, so the outcome does not depend on the
/// number of threads. Of the exceptions that of the least i is rethrown after all threads have stopped: those
/// before it have been tried.
template <class Work>
void parallel_for(std::size_t n, int threads, Work&& work) {
  const std::size_t cores =
      threads > 0 ? static_cast<std::size_t>(threads) : std::max(1u, std::thread::hardware_concurrency());
  const std::size_t count = std::min(cores, n);
  if (count <= 1) {
    for (std::size_t i = 0; i < n; ++i) work(i);
    return;
  }
  std::atomic<std::size_t> next{0};
  std::exception_ptr first;
  std::size_t first_at = n;
  std::mutex guard;
  const auto run = [&] {
    for (std::size_t i = next++; i < n; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(guard);
        if (i < first_at) {
          first_at = i;
          first = std::current_exception();
        }
        next = n;
      }
    }
  };
  std::vector<std::jthread> pool;
  try {
    while (pool.size() + 1 < count) pool.emplace_back(run);
  } catch (const std::system_error&) {  // no more threads are to be had
  }
  run();
  pool.clear();  // joins
  if (first) std::rethrow_exception(first);
}

}  // namespace unhand::dynamics
