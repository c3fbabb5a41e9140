// How far a long run is, on stderr: a bar on a terminal, else a plain line now and then.
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

/// Steps may come from any thread. On a terminal the bar is wiped when it goes out of scope; elsewhere a line
/// is told every `period`, so that short runs tell none.
class Progress {
 public:
  /// `total` steps; 0 where they are not known: then only the time is told.
  Progress(std::string label, std::size_t total, std::chrono::milliseconds period = std::chrono::seconds(15))
      : label_(std::move(label)), total_(total), terminal_(isatty(STDERR_FILENO) == 1) {
    draw();
    if (!terminal_ || total_ == 0)
      clock_ = std::jthread([this, wait = terminal_ ? std::chrono::seconds(1) : period](
                                const std::stop_token& over) { tell_every(wait, over); });
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() {
    clock_ = {};  // stops and joins
    if (terminal_) tell("\r\x1b[K");
  }

  void step() {
    const std::lock_guard lock(guard_);
    ++at_;
    draw();
  }

 private:
  int percent() const { return static_cast<int>(100 * std::min(at_, total_) / total_); }

  void draw() {
    if (!terminal_ || total_ == 0 || percent() == last_) return;
    constexpr std::size_t cells = 30;
    const std::size_t full = cells * std::min(at_, total_) / total_;
    last_ = percent();
    tell("\r\x1b[K{} [{}{}] {}%", label_, std::string(full, '='), std::string(cells - full, ' '), last_);
    std::fflush(stderr);
  }

  void tell_every(std::chrono::milliseconds period, const std::stop_token& over) {
    const auto begin = std::chrono::steady_clock::now();
    std::unique_lock lock(guard_);
    while (true) {
      pause_.wait_for(lock, over, period, [] { return false; });
      if (over.stop_requested()) return;
      const auto seconds =
          std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - begin).count();
      const std::string done = total_ > 0 ? fmt::format("{} % done, ", percent()) : "";
      if (terminal_)
        tell("\r\x1b[K{}: {} s", label_, seconds);
      else
        tell("unhand: {}: {}at work for {} s\n", label_, done, seconds);
      std::fflush(stderr);
    }
  }

  std::string label_;
  std::size_t total_, at_{};
  bool terminal_;
  int last_{-1};
  std::mutex guard_;
  std::condition_variable_any pause_;
  std::jthread clock_;  ///< last: it uses the others
};

}  // namespace unhand::apps
