// The loop over independent items: each once, whatever the number of threads, and an exception comes out.
#include "dynamics/parallel.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <chrono>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>

namespace unhand::dynamics {
namespace {

TEST(ParallelFor, EveryItemOnceForAnyNumberOfThreads) {
  for (const std::size_t n : {0u, 1u, 2u, 1000u})
    for (const int threads : {0, 1, 2, 7, 64}) {
      std::vector<int> times(
          n);  // each item writes its own: no lock, and the thread sanitizer has nothing to say
      parallel_for(n, threads, [&](std::size_t i) { ++times[i]; });
      EXPECT_EQ(std::accumulate(times.begin(), times.end(), 0), static_cast<int>(n)) << threads;
      for (const int count : times) EXPECT_EQ(count, 1);
    }
}

TEST(ParallelFor, WorksWithAsManyThreadsAsThereAre) {
  pthread_attr_t usual, huge;
  ASSERT_EQ(pthread_getattr_default_np(&usual), 0);
  ASSERT_EQ(pthread_attr_init(&huge), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&huge, std::size_t{1} << 60), 0);  // no thread can have such a stack
  ASSERT_EQ(pthread_setattr_default_np(&huge), 0);
  std::vector<int> times(100);
  parallel_for(times.size(), 8, [&](std::size_t i) { ++times[i]; });
  ASSERT_EQ(pthread_setattr_default_np(&usual), 0);
  for (const int count : times) EXPECT_EQ(count, 1);
}

TEST(ParallelFor, TheFirstExceptionComesOutAfterAllThreadsHaveStopped) {
  for (const int threads : {1, 2, 8}) {
    std::atomic<int> running{0};
    const auto work = [&](std::size_t i) {
      ++running;
      if (i % 10 == 3) {
        --running;
        throw std::runtime_error("item");
      }
      --running;
    };
    EXPECT_THROW(parallel_for(1000, threads, work), std::runtime_error) << threads;
    EXPECT_EQ(running, 0);
  }
}

TEST(ParallelFor, TheExceptionIsThatOfTheLeastItem) {
  for (const int threads : {1, 2, 8})
    for (int round = 0; round < 50; ++round) {
      const auto work = [&](std::size_t i) {
        if (i == 3) std::this_thread::sleep_for(std::chrono::microseconds(200));  // fails first, throws last
        if (i >= 3) throw std::runtime_error(std::to_string(i));
      };
      try {
        parallel_for(100, threads, work);
        FAIL() << "no exception";
      } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "3") << threads;
      }
    }
}

}  // namespace
}  // namespace unhand::dynamics
