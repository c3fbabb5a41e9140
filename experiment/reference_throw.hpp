// A throw to ask about: nobody has thrown it yet.
#pragma once

#include <string>

#include "datasets/throw_log.hpp"
#include "experiment/prepared_throw.hpp"

namespace unhand::experiment {

/// The flip motion in the middle of the campaign batch180 (pitch −22°, 2.4 m/s at 42°, braking with 9 m/s²
/// while the gripper opens), with another object. Without a measured normal force: the opening is a profile.
/// The landing height is 0, as there. Throws std::invalid_argument unless the object's inertia is known.
PreparedThrow reference_throw(const std::string& name, const datasets::Object& object);

/// A logged throw's hand and normal force with another object, held as the logged one was. Throws
/// datasets::LogError as prepare() does.
PreparedThrow with_object(const datasets::ThrowLog& log, const datasets::Throw& logged,
                          const std::string& file, const datasets::Object& object);

}  // namespace unhand::experiment
