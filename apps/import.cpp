// unhand import: logs from the files of others.
#include <fmt/format.h>

#include <memory>

#include "apps/command.hpp"
#include "apps/output.hpp"
#include "datasets/import_cube_tosses.hpp"

namespace unhand::apps {
namespace {

struct Options {
  std::string format, out, json;
  std::vector<std::string> inputs;
  int threads{0};
};

/// What an importer says of its inputs.
struct Imported {
  std::string text;
  Json details;
};

Imported import_cubes(const Options& options, Outputs& outputs) {
  if (options.inputs.size() != 1)
    throw WrongUsage(fmt::format("cube-tosses takes one CSV file, not {}", options.inputs.size()));
  datasets::ImportReport report;
  const auto log = datasets::import_cube_tosses(options.inputs.front(), {}, &report);
  outputs.log(options.out, log);
  Imported out;
  out.text = fmt::format("{}: {} of {} tosses ({} train, {} test)\n", options.out, report.kept, report.tosses,
                         report.train, report.test);
  for (const auto& dropped : report.dropped)
    out.text +=
        fmt::format("  dropped toss {} ({} samples): {}\n", dropped.toss, dropped.samples, dropped.reason);
  out.details = {{"rows", report.rows},   {"tosses", report.tosses}, {"kept", report.kept},
                 {"train", report.train}, {"test", report.test},     {"dropped", Json::array()}};
  for (const auto& dropped : report.dropped)
    out.details["dropped"].push_back(
        {{"toss", dropped.toss}, {"samples", dropped.samples}, {"reason", dropped.reason}});
  return out;
}

struct Format {
  const char *name, *summary;
  Imported (*read)(const Options&, Outputs&);
};
/// An importer is one line here.
constexpr Format formats[] = {
    {"cube-tosses", "measured tosses of a cube, one CSV in SI units: a throw log", &import_cubes},
};

std::string known_formats() {
  std::string out;
  for (const Format& format : formats) out += fmt::format("\n  {}: {}", format.name, format.summary);
  return out;
}

void import(const Options& options) {
  for (const Format& format : formats) {
    if (options.format != format.name) continue;
    require_writable(options.out);
    require_writable(options.json);
    Outputs outputs;
    const Imported imported = format.read(options, outputs);
    if (!options.json.empty()) {
      Json report = json_head("import");
      report["format"] = options.format;
      report["inputs"] = options.inputs;
      report["log"] = options.out;
      report.update(imported.details);
      outputs.json(options.json, report);
    }
    outputs.commit();
    fmt::print("{}", imported.text);
    return;
  }
  throw WrongUsage(fmt::format("format '{}' is not known; there are:{}", options.format, known_formats()));
}

}  // namespace

Command import_command(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* parser = root.add_subcommand("import", "Make a log from measured data in another format");
  parser->add_option("FORMAT", options->format, "Which format:" + known_formats())->required();
  parser->add_option("INPUT", options->inputs, "The files to read")->required();
  parser->add_option("--out", options->out, "The log to write (replaced if it exists)")->required();
  parser->add_option("--json", options->json, "Write what was read, kept and dropped as JSON");
  add_threads(*parser, options->threads);
  parser->footer("Example:\n  unhand import cube-tosses cube_tosses.csv --out cubes.h5");
  return {parser, [options] { import(*options); }};
}

}  // namespace unhand::apps
