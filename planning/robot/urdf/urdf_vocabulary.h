// SPDX-License-Identifier: Apache-2.0
// The elements and attributes of the URDF specification, and a check that a file has no others.
//
// urdfdom skips unknown words, so a misspelt <colision> would leave an arm without solids. The
// specification is http://wiki.ros.org/urdf/XML with urdf.xsd of urdfdom. Attributes that published
// robots add to it are accepted too. Listed elements of other programs (<gazebo>, <transmission>,
// <ros2_control>, <mujoco>, <drake:...>) are skipped with their content.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

class TiXmlElement;

namespace sightline {

enum class UrdfValue {
  kText,
  kNumber,     // finite, decimal digits
  kVector,     // three numbers
  kAngles,     // three angles within [-4 pi, 4 pi] rad; beyond that they are degrees
  kZeros,      // three zeros; the value is ignored, so that any other would be lost
  kJointType,  // revolute, continuous, prismatic, fixed, floating or planar
};

struct UrdfAttribute {
  std::string name;
  UrdfValue value = UrdfValue::kText;
  bool required = false;
};

struct UrdfElement {
  enum class Count { kAny, kAtMostOne, kOne };

  std::string name;
  std::vector<std::string> parents;  // elements that may hold it so; none: the root
  Count count = Count::kAny;         // in each of its parents
  std::vector<UrdfAttribute> attributes;
};

// All elements that are read from a URDF, the root first. A name has several entries if its
// attributes depend on its parent.
const std::vector<UrdfElement>& UrdfElements();

// True if an element belongs to another program; it is skipped at any level.
bool IsUrdfExtension(const std::string& name);

// Checks the root element and everything below it. INVALID_ARGUMENT names the line, the joint or
// link, the element, and the nearest known name. It reports unknown or misplaced elements and
// attributes, elements that are missing or too many, missing attributes, values that are no
// numbers, text between elements, and unexpanded xacro. `remarks` gets one sentence for each kind
// of skipped extension that describes solids or joints.
absl::Status CheckUrdfVocabulary(const TiXmlElement& robot, std::vector<std::string>* remarks);

}  // namespace sightline
