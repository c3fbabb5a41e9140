#include "apps/parser.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <type_traits>
#include <vector>

#include "apps/tell.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::apps {
namespace {

/// Finite numbers that `accept` lets pass; `accepted` completes "... is not".
template <class Accept>
CLI::Validator finite_number(const std::string& accepted, const std::string& in_help, Accept accept) {
  return CLI::Validator(
      [=](std::string& text) -> std::string {
        double value = 0;
        if (CLI::detail::lexical_cast(text, value) && std::isfinite(value) && accept(value)) return {};
        return fmt::format("{} is not {}", text, accepted);
      },
      in_help);
}

/// CLI11 lets -1 wrap around, and says of 1e3 only that it cannot convert it.
template <class Integer>
CLI::Validator whole_number() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        Integer value = 0;
        const char* end = text.data() + text.size();
        const auto read = std::from_chars(text.data(), end, value);
        if (read.ec == std::errc{} && read.ptr == end) return {};
        if (std::is_signed_v<Integer> && read.ec != std::errc::result_out_of_range)
          return fmt::format("{} is not a whole number", text);
        using Limits = std::numeric_limits<Integer>;
        return fmt::format("{} is not a whole number from {} to {}", text, Limits::min(), Limits::max());
      },
      "");
}

CLI::Validator one_among(const std::vector<std::string>& names) {
  return CLI::Validator(
      [names](std::string& text) -> std::string {
        if (std::find(names.begin(), names.end(), text) != names.end()) return {};
        return datasets::unknown_name(fmt::format("there is no '{}'", text), text, names);
      },
      fmt::format("{{{}}}", fmt::join(names, ",")));
}

/// Of a long option that the command does not have, with the nearest that it has; empty if there is none.
std::string unknown_option(const CLI::App& command, int argc, char** argv) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i], name = argument.substr(0, argument.find('='));
    if (name == "--") break;
    if (!name.starts_with("--") || std::find(known.begin(), known.end(), name) != known.end()) continue;
    return datasets::unknown_name(fmt::format("there is no option '{}'", name), name, known);
  }
  return {};
}

/// CLI11's help with its second column broken at blanks, to a hundred columns in all.
class WrappedHelp final : public CLI::Formatter {
 public:
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped(CLI::Formatter::make_option_desc(option));
  }
  std::string make_subcommand(const CLI::App* sub) const override {
    std::stringstream out;
    CLI::detail::format_help(out, sub->get_display_name(true), wrapped(sub->get_description()),
                             get_column_width());
    return out.str();
  }

 private:
  std::string wrapped(const std::string& text) const {
    const std::size_t width = 100 - get_column_width();
    std::string out;
    std::size_t column = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line); column = 0) {
      if (!out.empty()) out += '\n';
      std::istringstream words(line);
      for (std::string word; words >> word;) {
        const bool fits = column == 0 || column + 1 + word.size() <= width;
        if (column > 0) out += fits ? ' ' : '\n';
        column = (fits && column > 0 ? column + 1 : 0) + word.size();
        out += word;
      }
    }
    return out;
  }
};

/// How the help shows the values of an option that takes assignments; such options are known by it.
const char* const kAssignment = "NAME=VALUE";

/// The words, with `--effect A=1 B=2` as `--effect A=1 --effect B=2` where the option takes assignments.
std::vector<std::string> repeated(const CLI::App& command, int argc, char** argv) {
  std::vector<std::string> out;
  std::string name;  // of the option whose values may go on
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool first = !name.empty() && out.back() == name;
    if (word.starts_with('-')) {
      const CLI::Option* option = command.get_option_no_throw(word);
      name = option && option->get_type_name().starts_with(kAssignment) ? word : "";
    } else if (!first && word.find('=') == std::string::npos) {
      name.clear();
    } else if (!first && !name.empty()) {
      out.push_back(name);
    }
    out.push_back(word);
  }
  return out;
}

/// CLI11's message; of an option that is given too often, in plain words.
std::string in_words(const CLI::ParseError& error) {
  const std::string said = error.what(), too_often = ": At Most 1 required but received ";
  const auto at = said.find(too_often);
  if (at == std::string::npos) return said;
  return fmt::format("{}: given {} times, and one is taken", said.substr(0, at),
                     said.substr(at + too_often.size()));
}

}  // namespace

