// What the subcommands share: options, errors with their exit codes, and how a subcommand is registered.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <stdexcept>
#include <string>

namespace unhand::apps {

/// Exit codes of the command.
enum ExitCode { done = 0, unanswered = 1, wrong_usage = 2, bad_input = 3 };

/// The computation could not answer; what() says why. Exit code 1.
class Unanswered : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The command line asks for something that there is not. Exit code 2.
class WrongUsage : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A subcommand: what the parser knows of it, and what to do when it is chosen.
struct Command {
  CLI::App* parser{};
  std::function<void()> run;
};

Command generate_command(CLI::App& root);
Command import_command(CLI::App& root);
Command inspect_command(CLI::App& root);
Command compare_command(CLI::App& root);
Command fit_command(CLI::App& root);
Command predict_command(CLI::App& root);
Command discover_command(CLI::App& root);
Command plan_command(CLI::App& root);

/// --threads, the same in every subcommand.
inline void add_threads(CLI::App& parser, int& threads) {
  parser.add_option("--threads", threads, "Threads to use; 0: one per core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

}  // namespace unhand::apps
