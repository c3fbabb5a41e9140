// What the subcommands share: options, errors with their exit codes, and how a subcommand is registered.
#pragma once

#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string>

#include "apps/parser.hpp"

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

/// Throws WrongUsage for options that the command line gives although they mean nothing here: `why`.
inline void refuse_options(const Parser& parser, std::initializer_list<const char*> options,
                           const std::string& why) {
  for (const char* option : options)
    if (parser.given(option)) throw WrongUsage(std::string(option) + ": " + why);
}

/// A subcommand: what the parser knows of it, and what to do when it is chosen.
struct Command {
  const Parser* parser{};
  std::function<void()> run;
};

Command generate_command(Parser& root);
Command import_command(Parser& root);
Command inspect_command(Parser& root);
Command compare_command(Parser& root);
Command fit_command(Parser& root);
Command predict_command(Parser& root);
Command discover_command(Parser& root);
Command plan_command(Parser& root);
Command validate_sku_command(Parser& root);
Command figure_command(Parser& root);
Command crosscheck_command(Parser& root);

Command plan_control_command(Parser& plan);
Command plan_wrist_command(Parser& plan);
Command plan_elastic_command(Parser& plan);
Command plan_flip_command(Parser& plan);
Command plan_throw_command(Parser& plan);

/// --threads, the same in every subcommand.
inline void add_threads(Parser& parser, int& threads) {
  parser.option("--threads", threads, "Threads to use; 0: one per core").range(0, 1024).with_default();
}

/// The same option of a command that runs on one thread, whatever is asked: it is quick, or each of its steps
/// needs the one before.
inline void add_one_thread(Parser& parser, int& threads) {
  parser.option("--threads", threads, "Accepted as everywhere; this command runs on one thread")
      .range(0, 1024);
}

}  // namespace unhand::apps
