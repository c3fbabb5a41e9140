// The rows of docs/validation.md, by section.
#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace unhand::bench {

struct Row {
  std::string truth, source;
  double expected, got, tolerance;
  bool holds() const { return std::abs(got - expected) <= tolerance; }
};

struct Section {
  std::string title;
  std::vector<Row> rows;
  void row(std::string truth, std::string source, double expected, double got, double tolerance) {
    rows.push_back({std::move(truth), std::move(source), expected, got, tolerance});
  }
};

Section friction_and_release();
Section integrator_and_flight();
Section other_codes();

}  // namespace unhand::bench
