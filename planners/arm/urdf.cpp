// URDF: the one file that knows XML.
#include <fmt/format.h>
#include <tinyxml2.h>

#include <Eigen/Geometry>
#include <cctype>
#include <cmath>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/log_error.hpp"
#include "planners/arm/chain_file.hpp"

namespace unhand::planners {
namespace {

using tinyxml2::XMLElement;

/// "not well formed XML (mismatched element)" of XML_ERROR_MISMATCHED_ELEMENT.
std::string words(std::string name) {
  constexpr std::string_view prefix = "XML_ERROR_";
  if (name.starts_with(prefix)) name.erase(0, prefix.size());
  for (char& c : name) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return fmt::format("not well formed XML ({})", name);
}

class Urdf {
 public:
  explicit Urdf(std::string file) : file_(std::move(file)) {
    if (document_.LoadFile(file_.c_str()) != tinyxml2::XML_SUCCESS) {
      const int line = document_.ErrorLineNum();
      const bool missing = document_.ErrorID() == tinyxml2::XML_ERROR_FILE_NOT_FOUND;
      throw datasets::ImportError(file_, line > 0 ? fmt::format("line {}", line) : "",
                                  missing ? "no such file" : words(document_.ErrorName()));
    }
    const XMLElement* robot = document_.FirstChildElement("robot");
    if (robot == nullptr) throw datasets::ImportError(file_, "line 1", "no <robot> element");
    name = attribute(*robot, "name");
    for (auto* e = robot->FirstChildElement("link"); e; e = e->NextSiblingElement("link"))
      if (!links.emplace(attribute(*e, "name"), e).second)
        fail(*e, fmt::format("there is another link '{}'", attribute(*e, "name")));
    for (auto* e = robot->FirstChildElement("joint"); e; e = e->NextSiblingElement("joint")) {
      const std::string child = attribute(child_of(*e, "child"), "link");
      if (!links.contains(child)) fail(*e, fmt::format("there is no link '{}'", child));
      if (!joint_above.emplace(child, e).second) fail(*e, fmt::format("link '{}' has two parents", child));
    }
  }

  [[noreturn]] void fail(const XMLElement& at, const std::string& why) const {
    throw datasets::ImportError(file_, fmt::format("line {}", at.GetLineNum()), why);
  }
  [[noreturn]] void fail(const std::string& why) const { throw datasets::ImportError(file_, "robot", why); }

  const XMLElement& child_of(const XMLElement& of, const char* element) const {
    const XMLElement* found = of.FirstChildElement(element);
    if (found == nullptr) fail(of, fmt::format("no <{}> in it", element));
    return *found;
  }
  std::string attribute(const XMLElement& of, const char* attribute_name) const {
    const char* found = of.Attribute(attribute_name);
    if (found == nullptr || *found == 0) fail(of, fmt::format("no {}=\"...\"", attribute_name));
    return found;
  }
  double number(const XMLElement& of, const char* attribute_name) const {
    const std::string text = attribute(of, attribute_name);
    std::istringstream in(text);
    double value = 0;
    std::string rest;
    if (!(in >> value) || (in >> rest) || !std::isfinite(value))
      fail(of, fmt::format("{}=\"{}\" is not a number", attribute_name, text));
    return value;
  }
  /// The attribute if it is there.
  double number_or(const XMLElement* of, const char* attribute_name, double otherwise) const {
    return of != nullptr && of->Attribute(attribute_name) != nullptr ? number(*of, attribute_name)
                                                                     : otherwise;
  }
  Eigen::Vector3d triple(const XMLElement* of, const char* attribute_name,
                         const Eigen::Vector3d& otherwise) const {
    const char* text = of != nullptr ? of->Attribute(attribute_name) : nullptr;
    if (text == nullptr) return otherwise;
    std::istringstream in(text);
    Eigen::Vector3d out;
    std::string rest;
    if (!(in >> out[0] >> out[1] >> out[2]) || (in >> rest) || !out.allFinite())
      fail(*of, fmt::format("{}=\"{}\" is not three numbers", attribute_name, text));
    return out;
  }
  /// xyz [m] and fixed-axis roll, pitch, yaw [rad].
  Transform<double> origin_of(const XMLElement& of) const {
    const XMLElement* origin = of.FirstChildElement("origin");
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), rpy = triple(origin, "rpy", zero);
    using Eigen::AngleAxisd, Eigen::Vector3d;
    return {(AngleAxisd(rpy[2], Vector3d::UnitZ()) * AngleAxisd(rpy[1], Vector3d::UnitY()) *
             AngleAxisd(rpy[0], Vector3d::UnitX()))
                .toRotationMatrix(),
            triple(origin, "xyz", zero)};
  }
  Inertia inertia_of(const std::string& link) const {
    const XMLElement* inertial = links.at(link)->FirstChildElement("inertial");
    if (inertial == nullptr) return {};
    const XMLElement &i = child_of(*inertial, "inertia"), &heavy = child_of(*inertial, "mass");
    const double mass = number(heavy, "value");
    if (mass < 0) fail(heavy, fmt::format("a mass of {} kg, accepted are 0 and more", mass));
    const Inertia own{mass, Eigen::Vector3d::Zero(),
                      symmetric(number(i, "ixx"), number(i, "iyy"), number(i, "izz"), number(i, "ixy"),
                                number(i, "ixz"), number(i, "iyz"))};
    return seen_from(origin_of(*inertial), own);
  }
  std::string parent_of(const XMLElement& joint) const {
    return attribute(child_of(joint, "parent"), "link");
  }
  /// The link with all that is fixed to it, but for the links of `path`.
  Inertia solid(const std::string& link, const std::set<std::string>& path) const {
    Inertia out = inertia_of(link);
    for (const auto& [child, joint] : joint_above)
      if (parent_of(*joint) == link && attribute(*joint, "type") == "fixed" && !path.contains(child))
        out = together(out, seen_from(origin_of(*joint), solid(child, path)));
    return out;
  }
  /// The mass of the link and of all links after it [kg].
  double mass_from(const std::string& link) const {
    double out = inertia_of(link).mass;
    for (const auto& [child, joint] : joint_above)
      if (parent_of(*joint) == link) out += mass_from(child);
    return out;
  }
  /// What moves on the link's solid beside `path`, where it has a mass.
  void note_beside(const std::string& link, const std::set<std::string>& path,
                   std::vector<std::string>& notes) const {
    for (const auto& [child, joint] : joint_above) {
      if (parent_of(*joint) != link || path.contains(child)) continue;
      if (attribute(*joint, "type") == "fixed")
        note_beside(child, path, notes);
      else if (const double mass = mass_from(child); mass > 0)
        notes.push_back(
            fmt::format("joint '{}' is beside the chain: what it moves, {:.3g} kg, does not count",
                        attribute(*joint, "name"), mass));
    }
  }

