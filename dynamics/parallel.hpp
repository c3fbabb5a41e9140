// A loop over independent items on several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace unhand::dynamics {

/// Calls work(i) for i = 0 … n − 1 on `threads` threads (0: one per core). Each item writes its own result,
/// so the outcome does not depend on the number of threads. Of the exceptions that of the least i is rethrown
/// after all threads have stopped: those before it have been tried.
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
  std::vector<std::thread> pool;
  for (std::size_t k = 0; k < count; ++k)
    pool.emplace_back([&] {
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
    });
  for (auto& thread : pool) thread.join();
  if (first) std::rethrow_exception(first);
}

}  // namespace unhand::dynamics
