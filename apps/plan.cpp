// unhand plan: the subcommand of planners.
#include "apps/command.hpp"

#include <vector>

namespace unhand::apps {

Command plan_command(Parser& root) {
  Parser& parser = root.subcommand("plan", "Plan a throw");
  parser.require_subcommand();
  parser.footer(
      "Outputs of an earlier run in the same place are replaced.\n"
      "Example: unhand plan throw --target 1.3,0,-0.2 --report out/throw");
  const std::vector<Command> planners{plan_throw_command(parser), plan_control_command(parser),
                                      plan_elastic_command(parser), plan_wrist_command(parser),
                                      plan_flip_command(parser)};
  return {&parser, [planners] {
            for (const Command& planner : planners)
              if (planner.parser->chosen()) planner.run();
          }};
}

}  // namespace unhand::apps
