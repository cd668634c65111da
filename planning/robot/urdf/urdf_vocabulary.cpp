// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/urdf/urdf_vocabulary.h"

#include <tinyxml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/spelling/nearest_name.h"
#include "core/spelling/one_of.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"

namespace sightline {
namespace {

using Count = UrdfElement::Count;

constexpr auto kText = UrdfValue::kText;
constexpr auto kNumber = UrdfValue::kNumber;
constexpr auto kVector = UrdfValue::kVector;
// Same as for joint limits: twice the largest meaningful turn.
constexpr double kMostAngleRad = 4 * std::numbers::pi;
constexpr bool kRequired = true;

// Elements of other programs, as published robots have them.
struct Extension {
  std::string_view name;
  // It describes solids or joints of the robot, so that skipping it deserves a remark.
  bool of_the_robot = false;
};
constexpr Extension kExtensions[] = {
    // Gazebo and SDFormat
    {"gazebo"},
    {"gravity"},
    {"kinematic"},
    {"self_collide"},
    {"velocity_decay"},
    {"enable_wind"},
    {"surface"},
    {"max_contacts"},
    {"physics"},
    {"plugin"},
    {"cast_shadows"},
    // ROS: control, sensors and older drafts of the specification
    {"transmission"},
    {"ros2_control"},
    {"hardwareInterface"},
    {"sensor"},
    {"joint_properties"},
    {"anchor"},
    {"controller_gains"},
    {"traits"},
    {"schedule_topic_creator_file"},
    {"self_filter"},
    // Simulators and dynamics libraries
    {"mujoco"},
    {"webots"},
    {"contact"},
    {"contact_coefficients"},
    {"frame"},
    {"force_element"},
    {"cable"},
    {"parameter"},
    {"collision_filter_group"},
    {"self_collision_checking", true},
    {"collision_checking", true},
    {"loop_joint", true},
};
constexpr std::string_view kExtensionPrefixes[] = {"drake",  "gazebo",    "sensor",   "controller",
                                                   "mujoco", "tesseract", "interface"};

std::vector<UrdfElement> MakeElements() {
  return {
      {"robot", {}, Count::kOne, {{"name", kText, kRequired}, {"version"}}},
      {"link", {"robot"}, Count::kAny, {{"name", kText, kRequired}, {"type"}}},
      {"joint",
       {"robot"},
       Count::kAny,
       {{"name", kText, kRequired}, {"type", UrdfValue::kJointType, kRequired}, {"dont_collapse"}}},
      {"material", {"robot", "visual", "collision"}, Count::kAny, {{"name"}}},
      {"color", {"material"}, Count::kAtMostOne, {{"rgba", kText, kRequired}}},
      {"texture", {"material"}, Count::kAtMostOne, {{"filename"}}},
      // Links
      {"inertial", {"link"}, Count::kAtMostOne, {}},
      {"mass", {"inertial"}, Count::kOne, {{"value", kNumber, kRequired}}},
      {"inertia",
       {"inertial"},
       Count::kOne,
       {{"ixx", kNumber, kRequired},
        {"ixy", kNumber, kRequired},
        {"ixz", kNumber, kRequired},
        {"iyy", kNumber, kRequired},
        {"iyz", kNumber, kRequired},
        {"izz", kNumber, kRequired},
        {"iyx", kNumber},
        {"izx", kNumber},
        {"izy", kNumber}}},
      {"visual", {"link"}, Count::kAny, {{"name"}, {"group"}}},
      {"collision", {"link"}, Count::kAny, {{"name"}, {"group"}}},
      {"verbose", {"collision"}, Count::kAtMostOne, {{"value"}}},
      {"geometry", {"visual", "collision"}, Count::kOne, {{"name"}}},
      {"box", {"geometry"}, Count::kAtMostOne, {{"size", kVector, kRequired}}},
      {"cylinder",
       {"geometry"},
       Count::kAtMostOne,
       {{"radius", kNumber, kRequired}, {"length", kNumber, kRequired}}},
      {"sphere", {"geometry"}, Count::kAtMostOne, {{"radius", kNumber, kRequired}}},
      {"mesh",
       {"geometry"},
       Count::kAtMostOne,
       {{"filename", kText, kRequired}, {"scale", kVector}}},
      {"origin",
       {"inertial", "visual", "collision", "joint"},
       Count::kAtMostOne,
       {{"xyz", kVector}, {"rpy", UrdfValue::kAngles}}},
      // Some exporters write a pose where the specification has none.
      {"origin",
       {"link"},
       Count::kAtMostOne,
       {{"xyz", UrdfValue::kZeros}, {"rpy", UrdfValue::kZeros}}},
      // Joints
      {"parent", {"joint"}, Count::kOne, {{"link", kText, kRequired}}},
      {"child", {"joint"}, Count::kOne, {{"link", kText, kRequired}}},
      {"axis",
       {"joint"},
       Count::kAtMostOne,
       {{"xyz", kVector, kRequired}, {"rpy", UrdfValue::kZeros}}},
      {"calibration",
       {"joint"},
       Count::kAtMostOne,
       {{"rising", kNumber}, {"falling", kNumber}, {"reference_position", kNumber}}},
      {"dynamics",
       {"joint"},
       Count::kAtMostOne,
       {{"damping", kNumber},
        {"friction", kNumber},
        {"D"},
        {"K"},
        {"mu_coulomb"},
        {"mu_viscous"},
        {"spring_reference"},
        {"spring_stiffness"}}},
      {"limit",
       {"joint"},
       Count::kAtMostOne,
       {{"lower", kNumber},
        {"upper", kNumber},
        {"effort", kNumber, kRequired},
        {"velocity", kNumber, kRequired},
        {"acceleration"},
        {"deceleration"},
        {"jerk"},
        {"command_effort"},
        {"current"},
        {"gear_velocity"},
        {"k_velocity"}}},
      {"safety_controller",
       {"joint"},
       Count::kAtMostOne,
       {{"soft_lower_limit", kNumber},
        {"soft_upper_limit", kNumber},
        {"k_position", kNumber},
        {"k_velocity", kNumber, kRequired}}},
      {"mimic",
       {"joint"},
       Count::kAtMostOne,
       {{"joint", kText, kRequired}, {"multiplier", kNumber}, {"offset", kNumber}}},
  };
}

constexpr std::string_view kJointTypes[] = {"revolute", "continuous", "prismatic",
                                            "fixed",    "floating",   "planar"};

std::string InAngles(const std::string& name) { return absl::StrCat("<", name, ">"); }

bool StandsIn(const UrdfElement& element, const std::string& parent) {
  return std::ranges::find(element.parents, parent) != element.parents.end();
}

const UrdfElement* ElementIn(const std::string& parent, const std::string& name) {
  const auto found = std::ranges::find_if(UrdfElements(), [&](const UrdfElement& element) {
    return element.name == name && StandsIn(element, parent);
  });
  return found == UrdfElements().end() ? nullptr : &*found;
}

// Elements that may contain `name`, in angle brackets; empty if there is no such element.
std::vector<std::string> PlacesOf(const std::string& name) {
  std::vector<std::string> places;
  for (const UrdfElement& element : UrdfElements()) {
    if (element.name != name) continue;
    for (const std::string& parent : element.parents) places.push_back(InAngles(parent));
    if (element.parents.empty()) places.emplace_back("no other");
  }
  return places;
}

std::vector<std::string> ChildrenOf(const std::string& parent) {
  std::vector<std::string> names;
  for (const UrdfElement& element : UrdfElements()) {
    if (StandsIn(element, parent)) names.emplace_back(element.name);
  }
  return names;
}

class Checker {
 public:
  explicit Checker(std::vector<std::string>* remarks) : remarks_(*remarks) {}

