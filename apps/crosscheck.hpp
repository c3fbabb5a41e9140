// unhand crosscheck: other engines on a log's throws.
#pragma once

#include "apps/command.hpp"

namespace unhand::apps {

Command crosscheck_command(Parser& root);

}  // namespace unhand::apps