Option Option::required() { return option_->required(), *this; }
Option Option::range(double low, double high) {
  const auto bounds = fmt::format("{:g} to {:g}", low, high);
  return option_->check(finite_number("a number from " + bounds, bounds,
                                      [=](double x) { return low <= x && x <= high; })),
         *this;
}
Option Option::positive() {
  return option_->check(finite_number("a number > 0", "> 0", [](double x) { return x > 0; })), *this;
}
Option Option::not_negative() {
  return option_->check(finite_number("a number >= 0", ">= 0", [](double x) { return x >= 0; })), *this;
}
Option Option::not_empty() {
  return option_->check(CLI::Validator(
             [](std::string& text) -> std::string { return text.empty() ? "'' names no file" : ""; }, "")),
         *this;
}
Option Option::one_of(const std::vector<std::string>& values) {
  return option_->check(one_among(values)), *this;
}
Option Option::with_commas() {
  option_->delimiter(',')->transform(CLI::Validator(
      [](std::string& word) {
        CLI::detail::trim(word);
        return std::string();
      },
      ""));
  return *this;
}
Option Option::expected(int least, int most) { return option_->expected(least, most), *this; }
Option Option::one_value_each() { return option_->allow_extra_args(false), *this; }
Option Option::assignments() { return option_->type_name(kAssignment)->allow_extra_args(false), *this; }
Option Option::with_default() { return option_->capture_default_str(), *this; }
Option Option::group(const std::string& name) { return option_->group(name), *this; }
bool Option::given() const { return option_->count() > 0; }

Parser::Parser(const std::string& description, const std::string& name, const std::string& version)
    : root_(std::make_unique<CLI::App>(description, name)), app_(root_.get()) {
  root_->formatter(std::make_shared<WrappedHelp>());  // of the subcommands, too
  root_->set_version_flag("--version", version);
}
Parser::Parser(CLI::App* subcommand) : app_(subcommand) {}
Parser::~Parser() = default;

Parser& Parser::subcommand(const std::string& name, const std::string& description) {
  subcommands_.push_back(std::unique_ptr<Parser>(new Parser(app_->add_subcommand(name, description))));
  return *subcommands_.back();
}
void Parser::require_subcommand() { app_->require_subcommand(1); }
void Parser::footer(const std::string& text) { app_->footer(text); }

template <class T>
Option Parser::option(const std::string& name, T& value, const std::string& help) {
  CLI::Option* const out = app_->add_option(name, value, help);
  if constexpr (std::is_integral_v<T>) out->check(whole_number<T>());
  if constexpr (std::is_same_v<T, std::optional<int>>) out->check(whole_number<int>());
  if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>> ||
                std::is_same_v<T, std::vector<double>>)
    out->check(finite_number("a finite number", "", [](double) { return true; }));
  return Option(out);
}
template Option Parser::option(const std::string&, std::string&, const std::string&);
template Option Parser::option(const std::string&, double&, const std::string&);
template Option Parser::option(const std::string&, int&, const std::string&);
template Option Parser::option(const std::string&, unsigned&, const std::string&);
template Option Parser::option(const std::string&, std::uint64_t&, const std::string&);
template Option Parser::option(const std::string&, std::optional<int>&, const std::string&);
template Option Parser::option(const std::string&, std::optional<double>&, const std::string&);
template Option Parser::option(const std::string&, std::vector<std::string>&, const std::string&);
template Option Parser::option(const std::string&, std::vector<double>&, const std::string&);

Option Parser::file(const std::string& name, std::string& value, const std::string& help) {
  return option(name, value, help).not_empty();
}

Option Parser::flag(const std::string& name, bool& value, const std::string& help) {
  return Option(app_->add_flag(name, value, help));
}

Option Parser::choice(const std::string& name, const std::vector<std::string>& names,
                      std::function<void(std::size_t)> choose, const std::string& help) {
  const auto chosen = [names, choose](const std::string& text) {
    choose(static_cast<std::size_t>(std::find(names.begin(), names.end(), text) - names.begin()));
  };
  return Option(app_->add_option_function<std::string>(name, chosen, help)->check(one_among(names)));
}

bool Parser::chosen() const { return app_->parsed(); }
bool Parser::given(const std::string& option) const { return app_->count(option) > 0; }

Parser::Parsed Parser::parse(int argc, char** argv) {
  const CLI::App* at = app_;
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) {  // CLI11 says only that some command is required
    const auto below = at->get_subcommands([](const CLI::App*) { return true; });
    if (below.empty()) break;
    const auto named = std::find_if(below.begin(), below.end(),
                                    [&](const CLI::App* one) { return one->get_name() == argv[i]; });
    if (named == below.end()) {
      std::vector<std::string> known;
      for (const CLI::App* one : below) known.push_back(one->get_name());
      tell("unhand: {}\n",
           datasets::unknown_name(fmt::format("there is no command '{}'", argv[i]), argv[i], known));
      return Parsed::wrong_usage;
    }
    at = *named;
  }
  if (const std::string wrong = unknown_option(*at, argc, argv); !wrong.empty()) {
    tell("unhand: {}\n", wrong);
    return Parsed::wrong_usage;
  }
  try {
    auto words = repeated(*at, argc, argv);
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    app_->parse(std::move(words));
    return Parsed::run;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) {
      tell("unhand: {}\nRun with --help for more information.\n", in_words(error));
      return Parsed::wrong_usage;
    }
    app_->exit(error);  // prints the help or the version
    return Parsed::helped;
  }
}

}  // namespace unhand::apps