  // `where`: the joint or link that `node` is part of, with a colon, or empty.
  absl::Status Check(const TiXmlElement& node, const UrdfElement& element, std::string where) {
    if (element.name == "joint" || element.name == "link") {
      const char* name = node.Attribute("name");
      where = absl::StrCat(element.name, " ", name == nullptr ? "without a name" : name, ": ");
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckAttributes(node, element, where));
    return CheckChildren(node, element, where);
  }

  absl::Status Bad(const TiXmlNode& node, const std::string& where,
                   const std::string& reason) const {
    return absl::InvalidArgumentError(absl::StrCat("line ", node.Row(), ": ", where, reason));
  }

 private:
  absl::Status CheckAttributes(const TiXmlElement& node, const UrdfElement& element,
                               const std::string& where) const {
    const auto bad = [&](const std::string& reason) {
      return Bad(node, where, absl::StrCat(InAngles(element.name), ": ", reason));
    };
    std::set<std::string> present;
    for (const TiXmlAttribute* a = node.FirstAttribute(); a != nullptr; a = a->Next()) {
      present.insert(a->Name());
    }
    for (const TiXmlAttribute* a = node.FirstAttribute(); a != nullptr; a = a->Next()) {
      const std::string name = a->Name();
      // Name spaces, and attributes of other programs in theirs.
      if (name == "xmlns" || name.find(':') != name.npos) continue;
      const auto known = std::ranges::find(element.attributes, name, &UrdfAttribute::name);
      if (known == element.attributes.end()) {
        return bad(absl::StrCat("has the unknown attribute ", QuotedExcerpt(name),
                                Suggestion(name, element, present)));
      }
      if (const std::string reason = RefuseValue(*known, a->ValueStr()); !reason.empty()) {
        return bad(absl::StrCat(name, " ", reason));
      }
    }
    for (const UrdfAttribute& attribute : element.attributes) {
      if (attribute.required && !present.contains(attribute.name)) {
        return bad(absl::StrCat("has no attribute ", attribute.name, ", which is required"));
      }
    }
    return absl::OkStatus();
  }

