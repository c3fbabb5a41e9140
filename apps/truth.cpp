#include "apps/truth.hpp"

namespace unhand::apps {
namespace {

Json pose_json(const dynamics::Pose<double>& p) { return {p.x, p.z, p.theta}; }
Json twist_json(const dynamics::Twist<double>& v) { return {v.vx, v.vz, v.omega}; }

Json patch_json(const contact::Patch<double>& patch) {
  return {{"mu", patch.mu}, {"radius", patch.radius}, {"length", patch.length()}, {"pads", patch.pads}};
}
Json opening_json(const contact::OpeningProfile<double>& opening) {
  return {{"open_command", opening.open_command},
          {"grip_force", opening.grip_force},
          {"dead_time", opening.dead_time},
          {"opening_time", opening.opening_time},
          {"shape", opening.shape}};
}

Json throw_json(const experiment::SyntheticThrow& one) {
  const auto& [record, t] = one;
  Json out;
  out["object"] = record.object;
  out["condition"] = record.condition;
  out["mu"] = t.patch.mu;
  out["grasp_angle"] = t.grasp_angle;
  out["grasp_offset"] = t.grasp_offset;
  out["opening"] = opening_json(t.opening);
  out["hand_at_switch"] = {{"pose", pose_json(t.motion.pose)},
                           {"twist", twist_json(t.motion.twist)},
                           {"acceleration_before", t.motion.before},
                           {"acceleration_after", t.motion.after}};
  out["detach"] = {
      {"time", t.detach_time}, {"pose", pose_json(t.detach_pose)}, {"twist", twist_json(t.detach_twist)}};
  out["slip"] = t.slip;
  out["pivot"] = t.pivot;
  out["landing"] = {{"time", t.landing_time}, {"pose", pose_json(t.landing_pose)}};
  return out;
}

}  // namespace

Json truth_json(const experiment::CampaignDesign& design, std::uint64_t seed, const std::string& log,
                const std::vector<experiment::SyntheticThrow>& throws) {
  Json out = json_head("truth");
  out["log"] = log;
  out["campaign"] = design.name;
  out["seed"] = seed;
  out["contact_model"] = design.contact_model;
  out["gravity"] = design.gravity;
  out["landing_height"] = design.landing_height;
  out["patch"] = patch_json(design.patch);
  out["opening"] = opening_json(design.opening);
  out["reference_force"] = design.reference_force();
  out["objects"] = Json::object();
  for (const auto& object : design.objects)
    out["objects"][object.name] = {{"mass", object.body.mass},
                                   {"inertia", object.body.inertia},
                                   {"com_offset", object.com_offset},
                                   {"drag_k", object.drag_k}};
  out["effects"] = Json::object();
  for (const auto& [name, value] : design.effects) {
    const auto* parameter = experiment::find_parameter(experiment::without_object(name));
    out["effects"][name] = {{"value", value}, {"unit", parameter->unit}, {"neutral", parameter->neutral}};
  }
  out["throws"] = Json::object();
  for (const auto& one : throws) out["throws"][one.record.id] = throw_json(one);
  return out;
}

}  // namespace unhand::apps
