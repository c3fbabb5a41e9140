// `unhand figure`.
#pragma once

#include "apps/command.hpp"

namespace unhand::apps {

Command figure_command(CLI::App& root);

}  // namespace unhand::apps