  // Suggests the most similar attribute, preferably one that the element lacks.
  static std::string Suggestion(const std::string& name, const UrdfElement& element,
                                const std::set<std::string>& present) {
    std::vector<std::string> all, absent;
    for (const UrdfAttribute& attribute : element.attributes) {
      all.emplace_back(attribute.name);
      if (!present.contains(attribute.name)) absent.emplace_back(attribute.name);
    }
    std::string likely = LikelyName(name, absent);
    if (likely.empty()) likely = LikelyName(name, all);
    if (!likely.empty()) return absl::StrCat("; did you mean ", likely, "?");
    return all.empty() ? "; it has none" : absl::StrCat("; it may have ", OneOf(all));
  }

  // Returns why a value cannot be read, to follow the attribute's name; empty if it can.
  static std::string RefuseValue(const UrdfAttribute& attribute, const std::string& text) {
    switch (attribute.value) {
      case UrdfValue::kText:
        return "";
      case UrdfValue::kNumber: {
        const auto number = ParseReal(std::string(absl::StripAsciiWhitespace(text)));
        return number.ok() ? "" : std::string(number.status().message());
      }
      case UrdfValue::kVector:
      case UrdfValue::kAngles:
      case UrdfValue::kZeros: {
        const std::vector<std::string> words =
            absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
        if (words.size() != 3) {
          return absl::StrCat("must be three numbers, is ", QuotedExcerpt(text));
        }
        for (const std::string& word : words) {
          const auto number = ParseReal(word);
          if (!number.ok()) return absl::StrCat("of three numbers ", number.status().message());
          if (attribute.value == UrdfValue::kAngles && std::abs(*number) > kMostAngleRad) {
            return absl::StrCat("must be in [-4 pi, 4 pi] rad, is ", QuotedExcerpt(text),
                                ": it looks like degrees; a URDF has radians");
          }
          if (attribute.value == UrdfValue::kZeros && *number != 0) {
            return absl::StrCat(
                "is not part of a URDF here and would be ignored; must be 0 0 0, is ",
                QuotedExcerpt(text));
          }
        }
        return "";
      }
      case UrdfValue::kJointType: {
        if (std::ranges::find(kJointTypes, text) != std::end(kJointTypes)) return "";
        const std::vector<std::string> types(std::begin(kJointTypes), std::end(kJointTypes));
        const std::string likely = LikelyName(text, types);
        return absl::StrCat("is ", QuotedExcerpt(text), ", must be ", OneOf(types),
                            likely.empty() ? "" : absl::StrCat("; did you mean ", likely, "?"));
      }
    }
    return "";
  }

