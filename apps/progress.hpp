// A progress bar on stderr, on a terminal only.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <string>
#include <utility>

#include "apps/tell.hpp"

namespace unhand::apps {

/// Steps may come from any thread. The bar is wiped when it goes out of scope.
class Progress {
 public:
  Progress(std::string label, std::size_t total)
      : label_(std::move(label)),
        total_(std::max<std::size_t>(total, 1)),
        shown_(isatty(STDERR_FILENO) == 1) {
    draw();
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() {
    if (shown_) tell("\r\x1b[K");
  }

  void step() {
    const std::lock_guard lock(guard_);
    ++at_;
    draw();
  }

 private:
  void draw() {
    constexpr std::size_t cells = 30;
    const std::size_t full = cells * std::min(at_, total_) / total_;
    const auto percent = static_cast<int>(100 * std::min(at_, total_) / total_);
    if (!shown_ || percent == last_) return;
    last_ = percent;
    tell("\r\x1b[K{} [{}{}] {}%", label_, std::string(full, '='), std::string(cells - full, ' '), percent);
    std::fflush(stderr);
  }

  std::string label_;
  std::size_t total_, at_{};
  bool shown_;
  int last_{-1};
  std::mutex guard_;
};

}  // namespace unhand::apps
