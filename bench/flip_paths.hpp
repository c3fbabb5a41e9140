// Learning paths of several learners at several targets on many simulated robots, and their tables.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "dynamics/parallel.hpp"
#include "planners/flip/session.hpp"

namespace flip_bench {

using namespace unhand::planners::flip;

constexpr double kDegree = std::numbers::pi / 180;

struct Spread {
  double sum{}, squares{};
  int n{};
  void add(double x) { sum += x, squares += x * x, ++n; }
  double mean() const { return sum / n; }
  double variance() const { return n > 1 ? std::max(0.0, (squares - sum * sum / n) / (n - 1)) : 0; }
  double error() const { return std::sqrt(variance() / n); }  ///< of the mean
};

/// Time since it was made, on the wall and of the processors.
class Watch {
 public:
  double minutes() const {
    return std::chrono::duration<double, std::ratio<60>>(std::chrono::steady_clock::now() - wall_).count();
  }
  std::string text() const {
    return fmt::format("{:.0f} s, {:.0f} s of processor time", 60 * minutes(),
                       static_cast<double>(std::clock() - processor_) / CLOCKS_PER_SEC);
  }

 private:
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  std::clock_t processor_ = std::clock();
};

struct NamedTarget {
  std::string name;
  FlipTarget target;
};
inline NamedTarget target_at(const std::string& letter, double x, double degrees) {
  return {fmt::format("{} {:.1f} m, {:.0f}°", letter, x, degrees), {{x, degrees * kDegree}}};
}
/// Of the paper's Table 8.
inline std::vector<NamedTarget> paper_targets() {
  return {target_at("(a)", 1.2, 180), target_at("(b)", 1.2, 360), target_at("(c)", 1.4, 180),
          target_at("(d)", 1.4, 360)};
}

/// Learning paths that are told in one row.
class Paths {
 public:
  void add(const LearningPath& path, const CommandRange& range) {
    for (const PathIteration& one : path.iterations) {
      const auto f = range.fractions(one.command);
      at_edge_.add(std::any_of(f.begin(), f.end(), [](double x) { return x < 0.01 || x > 0.99; }));
    }
    initial_.add(capped(path.initial));
    first_.add(capped(path.first()));
    minimum_.add(capped(path.minimum()));
    two_.push_back(path.reached(2));
    three_.push_back(path.reached(3));
  }
  std::string row() const {
    return fmt::format("{:.2f} | {:.2f} ± {:.2f} | {:.2f} ± {:.2f} | {} | {} | {:.0f} %", initial_.mean(),
                       first_.mean(), first_.error(), minimum_.mean(), minimum_.error(), reached(two_),
                       reached(three_), 100 * at_edge_.mean());
  }
  /// `what`: the columns before those of row().
  static std::string header(const std::string& what) {
    std::string rule = "|";
    for (auto n = std::count(what.begin(), what.end(), '|'); n >= 0; --n) rule += " --- |";
    return "| " + what +
           " | initial error | after 1 iteration | minimum | 2/3 reached | median iterations | 3/3 reached | "
           "median iterations | commands at an edge |\n" +
           rule + " ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
  }
  /// A command whose throws never landed counts 20.
  static double capped(double error) { return std::min(error, 20.0); }

 private:
  /// The share of paths that get there, and the median over all; those that never do are infinite.
  static std::string reached(std::vector<int> x) {
    const auto n = std::count_if(x.begin(), x.end(), [](int i) { return i > 0; });
    for (int& i : x)
      if (i == 0) i = 1000;
    std::sort(x.begin(), x.end());
    const int middle = x[(x.size() - 1) / 2];
    return fmt::format("{:.0f} % | {}", 100.0 * static_cast<double>(n) / static_cast<double>(x.size()),
                       middle == 1000 ? "not reached" : std::to_string(middle));
  }

  Spread initial_, first_, minimum_, at_edge_;
  std::vector<int> two_, three_;
};

/// Learners at targets on robots, with equal luck.
class Contest {
 public:
  Contest(std::vector<std::string> learners, std::vector<NamedTarget> targets, CommandRange range)
      : learners_(std::move(learners)), targets_(std::move(targets)), range_(range) {}

