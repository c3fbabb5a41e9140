// unhand: the command line.
#include <fmt/format.h>
#include <glog/logging.h>

#include <array>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>

#include "apps/command.hpp"
#include "apps/interruption.hpp"
#include "apps/tell.hpp"
#include "datasets/log_error.hpp"

namespace {

using namespace unhand::apps;

int say(ExitCode code, const std::exception& error) {
  wait_if_interrupted();
  tell("unhand: {}\n", error.what());
  return code;
}

int run(const Command& command) {
  try {
    command.run();
    wait_if_interrupted();
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      throw Unanswered("the answer cannot be written to the standard output");
    return done;
  } catch (const WrongUsage& error) {
    return say(wrong_usage, error);
  } catch (const unhand::datasets::LogError& error) {
    return say(bad_input, error);
  } catch (const std::exception& error) {
    return say(unanswered, error);
  }
}

}  // namespace

int main(int argc, char** argv) {
  end_tidily();
  FLAGS_minloglevel = google::GLOG_FATAL;  // Ceres logs simulations that fail as errors; fits answer for them
  Parser root{"unhand: the physics of letting go. Predicts where released objects land.", "unhand",
              "unhand " UNHAND_VERSION};
  root.require_subcommand();
  root.footer(
      "Exit codes: 0 done, 1 the computation could not answer or its output cannot be written, 2 wrong "
      "usage,\n"
      "3 bad input.\n"
      "Existing outputs are replaced, each at once, and only if everything succeeded.");
  const std::array commands{generate_command(root), import_command(root),    inspect_command(root),
                            compare_command(root),  fit_command(root),       predict_command(root),
                            discover_command(root), plan_command(root),      validate_sku_command(root),
                            figure_command(root),   crosscheck_command(root)};
  switch (root.parse(argc, argv)) {
    case Parser::Parsed::helped:
      return done;
    case Parser::Parsed::wrong_usage:
      return wrong_usage;
    case Parser::Parsed::run:
      break;
  }
  for (const Command& command : commands)
    if (command.parser->chosen()) return run(command);
  return wrong_usage;
}