  absl::Status CheckChildren(const TiXmlElement& node, const UrdfElement& element,
                             const std::string& where) {
    std::map<std::string, int> count;
    for (const TiXmlNode* child = node.FirstChild(); child != nullptr;
         child = child->NextSibling()) {
      if (const TiXmlText* text = child->ToText(); text != nullptr) {
        return Bad(
            node, where,
            absl::StrCat(InAngles(element.name), ": has the text ", QuotedExcerpt(text->ValueStr()),
                         ", but may contain only elements"));
      }
      const TiXmlElement* inner = child->ToElement();
      if (inner == nullptr) continue;  // a comment
      const std::string& name = inner->ValueStr();
      const UrdfElement* known = ElementIn(element.name, name);
      if (known == nullptr && IsUrdfExtension(name)) {
        RemarkOn(name);
        continue;
      }
      if (known == nullptr) return Bad(*inner, where, Unknown(name, element.name));
      if (++count[known->name] > 1 && known->count != Count::kAny) {
        return Bad(*inner, where,
                   absl::StrCat(InAngles(element.name), ": has a second ", InAngles(name),
                                ", must have one"));
      }
      SIGHTLINE_RETURN_IF_ERROR(Check(*inner, *known, where));
    }
    for (const UrdfElement& required : UrdfElements()) {
      if (required.count != Count::kOne || !StandsIn(required, element.name)) continue;
      if (!count.contains(required.name)) {
        return Bad(node, where,
                   absl::StrCat(InAngles(element.name), ": has no ", InAngles(required.name),
                                ", which is required"));
      }
    }
    if (element.name == "geometry" && count.size() != 1) {
      return Bad(node, where,
                 absl::StrCat("<geometry>: has ", count.empty() ? "no solid" : "several solids",
                              ", must have one: ", OneOf(ChildrenOf("geometry"))));
    }
    return absl::OkStatus();
  }

  // Returns why an element is not allowed in `parent`, with the nearest allowed name.
  static std::string Unknown(const std::string& name, const std::string& parent) {
    if (name.starts_with("xacro:")) {
      return absl::StrCat(
          InAngles(parent), ": has the element ", QuotedExcerpt(name),
          ": the file is xacro; expand it to a URDF first (xacro FILE > ROBOT.urdf)");
    }
    const std::vector<std::string> places = PlacesOf(name);
    if (!places.empty()) {
      return absl::StrCat(InAngles(parent), ": has the element ", InAngles(name),
                          ", which can stand in ", OneOf(places), " only");
    }
    const std::vector<std::string> here = ChildrenOf(parent);
    std::string text =
        absl::StrCat(InAngles(parent), ": has the unknown element ", QuotedExcerpt(name));
    std::string likely = LikelyName(name, here);
    if (!likely.empty()) return absl::StrCat(text, "; did you mean ", InAngles(likely), "?");
    // A misspelt element in the wrong place.
    std::vector<std::string> all;
    for (const UrdfElement& element : UrdfElements()) all.emplace_back(element.name);
    likely = LikelyName(name, all);
    if (!likely.empty()) {
      return absl::StrCat(text, "; the nearest known name is ", likely,
                          ", which is not allowed in ", InAngles(parent));
    }
    return here.empty() ? absl::StrCat(text, "; it has none")
                        : absl::StrCat(text, "; it may have ", OneOf(here));
  }

  void RemarkOn(const std::string& name) {
    const auto* const known = std::ranges::find(kExtensions, name, &Extension::name);
    if (known == std::end(kExtensions) || !known->of_the_robot) return;
    if (!remarked_.insert(name).second) return;
    remarks_.push_back(
        absl::StrCat("<", name, "> is an extension of other programs and is left out"));
  }

  std::vector<std::string>& remarks_;
  std::set<std::string> remarked_;
};

}  // namespace

const std::vector<UrdfElement>& UrdfElements() {
  static const auto& elements = *new std::vector<UrdfElement>(MakeElements());
  return elements;
}

bool IsUrdfExtension(const std::string& name) {
  if (std::ranges::find(kExtensions, name, &Extension::name) != std::end(kExtensions)) return true;
  const size_t colon = name.find(':');
  return colon != name.npos &&
         std::ranges::find(kExtensionPrefixes, std::string_view(name).substr(0, colon)) !=
             std::end(kExtensionPrefixes);
}

absl::Status CheckUrdfVocabulary(const TiXmlElement& robot, std::vector<std::string>* remarks) {
  Checker checker(remarks);
  const UrdfElement& root = UrdfElements().front();
  if (robot.ValueStr() != root.name) {
    return checker.Bad(robot, "",
                       absl::StrCat("the root element is ", QuotedExcerpt(robot.ValueStr()),
                                    ", must be ", InAngles(root.name)));
  }
  return checker.Check(robot, root, "");
}

}  // namespace sightline
