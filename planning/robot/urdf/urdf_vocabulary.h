// SPDX-License-Identifier: Apache-2.0
// The elements and attributes of the URDF specification, and a check that a file has no others.
//
// urdfdom skips unknown words, so that a misspelt <colision> leaves an arm without solids.
// The specification is http://wiki.ros.org/urdf/XML with urdf.xsd of urdfdom; attributes that
// published robots add to it are known too. Elements of other programs (<gazebo>, <transmission>,
// <ros2_control>, <mujoco>, <drake:...>) are skipped by a list, with everything in them.
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
  kZeros,      // three zeros: it is not read, so that anything else would vanish
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

// All elements that a URDF is read for, the root first. A name that has other attributes in other
// places is there more than once.
const std::vector<UrdfElement>& UrdfElements();

// Whether an element belongs to another program: it is skipped wherever it stands.
bool IsUrdfExtension(const std::string& name);

// Checks the root element and all below it. INVALID_ARGUMENT names the line, the joint or link, the
// element, and the nearest known name: unknown elements and attributes, elements in a wrong place,
// too often or missing, missing attributes, values that are no numbers, text between elements,
// xacro that is not expanded. `remarks` gets a sentence for every skipped extension that describes
// solids or joints, at most one of each kind.
absl::Status CheckUrdfVocabulary(const TiXmlElement& robot, std::vector<std::string>* remarks);

}  // namespace sightline
