// docs/output-keys.md has every key of the JSON outputs.
#include <gtest/gtest.h>

#include <regex>

#include "tests/apps/cli.hpp"
#include "tests/apps/lab_files.hpp"

namespace unhand::cli {
namespace {

/// Objects whose keys are names: of parameters, objects, models, channels, conditions.
const std::set<std::string> kByName{"parameters",
                                    "parameters_before",
                                    "parameter_units",
                                    "parameter_sigmas",
                                    "models",
                                    "surfaces",
                                    "own_spreads",
                                    "own",
                                    "conditions",
                                    "declared_objects",
                                    "groups",
                                    "noise",
                                    "channels",
                                    "numbers",
                                    "derivatives",
                                    "datasets",
                                    "predicted",
                                    "drives",
                                    "autocorrelation",
                                    "not_compared",
                                    "objects",
                                    "effects",
                                    "throws",
                                    "left_out",
                                    "footprint_correlations"};

void collect(const json& at, const std::string& parent, std::set<std::string>& keys) {
  if (at.is_array())
    for (const json& element : at) collect(element, parent + "[]", keys);
  if (!at.is_object() || parent == "card") return;
  for (const auto& [key, value] : at.items()) {
    if (!kByName.contains(parent)) keys.insert(key);
    collect(value, key, keys);
  }
}

/// Words in backticks of the page's introduction and of one of its sections.
std::set<std::string> words_of(const std::string& page, const std::string& section) {
  const std::string introduction = page.substr(0, page.find("\n## "));
  const std::size_t begin = page.find("\n## " + section + "\n");
  if (begin == std::string::npos) return {};
  const std::string text = introduction + page.substr(begin, page.find("\n## ", begin + 1) - begin);
  std::set<std::string> out;
  const std::regex code("`([^`]+)`"), word("[A-Za-z0-9_]+");
  for (std::sregex_iterator it(text.begin(), text.end(), code), end; it != end; ++it) {
    const std::string found = (*it)[1];
    for (std::sregex_iterator w(found.begin(), found.end(), word); w != end; ++w) out.insert(w->str());
  }
  return out;
}

TEST_F(Cli, ThePageHasEveryKeyOfTheOutputs) {
  const std::string page = content(fs::path(UNHAND_SOURCE_DIR) / "docs/output-keys.md");
  const std::string sku = (fs::path(UNHAND_SOURCE_DIR) / "examples/bar.toml").string();
  ASSERT_EQ(run("fit " + quick + " --model limit_surface_disc --card card.json").code, 0);
  write_lab_files(folder);
  const std::string hand =
      "import hand-csv hand/slow_01.csv hand/slow_02.csv --columns "
      "time=t,x=X,z=Z,theta=pitch,vx=VX,vz=VZ,omega=Q,ax=AX,az=AZ,alpha=DQ --units "
      "time=ms,x=mm,z=mm,theta=deg,vx=m/s,vz=m/s,omega=deg/s,ax=m/s^2,az=m/s^2,alpha=deg/s^2 "
      "--sku bar.toml --opening-time 0.1 --out log.h5";
  const std::pair<std::string, std::string> commands[] = {
      {"unhand generate", "generate quick12 --out g.h5"},
      {"unhand generate", "generate quick12 --effect contact.stribeck=1.3 --out g.h5 --truth out.json"},
      {"unhand import", hand},
      {"unhand import",
       "import motive-csv takes/slow_01.csv takes/slow_02.csv --sigma position=2e-4,angle=3e-3 --landing "
       "--into log.h5 --out full.h5"},
      {"unhand figure", "figure all --out figures"},
      {"unhand crosscheck", "crosscheck " + quick + " --engine patch --steps 1e-3"},
      {"unhand crosscheck", "crosscheck " + quick + " --engine cvode"},
      {"unhand compare", "compare " + quick},
      {"unhand fit", "fit " + quick + " --model limit_surface_disc"},
      {"unhand predict", "predict " + quick + " --card card.json"},
      {"unhand inspect", "inspect " + quick},
      {"unhand discover", "discover " + quick},
      {"unhand validate-sku", "validate-sku " + sku + " --card card.json --samples 100"},
      {"unhand plan throw", "plan throw --target 1.3,0,-0.2 --card card.json --sku " + sku},
      {"unhand plan control", "plan control --seeds 2 --repetitions 0"},
      {"unhand plan elastic", "plan elastic --starts 1 --intervals 8"},
      {"unhand plan elastic", "plan elastic --target 2.2 --starts 1 --intervals 8 --nodes 4 --checks 2"},
      {"unhand plan wrist", "plan wrist --stiffnesses 2 --softest 4 --stiffest 16 --starts 1 --intervals 4"},
      {"unhand plan flip", "plan flip --learner m2 --target 1.2,180 --iterations 2"}};
  for (const auto& [section, command] : commands) {
    const bool written = command.find("out.json") != std::string::npos;
    ASSERT_EQ(run(command + (written ? "" : " --json out.json")).code, 0) << command;
    std::set<std::string> keys;
    collect(read_json(folder / "out.json"), "", keys);
    ASSERT_GT(keys.size(), 5u) << section;
    const auto words = words_of(page, section);
    for (const std::string& key : keys) EXPECT_TRUE(words.contains(key)) << section << ": " << key;
  }
}

}  // namespace
}  // namespace unhand::cli
