// The options of the command line. CLI11 parses them; only parser.cpp includes it, since it takes seconds to
// compile in every file.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace unhand::apps {

/// One option of a subcommand; the functions say what it accepts and can be chained.
class Option {
 public:
  Option required();
  Option range(double low, double high);
  Option positive();  ///< and finite
  Option not_negative();
  Option not_empty();
  Option one_of(const std::vector<std::string>& values);
  /// Several values in one argument, separated by commas.
  Option with_commas();
  /// How many values.
  Option expected(int least, int most);
  /// One value each time it is given; it may be given again.
  Option one_value_each();
  /// Values as NAME=VALUE: one, and the words with '=' that follow it; it may be given again.
  Option assignments();
  /// The help shows the value that holds if it is not given.
  Option with_default();
  /// Under this heading in the help.
  Option group(const std::string& name);
  /// Whether the command line gave it; known after parsing.
  bool given() const;

 private:
  friend class Parser;
  explicit Option(CLI::Option* option) : option_(option) {}
  CLI::Option* option_;
};

/// A command or subcommand: its options, and after parsing, whether it was chosen. Variables that options
/// fill must outlive the parsing.
class Parser {
 public:
  Parser(const std::string& description, const std::string& name, const std::string& version);
  ~Parser();
  Parser(const Parser&) = delete;
  Parser& operator=(const Parser&) = delete;

  Parser& subcommand(const std::string& name, const std::string& description);
  void require_subcommand();
  void footer(const std::string& text);

  /// For text, numbers and lists of them: std::string, double, int, unsigned, std::uint64_t,
  /// std::optional<int> or <double>, std::vector of std::string or double.
  template <class T>
  Option option(const std::string& name, T& value, const std::string& help);
  /// The name of a file or directory: never empty, as where a shell's variable is not set.
  Option file(const std::string& name, std::string& value, const std::string& help);
  Option flag(const std::string& name, bool& value, const std::string& help);
  /// One of several names, each of which stands for a value.
  template <class Value>
  Option choice(const std::string& name, Value& value,
                const std::vector<std::pair<std::string, Value>>& choices, const std::string& help) {
    std::vector<std::string> names;
    for (const auto& c : choices) names.push_back(c.first);
    return choice(
        name, names, [&value, choices](std::size_t k) { value = choices[k].second; }, help);
  }

  bool chosen() const;
  bool given(const std::string& option) const;

  /// What came of the command line.
  enum class Parsed { run, helped, wrong_usage };
  Parsed parse(int argc, char** argv);

 private:
  explicit Parser(CLI::App* subcommand);
  Option choice(const std::string& name, const std::vector<std::string>& names,
                std::function<void(std::size_t)> choose, const std::string& help);

  std::unique_ptr<CLI::App> root_;  // of the whole command; null in a subcommand
  CLI::App* app_;
  std::vector<std::unique_ptr<Parser>> subcommands_;
};

}  // namespace unhand::apps
