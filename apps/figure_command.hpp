// `unhand figure`.
#pragma once

#include "apps/command.hpp"

namespace unhand::apps {

Command figure_command(Parser& root);

}  // namespace unhand::apps