  /// `work(seed, paths)` fills paths[learner][target] of the robot with that seed, 1 to `robots`; after
  /// `minutes`, no further robot is begun.
  template <class Work>
  void run(std::size_t robots, double minutes, Work&& work) {
    const Watch watch;
    paths_.assign(robots, {learners_.size(), std::vector<LearningPath>(targets_.size())});
    std::vector<char> begun(robots);
    unhand::dynamics::parallel_for(robots, 0, [&](std::size_t k) {
      if (watch.minutes() > minutes) return;
      begun[k] = 1;
      work(k + 1, paths_[k]);
    });
    paths_.resize(static_cast<std::size_t>(std::count(begun.begin(), begun.end(), 1)));  // the first so many
  }
  std::size_t robots() const { return paths_.size(); }
  const std::vector<NamedTarget>& targets() const { return targets_; }

  std::string table() const {
    std::string out = Paths::header("target | learner");
    for (std::size_t t = 0; t < targets_.size(); ++t)
      for (std::size_t m = 0; m < learners_.size(); ++m)
        out += fmt::format("| {} | {} | {} |\n", targets_[t].name, learners_[m], over(m, t, t + 1).row());
    return out + rows("all");
  }
  /// A row for each learner, over all targets.
  std::string rows(const std::string& what) const {
    std::string out;
    for (std::size_t m = 0; m < learners_.size(); ++m)
      out += fmt::format("| {} | {} | {} |\n", what, learners_[m], over(m, 0, targets_.size()).row());
    return out;
  }
  /// Learner `a` minus learner `b`, each on the same robots and targets, with the standard error of the mean.
  std::string difference(std::size_t a, std::size_t b) const {
    std::string out = fmt::format("| {} - {} | after 1 iteration | minimum |\n| --- | ---: | ---: |\n",
                                  learners_[a], learners_[b]);
    const auto row = [&](const std::string& what, std::size_t begin, std::size_t end) {
      Spread first, minimum;
      for (const auto& robot : paths_)
        for (std::size_t t = begin; t < end; ++t) {
          const LearningPath &x = robot[a][t], &y = robot[b][t];
          first.add(Paths::capped(x.first()) - Paths::capped(y.first()));
          minimum.add(Paths::capped(x.minimum()) - Paths::capped(y.minimum()));
        }
      out += fmt::format("| {} | {:+.3f} ± {:.3f} | {:+.3f} ± {:.3f} |\n", what, first.mean(), first.error(),
                         minimum.mean(), minimum.error());
    };
    for (std::size_t t = 0; t < targets_.size(); ++t) row(targets_[t].name, t, t + 1);
    row("all", 0, targets_.size());
    return out;
  }

  /// Lowest error seen, and the share of paths that reached 3/3, by how many commands the bar was thrown
  /// with; `before`: of those, how many each learner threw before its first iteration.
  std::string by_commands(const std::vector<std::size_t>& before,
                          const std::vector<std::size_t>& counts) const {
    std::string out = "| learner |", rule = "| --- |";
    for (const std::size_t n : counts) {
      out += fmt::format(" {} commands: error | 3/3 |", n);
      rule += " ---: | ---: |";
    }
    out += "\n" + rule + "\n";
    for (std::size_t m = 0; m < learners_.size(); ++m) {
      out += fmt::format("| {} |", learners_[m]);
      for (const std::size_t n : counts) {
        Spread lowest, reached;
        const std::size_t iterations = n - before[m];
        for (const auto& robot : paths_)
          for (const LearningPath& path : robot[m]) {
            const int at = path.reached(3);
            lowest.add(Paths::capped(path.lowest(iterations)));
            reached.add(at > 0 && at <= static_cast<int>(iterations));
          }
        out +=
            fmt::format(" {:.2f} ± {:.2f} | {:.0f} % |", lowest.mean(), lowest.error(), 100 * reached.mean());
      }
      out += "\n";
    }
    return out;
  }

 private:
  Paths over(std::size_t learner, std::size_t begin, std::size_t end) const {
    Paths out;
    for (const auto& robot : paths_)
      for (std::size_t t = begin; t < end; ++t) out.add(robot[learner][t], range_);
    return out;
  }

  std::vector<std::string> learners_;
  std::vector<NamedTarget> targets_;
  CommandRange range_;
  std::vector<std::vector<std::vector<LearningPath>>> paths_;  ///< by robot, learner, target
};

/// Sections of the study that throw populations (flip_population.cpp).
void population(const FlipRobot& robot, std::uint64_t seed);
void reach(const FlipRobot& robot);
/// What the shift experiment throws at: as many of the paper's as the bar reaches, and two others.
std::vector<NamedTarget> shift_targets();
/// The bar of the shift experiment: 18 cm.
Bar shifted_bar(const FlipRobot& robot);

}  // namespace flip_bench