  std::string name;
  std::map<std::string, const XMLElement*> links, joint_above;

 private:
  std::string file_;
  tinyxml2::XMLDocument document_;
};

std::string only_leaf(const Urdf& urdf) {
  std::set<std::string> parents;
  for (const auto& [child, joint] : urdf.joint_above) parents.insert(urdf.parent_of(*joint));
  std::string found;
  for (const auto& [link, element] : urdf.links)
    if (!parents.contains(link)) {
      if (!found.empty()) urdf.fail(fmt::format("the tip is '{}' or '{}' or another: name it", found, link));
      found = link;
    }
  return found;
}

/// The joints from the root to the tip.
std::vector<const XMLElement*> path_to(const Urdf& urdf, const std::string& tip) {
  std::vector<const XMLElement*> out;
  for (auto above = urdf.joint_above.find(tip); above != urdf.joint_above.end();) {
    out.push_back(above->second);
    if (out.size() > urdf.links.size()) urdf.fail("its joints go round in a circle");
    above = urdf.joint_above.find(urdf.parent_of(*above->second));
  }
  return {out.rbegin(), out.rend()};
}

/// The rotation that takes z to the axis.
Eigen::Matrix3d onto(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d turn = Eigen::Vector3d::UnitZ().cross(axis);
  const Eigen::Vector3d about =
      turn.norm() > 0 ? Eigen::Vector3d(turn.normalized()) : Eigen::Vector3d::UnitX();
  return Eigen::AngleAxisd(std::atan2(turn.norm(), axis.z()), about).toRotationMatrix();
}

}  // namespace

Chain read_urdf_chain(const std::filesystem::path& file, const std::string& tip) {
  const Urdf urdf(file.string());
  if (!tip.empty() && !urdf.links.contains(tip)) urdf.fail(fmt::format("there is no link '{}'", tip));
  Chain out{urdf.name, {}, {}};
  Transform<double>
      here;  // the URDF's frame of the link at hand, in the frame of the last joint (or the base)
  const auto path = path_to(urdf, tip.empty() ? only_leaf(urdf) : tip);
  std::set<std::string> on_path;
  for (const XMLElement* element : path)
    on_path.insert(urdf.attribute(urdf.child_of(*element, "child"), "link"));
  for (const XMLElement* element : path) {
    const std::string type = urdf.attribute(*element, "type"),
                      link = urdf.attribute(urdf.child_of(*element, "child"), "link");
    here = here * urdf.origin_of(*element);
    if (type == "revolute" || type == "continuous") {
      if (const auto* mimic = element->FirstChildElement("mimic"))
        urdf.fail(*mimic, fmt::format("joint '{}' mimics '{}', and does not move by itself: coupled joints "
                                      "are not known",
                                      urdf.attribute(*element, "name"), urdf.attribute(*mimic, "joint")));
      Eigen::Vector3d axis = urdf.triple(element->FirstChildElement("axis"), "xyz", Eigen::Vector3d::UnitX());
      if (!(axis.norm() > 1e-9)) urdf.fail(*element, "its axis has no direction");
      const Transform<double> turned{onto(axis.normalized()), Eigen::Vector3d::Zero()};
      const XMLElement* limit = element->FirstChildElement("limit");
      JointLimits limits;
      if (type == "revolute") {
        limits.lower = urdf.number_or(limit, "lower", 0);
        limits.upper = urdf.number_or(limit, "upper", 0);
      }
      limits.velocity = urdf.number_or(limit, "velocity", limits.velocity);
      limits.torque = urdf.number_or(limit, "effort", limits.torque);
      out.joints.push_back({urdf.attribute(*element, "name"), here * turned, {}, limits, {}});
      here = inverse(turned);
    } else if (type != "fixed") {
      urdf.fail(*element, fmt::format("type '{}' is not revolute, continuous or fixed", type));
    }
    if (!out.joints.empty()) {  // what hangs on the base does not move
      Inertia& moving = out.joints.back().link;
      moving = together(moving, seen_from(here, urdf.solid(link, on_path)));
      urdf.note_beside(link, on_path, out.notes);
    }
  }
  out.tip = here;
  try {
    validate(out);
  } catch (const std::invalid_argument& error) {
    urdf.fail(error.what());
  }
  return out;
}

}  // namespace unhand::planners
