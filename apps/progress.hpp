// How far a run is, on stderr, on a terminal only.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "apps/tell.hpp"

namespace unhand::apps {

/// A bar, or the time that has passed where the number of steps is not known. Steps may come from any thread.
/// It is wiped when it goes out of scope.
class Progress {
 public:
  /// `total` steps; 0 where they are not known.
  Progress(std::string label, std::size_t total)
      : label_(std::move(label)), total_(total), shown_(isatty(STDERR_FILENO) == 1) {
    if (shown_ && total_ == 0)
      clock_ = std::jthread([this](const std::stop_token& over) { tell_time(over); });
    draw();
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() {
    clock_ = {};  // stops and joins
    if (shown_) tell("\r\x1b[K");
  }

  void step() {
    const std::lock_guard lock(guard_);
    ++at_;
    draw();
  }

 private:
  void draw() {
    if (!shown_ || total_ == 0) return;
    constexpr std::size_t cells = 30;
    const std::size_t full = cells * std::min(at_, total_) / total_;
    const auto percent = static_cast<int>(100 * std::min(at_, total_) / total_);
    if (percent == last_) return;
    last_ = percent;
    tell("\r\x1b[K{} [{}{}] {}%", label_, std::string(full, '='), std::string(cells - full, ' '), percent);
    std::fflush(stderr);
  }

  void tell_time(const std::stop_token& over) {
    std::unique_lock lock(guard_);
    for (int seconds = 1;; ++seconds) {
      pause_.wait_for(lock, over, std::chrono::seconds(1), [] { return false; });
      if (over.stop_requested()) return;
      tell("\r\x1b[K{}: {} s", label_, seconds);
      std::fflush(stderr);
    }
  }

  std::string label_;
  std::size_t total_, at_{};
  bool shown_;
  int last_{-1};
  std::mutex guard_;
  std::condition_variable_any pause_;
  std::jthread clock_;  ///< last: it uses the others
};

}  // namespace unhand::apps
