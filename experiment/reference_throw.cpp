#include "experiment/reference_throw.hpp"

#include <stdexcept>

#include "experiment/synthetic_campaign.hpp"

namespace unhand::experiment {

PreparedThrow reference_throw(const std::string& name, const datasets::Object& object) {
  if (!object.inertia || object.inertia->size() != 1)
    throw std::invalid_argument("reference_throw: " + name + " declares no planar moment of inertia");
  const CampaignDesign design = campaign_design("batch180");
  const ThrowMotion motion = design.motion(design.postures[1], design.release_accelerations[3]);
  PreparedThrow out{"reference",
                    name,
                    "reference flip",
                    datasets::Split::test,
                    polynomial_hand(throw_motion(design.arm, motion)),
                    {},
                    {},
                    {},
                    {object.mass, object.inertia->front()},
                    dynamics::level_gravity(design.gravity),
                    object.drag_k.value_or(0),
                    design.landing_height,
                    {object.com_offset.value_or(0), design.grasp_angle},
                    design.begin,
                    design.opening.open_command,
                    {}};
  return out;
}

PreparedThrow with_object(const datasets::ThrowLog& log, const datasets::Throw& logged,
                          const std::string& file, const datasets::Object& object) {
  datasets::ThrowLog header = log;
  header.throws.clear();
  header.objects[logged.object] = object;
  return prepare(header, logged, file);
}

}  // namespace unhand::experiment
