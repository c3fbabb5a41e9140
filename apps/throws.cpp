#include "apps/throws.hpp"

#include <fmt/format.h>

#include "apps/command.hpp"
#include "experiment/unit_check.hpp"

namespace unhand::apps {

datasets::ThrowLog read_throws(const std::string& file) {
  if (datasets::read_schema_name(file) == "slip-log")
    throw datasets::LogError(file, "/@schema", "is a slip-log, which holds no throws");
  auto log = datasets::read_throw_log(file);
  if (log.throws.empty()) throw Unanswered(fmt::format("{}: holds no throws", file));
  experiment::require_units(log, file);
  return log;
}

}  // namespace unhand::apps
