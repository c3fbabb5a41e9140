#include "apps/elastic_answer.hpp"

#include <fmt/format.h>

#include <filesystem>

namespace unhand::apps {

void give(const ElasticAnswer& answer, const std::string& command, const std::string& arm,
          const std::string& json, const std::string& report) {
  Outputs outputs{{arm}};
  if (!report.empty()) {
    const std::filesystem::path folder = outputs.directory(report);
    for (const Figure& figure : answer.figures) draw(figure, folder, "simulated by unhand " + command);
    write_text(folder / answer.table_file, answer.table.markdown() + "\n" + answer.notes);
    write_text(folder / "trajectory.csv", answer.trajectories);
    write_text(folder / "plan.json", json_text(answer.json));
  }
  if (!json.empty()) outputs.json(json, answer.json);
  outputs.commit();
  fmt::print("{}\n{}", answer.table.text(), answer.notes);
}

}  // namespace unhand::apps
