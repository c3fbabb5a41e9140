#include "apps/flip_store.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <fstream>
#include <utility>

#include "apps/command.hpp"
#include "datasets/log_error.hpp"
#include "experiment/compare.hpp"

namespace unhand::apps {
namespace {

namespace fs = std::filesystem;
namespace fl = planners::flip;

Json read_json(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw datasets::LogError(file.string(), "", "cannot be read");
  try {
    return Json::parse(in);
  } catch (const Json::exception& error) {
    throw datasets::LogError(file.string(), "/", error.what());
  }
}

Json command_json(const fl::FlipCommand& u) {
  return {{"pitch_rad", u.pitch}, {"speed", u.speed}, {"damping_n_m_s", u.damping}};
}

/// The throw in a file, which must bear this label.
fl::FlipTrial trial_of(const fs::path& file, const Json& label, const fl::FlipCommand& command) {
  const Json json = read_json(file);
  fl::FlipTrial out;
  const auto refuse = [&](const std::string& where, const std::string& why) {
    throw datasets::LogError(file.string(), where, why);
  };
  try {
    for (const auto& [key, value] : label.items())
      if (const Json& found = json.at(key); found != value)
        refuse("/" + key, fmt::format("not the throw that this run asks for: {} instead of {}", found.dump(),
                                      value.dump()));
    out.command = command;
    const std::string outcome = json.at("outcome");
    for (const auto one :
         {fl::FlipOutcome::landed, fl::FlipOutcome::not_let_go, fl::FlipOutcome::never_lands})
      if (outcome == to_string(one)) {
        out.outcome = one;
        const Json& use = json.at("use");
        out.use = {use.at("position"), use.at("velocity"), use.at("torque"), use.at("cut_torque"),
                   use.at("cut_rate")};
        if (one != fl::FlipOutcome::landed) return out;
        out.hand = json.at("hand").get<std::array<double, 6>>();
        out.detach = json.at("detach").get<std::array<double, 6>>();
        out.landing = {json.at("landing").at("x_m"), json.at("landing").at("angle_rad")};
        return out;
      }
    refuse("/outcome", fmt::format("'{}' is no outcome", outcome));
  } catch (const Json::exception& error) {
    refuse("/", error.what());
  }
  return out;
}

/// A setting as the command line takes it; empty where it is told by a file or by several options.
std::string as_option(const std::string& key, const Json& value) {
  if (key == "target")
    return fmt::format("{:g},{:g}", value.at(0).get<double>(),
                       value.at(1).get<double>() * experiment::kDegrees);
  if (key == "learner") return value.get<std::string>();
  if (key == "seed" || key == "throws" || key == "repeats") return value.dump();
  return {};
}

/// "--target 1.2,180 and not 1.3,180", "another --robot": what the run of a folder has that this one has not.
std::string difference(const std::string& key, const Json& there, const Json& here) {
  try {
    if (const std::string old = as_option(key, there); !old.empty())
      return fmt::format("--{} {} and not {}", key, old, as_option(key, here));
  } catch (const Json::exception&) {  // of another version, or written by hand
  }
  return key == "bar" ? "another bar (--sku, --com-offset, --robot)" : "another --" + key;
}

}  // namespace

Json bar_json(const fl::Bar& b) {
  return {{"mass_kg", b.mass}, {"inertia_kg_m2", b.inertia}, {"com_offset_m", b.com_offset}};
}

Json trial_json(const fl::FlipTrial& t) {
  Json out{{"command", command_json(t.command)}, {"outcome", to_string(t.outcome)}};
  if (t.outcome == fl::FlipOutcome::landed) {
    out["hand"] = t.hand;
    out["detach"] = t.detach;
    out["landing"] = {{"x_m", t.landing.x}, {"angle_rad", t.landing.angle}};
  }
  out["use"] = {{"position", t.use.position},
                {"velocity", t.use.velocity},
                {"torque", t.use.torque},
                {"cut_torque", t.use.cut_torque},
                {"cut_rate", t.use.cut_rate}};
  return out;
}

FlipStore::FlipStore(fs::path directory, const Json& settings)
    : directory_(std::move(directory)), robot_(settings.at("robot")), seed_(settings.at("seed")) {
  std::error_code error;
  fs::create_directories(directory_ / "trials", error);
  if (error) throw Unanswered(fmt::format("{}: cannot be made: {}", directory_.string(), error.message()));
  const fs::path whole = fs::weakly_canonical(directory_, error);
  remove_leftovers(whole.parent_path(), whole.filename().string());
  for (const fs::path& folder : {directory_, directory_ / "trials"}) remove_leftovers(folder);
  const fs::path file = directory_ / "session.json";
  if (!fs::exists(file)) {
    Json head = json_head("plan-flip-session");
    head["settings"] = settings;
    Outputs outputs;
    outputs.json(file, head);
    outputs.commit();
    return;
  }
  const Json there = read_json(file);
  const auto found = there.find("settings");
  if (found == there.end() || !found->is_object())
    throw datasets::LogError(file.string(), "/settings", "required key is missing");
  std::vector<std::string> differences;
  for (const auto& [key, value] : settings.items()) {
    const Json old = found->value(key, Json(nullptr));
    if (old != value) differences.push_back(difference(key, old, value));
  }
  if (!differences.empty())
    throw WrongUsage(fmt::format(
        "--report: {} holds the throws of a run with {}: give the same to go on with it, or another "
        "directory, or remove that one to begin anew",
        directory_.string(), fmt::join(differences, ", ")));
}

Json FlipStore::label_of(const fl::TrialRequest& request) const {
  return {{"robot", robot_},
          {"seed", seed_},
          {"stage", request.stage},
          {"index", request.index},
          {"bar", bar_json(request.bar)},
          {"command", command_json(request.command)}};
}

fl::Thrower FlipStore::over(fl::Thrower plant) {
  return [this, plant = std::move(plant)](const fl::TrialRequest& request) {
    const fs::path file = directory_ / "trials" / fmt::format("{}-{:04}.json", request.stage, request.index);
    const Json label = label_of(request);
    if (fs::exists(file)) {
      ++recalled_;
      return trial_of(file, label, request.command);
    }
    const fl::FlipTrial trial = plant(request);
    Json json = json_head("plan-flip-trial");
    json.update(label);
    json.update(trial_json(trial));
    Outputs outputs;
    outputs.json(file, json);
    outputs.commit();
    ++thrown_;
    return trial;
  };
}

}  // namespace unhand::apps
