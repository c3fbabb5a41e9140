// The built command, as a user meets it: a folder for every test, what it answers and what it leaves behind.
#pragma once

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <sstream>
#include <vector>

#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::cli {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;
namespace fs = std::filesystem;

struct Answer {
  int code{};
  std::string out, err;
};

inline std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline json read_json(const fs::path& file) { return json::parse(content(file)); }

/// Without what depends on the clock.
inline json timeless(json comparison) {
  for (auto& [name, model] : comparison["models"].items()) model.erase("microseconds_per_throw");
  return comparison;
}

/// The columns of a CSV by name, as text.
inline std::map<std::string, std::vector<std::string>> columns_of(const std::string& csv) {
  const auto cells = [](const std::string& line) {
    std::istringstream in(line);
    std::vector<std::string> out;
    for (std::string cell; std::getline(in, cell, ',');) out.push_back(cell);
    return out;
  };
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto names = cells(line);
  std::map<std::string, std::vector<std::string>> out;
  while (std::getline(lines, line)) {
    const auto row = cells(line);
    EXPECT_EQ(row.size(), names.size()) << line;
    for (std::size_t i = 0; i < std::min(row.size(), names.size()); ++i) out[names[i]].push_back(row[i]);
  }
  return out;
}

/// How high every throw of a log flew, as motion capture saw it [m].
inline std::vector<double> peaks_of(const datasets::ThrowLog& log) {
  std::vector<double> out;
  for (const auto& one : log.throws) {
    double& peak = out.emplace_back(-1);
    for (std::size_t i = 0; i < one.mocap->pose.rows; ++i)
      if (one.mocap->is_valid(i)) peak = std::max(peak, one.mocap->pose(i, 1));
  }
  return out;
}

/// Every test has a folder of its own; a tiny campaign is made once for all.
class Cli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared = fs::temp_directory_path() / ("unhand_cli_" + std::to_string(getpid()));
    fs::create_directory(shared);
    ASSERT_EQ(run_in(shared, "generate quick12 --seed 3 --out quick.h5").code, 0);
    write_flights(shared / "flights.h5");
  }
  static void TearDownTestSuite() { fs::remove_all(shared); }

  void SetUp() override {
    folder = shared / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::create_directory(folder);
    quick = (shared / "quick.h5").string();
    flights = (shared / "flights.h5").string();
  }

  static Answer run_in(const fs::path& where, const std::string& arguments,
                       const std::string& environment = "") {
    const fs::path out = shared / "stdout.txt", err = shared / "stderr.txt";
    const std::string command = "cd '" + where.string() + "' && " + environment + " '" UNHAND_BINARY "' " +
                                arguments + " >'" + out.string() + "' 2>'" + err.string() + "' </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content(out), content(err)};
  }
  Answer run(const std::string& arguments, const std::string& environment = "") const {
    return run_in(folder, arguments, environment);
  }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      names.insert(fs::relative(entry.path(), folder).string());
    return names;
  }

  /// The tiny campaign with every throw changed, as a file in the test's folder.
  template <class Change>
  void write_changed(const std::string& name, Change&& change) const {
    auto log = datasets::read_throw_log(quick);
    for (auto& one : log.throws) change(one);
    datasets::write_throw_log(folder / name, log);
  }
  /// The tiny campaign without held-out throws.
  void write_all_train(const std::string& name) const {
    write_changed(name, [](datasets::Throw& one) { one.split = datasets::Split::train; });
  }

  /// One line on stderr, nothing on stdout, nothing written.
  void expect_refusal(const std::string& arguments, int code, const std::string& reason) {
    const auto before = files();
    const Answer answer = run(arguments);
    EXPECT_EQ(answer.code, code) << arguments << "\n" << answer.err;
    EXPECT_THAT(answer.err, HasSubstr(reason)) << arguments;
    EXPECT_THAT(answer.err, StartsWith("unhand: ")) << arguments;
    EXPECT_THAT(answer.out, IsEmpty()) << arguments;
    EXPECT_EQ(files(), before) << arguments;
    if (code == 3) {
      EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
    }
  }

  /// Cubes that fall without air, tracked without noise.
  static void write_flights(const fs::path& file) {
    datasets::ThrowLog log;
    log.dimension = 3;
    log.title = "falling cubes";
    log.source = "made by a test";
    log.objects["cube"].mass = 0.4;
    log.objects["cube"].inertia = std::vector<double>{1e-3, 1e-3, 1e-3};
    for (int n = 0; n < 5; ++n) {
      datasets::Throw one;
      one.id = "toss-" + std::to_string(n);
      one.object = "cube";
      one.condition = "toss";
      one.repetition = n;
      one.split = n == 4 ? datasets::Split::test : datasets::Split::train;
      datasets::MocapLog& mocap = one.mocap.emplace();
      mocap.time = {40, 1, {}, {}};
      mocap.pose = {40, 7, {}, {}};
      for (int i = 0; i < 40; ++i) {
        const double t = 0.01 * i, half = 0.5 * (1 + n) * t;
        mocap.time.data.push_back(t);
        for (const double value : {0.3 * n + 1.1 * t, 0.2 * t, 1 + 0.5 * t - 0.5 * 9.81 * t * t,
                                   std::cos(half), 0.0, 0.0, std::sin(half)})
          mocap.pose.data.push_back(value);
      }
      log.throws.push_back(std::move(one));
    }
    datasets::write_throw_log(file, log);
  }

  /// The same without orientations.
  void write_unoriented_flights(const std::string& name) const {
    auto log = datasets::read_throw_log(flights);
    for (auto& one : log.throws) {
      datasets::Series& pose = one.mocap->pose;
      datasets::Series positions{pose.rows, 3, {}, {1e-4, 2e-4, 3e-4}};
      for (std::size_t i = 0; i < pose.rows; ++i)
        for (std::size_t j = 0; j < 3; ++j) positions.data.push_back(pose(i, j));
      pose = std::move(positions);
    }
    datasets::write_throw_log(folder / name, log);
  }

  static inline fs::path shared;
  fs::path folder;
  std::string quick, flights;
};

}  // namespace unhand::cli
