// The planners that `unhand plan` knows: one function each, named in plan.cpp.
#pragma once

#include "apps/command.hpp"

namespace unhand::apps {

Command plan_control_command(Parser& plan);
Command plan_wrist_command(Parser& plan);
Command plan_elastic_command(Parser& plan);
Command plan_flip_command(Parser& plan);
Command plan_throw_command(Parser& plan);

}  // namespace unhand::apps
