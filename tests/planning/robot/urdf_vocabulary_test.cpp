// SPDX-License-Identifier: Apache-2.0
// Properties of the vocabulary: they hold for every element and attribute that is in its table.
#include "planning/robot/urdf/urdf_vocabulary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "planning/robot/urdf/urdf_file.h"
#include "tests/planning/robot/robot_files.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string ValueOf(const UrdfAttribute& attribute) {
  switch (attribute.value) {
    case UrdfValue::kText:
      return "a";
    case UrdfValue::kNumber:
      return "1";
    case UrdfValue::kVector:
    case UrdfValue::kAngles:
      return "1 1 1";
    case UrdfValue::kZeros:
      return "0 0 0";
    case UrdfValue::kJointType:
      return "fixed";
  }
  return "";
}

bool StandsInside(const UrdfElement& element, const std::string& parent) {
  return std::ranges::find(element.parents, parent) != element.parents.end();
}

// An element with all attributes, and the elements that it must have. `written`: the name that is
// written for it, or for its attribute `attribute`.
std::string Written(const UrdfElement& element, const std::string& inner,
                    const std::string& inner_name, const std::string& written = "",
                    const std::string& attribute = "") {
  const bool misspelt_element = !written.empty() && attribute.empty();
  const std::string name = misspelt_element ? written : element.name;
  std::string text = absl::StrCat("<", name);
  for (const UrdfAttribute& a : element.attributes) {
    absl::StrAppend(&text, " ", a.name == attribute ? written : a.name, "=\"", ValueOf(a), "\"");
  }
  absl::StrAppend(&text, ">\n", inner);
  for (const UrdfElement& child : UrdfElements()) {
    const bool needed = child.count == UrdfElement::Count::kOne && child.name != inner_name;
    if (needed && StandsInside(child, element.name)) absl::StrAppend(&text, Written(child, "", ""));
  }
  if (element.name == "geometry" && inner.empty()) absl::StrAppend(&text, "<box size=\"1 1 1\"/>");
  return absl::StrCat(text, "</", name, ">\n");
}

// `inner`, the text of `element` in `parent`, with all that stands around it.
std::string Around(const std::string& inner, const std::string& name, const std::string& parent) {
  for (const UrdfElement& element : UrdfElements()) {
    if (element.name != parent) continue;
    const std::string text = Written(element, inner, name);
    return element.parents.empty() ? text : Around(text, parent, element.parents.front());
  }
  return "";
}

// Words that differ from `word` in one letter left out, doubled, replaced, or swapped with the
// next.
std::set<std::string> Misspellings(const std::string& word) {
  std::set<std::string> words;
  for (size_t i = 0; i < word.size(); ++i) {
    words.insert(word.substr(0, i) + word.substr(i + 1));
    words.insert(word.substr(0, i) + word[i] + word.substr(i));
    words.insert(word.substr(0, i) + "q" + word.substr(i + 1));
    if (i + 1 < word.size()) {
      std::string swapped = word;
      std::swap(swapped[i], swapped[i + 1]);
      words.insert(swapped);
    }
  }
  words.erase(word);
  words.erase("");
  return words;
}

class UrdfVocabularyTest : public RobotFilesTest {
 protected:
  absl::StatusOr<UrdfFile> Read(const std::string& urdf) const {
    return ReadUrdfFile(Write("arm.urdf", urdf));
  }
  void ExpectRefused(const std::string& urdf, const std::string& why) const {
    const auto read = Read(urdf);
    EXPECT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument) << urdf;
    EXPECT_THAT(std::string(read.status().message()), HasSubstr(why)) << urdf;
  }
  // Whether the vocabulary lets it pass; what urdfdom says of the structure is another thing.
  bool IsKnown(const std::string& urdf) const {
    const auto read = Read(urdf);
    return !absl::StrContains(read.status().message(), "line ");
  }
};

TEST_F(UrdfVocabularyTest, KnowsEveryElementWithAllItsAttributesInEveryPlace) {
  int places = 0;
  for (const UrdfElement& element : UrdfElements()) {
    for (const std::string& parent : element.parents) {
      const std::string urdf = Around(Written(element, "", ""), element.name, parent);
      EXPECT_TRUE(IsKnown(urdf)) << Read(urdf).status() << "\n" << urdf;
      ++places;
    }
  }
  EXPECT_GE(places, 30);
}

TEST_F(UrdfVocabularyTest, ProposesTheRightNameForEveryMisspeltElement) {
  int tried = 0;
  for (const UrdfElement& element : UrdfElements()) {
    for (const std::string& parent : element.parents) {
      for (const std::string& wrong : Misspellings(element.name)) {
        if (IsUrdfExtension(wrong)) continue;
        const bool stands_elsewhere = std::ranges::any_of(
            UrdfElements(), [&](const UrdfElement& other) { return other.name == wrong; });
        ExpectRefused(
            Around(Written(element, "", "", wrong), element.name, parent),
            stands_elsewhere
                ? absl::StrCat("<", parent, ">: has the element <", wrong, ">, which can stand in")
                : absl::StrCat("<", parent, ">: has the unknown element \"", wrong,
                               "\"; did you mean <", element.name, ">?"));
        ++tried;
      }
    }
  }
  EXPECT_GT(tried, 300);
}

TEST_F(UrdfVocabularyTest, ProposesTheRightNameForEveryMisspeltAttribute) {
  int tried = 0;
  for (const UrdfElement& element : UrdfElements()) {
    for (const UrdfAttribute& attribute : element.attributes) {
      std::set<std::string> names;
      for (const UrdfAttribute& other : element.attributes) names.insert(other.name);
      for (const std::string& wrong : Misspellings(attribute.name)) {
        if (names.contains(wrong)) continue;
        const std::string text = Written(element, "", "", wrong, attribute.name);
        ExpectRefused(
            element.parents.empty() ? text : Around(text, element.name, element.parents.front()),
            absl::StrCat("<", element.name, ">: has the unknown attribute \"", wrong,
                         "\"; did you mean ", attribute.name, "?"));
        ++tried;
      }
    }
  }
  EXPECT_GT(tried, 500);
}

TEST_F(UrdfVocabularyTest, RefusesMissingAttributesAndElements) {
  for (const UrdfElement& element : UrdfElements()) {
    for (size_t i = 0; i < element.attributes.size(); ++i) {
      if (!element.attributes[i].required) continue;
      UrdfElement less = element;
      less.attributes.erase(less.attributes.begin() + static_cast<std::ptrdiff_t>(i));
      const std::string text = Written(less, "", "");
      ExpectRefused(
          element.parents.empty() ? text : Around(text, element.name, element.parents.front()),
          absl::StrCat("<", element.name, ">: has no attribute ", element.attributes[i].name));
    }
    if (element.count == UrdfElement::Count::kAny) continue;
    for (const std::string& parent : element.parents) {
      const std::string once = Written(element, "", "");
      if (element.count == UrdfElement::Count::kOne) {
        ExpectRefused(Around("", element.name, parent),
                      absl::StrCat("<", parent, ">: has no <", element.name, ">"));
      }
      ExpectRefused(Around(once + once, element.name, parent),
                    absl::StrCat("<", parent, ">: has a second <", element.name, ">"));
    }
  }
}

TEST_F(UrdfVocabularyTest, RefusesValuesThatAreNoNumbers) {
  for (const UrdfElement& element : UrdfElements()) {
    for (const UrdfAttribute& attribute : element.attributes) {
      if (attribute.value == UrdfValue::kText) continue;
      for (const char* wrong : {"", "x", "nan", "inf", "1,5", "0x1", "1 1", "1 1 1 1", "1 1 nan"}) {
        UrdfElement other = element;
        std::erase_if(other.attributes,
                      [&](const UrdfAttribute& a) { return a.name == attribute.name; });
        const std::string text = absl::StrReplaceAll(
            Written(other, "", ""),
            {{absl::StrCat("<", element.name),
              absl::StrCat("<", element.name, " ", attribute.name, "=\"", wrong, "\"")}});
        ExpectRefused(Around(text, element.name, element.parents.front()), attribute.name);
      }
    }
  }
}

// Every element of the table that has angles is tried: of solids, joints and links.
TEST_F(UrdfVocabularyTest, RefusesAnglesInDegrees) {
  int angles = 0;
  for (const UrdfElement& element : UrdfElements()) {
    for (const UrdfAttribute& attribute : element.attributes) {
      if (attribute.value != UrdfValue::kAngles) continue;
      for (const std::string& parent : element.parents) {
        const auto with = [&](const char* value) {
          return Around(absl::StrCat("<", element.name, " ", attribute.name, "=\"", value, "\"/>"),
                        element.name, parent);
        };
        for (const char* degrees : {"0 90 0", "0 0 -180", "45 0 0"}) {
          ExpectRefused(with(degrees), "it looks like degrees");
        }
        for (const char* radians : {"0 1.5708 0", "0 0 -3.1416", "6.2832 0 0"}) {
          EXPECT_TRUE(IsKnown(with(radians))) << radians;
        }
        ++angles;
      }
    }
  }
  EXPECT_GE(angles, 3);
}

TEST_F(UrdfVocabularyTest, NamesLineJointAndPlace) {
  const auto with = [&](const std::string& from, const std::string& to) {
    return absl::StrReplaceAll(PlanarArm(), {{from, to}});
  };
  const auto colision = Read(with("collision>", "colision>"));
  EXPECT_THAT(std::string(colision.status().message()),
              AllOf(HasSubstr("arm.urdf: line 4: link upper: <link>: has the unknown element "
                              "\"colision\"; did you mean <collision>?")));
  ExpectRefused(with("<origin xyz=\"0.5 0 0\"/>", "<origin xyz=\"0.5 0 0\" rpt=\"0 0 1\"/>"),
                "line 7: joint elbow: <origin>: has the unknown attribute \"rpt\"; did you mean "
                "rpy?");
  ExpectRefused(with("lower=\"-2\"", "lower=\"-90deg\""),
                "joint elbow: <limit>: lower must be a finite decimal number, is \"-90deg\"");
  ExpectRefused(with("type=\"revolute\"", "type=\"revolut\""), "did you mean revolute?");
  ExpectRefused(with("<link name=\"base\"/>", "<link name=\"base\"><limit/></link>"),
                "link base: <link>: has the element <limit>, which can stand in <joint> only");
  ExpectRefused(with("<link name=\"base\"/>", "<link name=\"base\"><limt/></link>"),
                "the nearest known name is limit");
  ExpectRefused(with("<link name=\"base\"/>", "<link name=\"base\">box</link>"),
                "link base: <link>: has the text \"box\"");
  ExpectRefused(
      with("<box size=\"0.4 0.02 0.02\"/>", "<box size=\"0.4 0.02 0.02\"/><sphere radius=\"1\"/>"),
      "<geometry>: has several solids");
  ExpectRefused(with("<box size=\"0.4 0.02 0.02\"/>", ""), "<geometry>: has no solid");
  ExpectRefused(with("<box size=\"0.4 0.02 0.02\"/>", "<capsule radius=\"1\" length=\"1\"/>"),
                "unknown element \"capsule\"; it may have box, cylinder, sphere or mesh");
  ExpectRefused(with("<link name=\"base\"/>", "<link name=\"base\"><origin xyz=\"0 0 1\"/></link>"),
                "xyz is not part of a URDF here");
  ExpectRefused(with("<link name=\"base\"/>", "<link name=\"base\"/><xacro:arm/>"),
                "the file is xacro");
  ExpectRefused(with("robot", "model"), "the root element is \"model\", must be <robot>");
}

TEST_F(UrdfVocabularyTest, SkipsExtensionsOfOtherPrograms) {
  for (const char* name : {"gazebo", "transmission", "ros2_control", "mujoco", "sensor",
                           "drake:joint_actuator", "self_collision_checking"}) {
    EXPECT_TRUE(IsUrdfExtension(name)) << name;
    const std::string element =
        absl::StrCat("<", name, " any=\"1\"><colision rpt=\"1\">x</colision></", name, ">");
    for (const char* place : {"<link name=\"tip\"/>", "<axis xyz=\"0 0 1\"/>"}) {
      const auto read =
          Read(absl::StrReplaceAll(PlanarArm(), {{place, absl::StrCat(place, element)}}));
      EXPECT_TRUE(read.ok()) << read.status();
    }
  }
  // An extension that may describe a solid is left out, with one remark.
  const std::string checking = "<self_collision_checking/>";
  const auto read = Read(PlanarArm(R"(lower="-2" upper="2")", checking + checking));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(read->remarks, ElementsAre(HasSubstr("<self_collision_checking>")));
  EXPECT_THAT(Read(PlanarArm())->remarks, ElementsAre());
}

TEST_F(UrdfVocabularyTest, ReadsTheWholeFile) {
  EXPECT_TRUE(Read("\xef\xbb\xbf<?xml version=\"1.0\"?>\n<!-- arm -->" + PlanarArm()).ok());
  EXPECT_TRUE(Read(PlanarArm() + "\n<!-- <robot> -->\n").ok());
  ExpectRefused(PlanarArm() + "rest", "text behind its root element");
  ExpectRefused(PlanarArm() + "<!-- a -->rest", "text behind its root element");
  ExpectRefused(PlanarArm() + "<robot name=\"b\"/>", "second root element");
  ExpectRefused("<robot name=\"a\"/>" + PlanarArm(), "second root element");
  ExpectRefused(PlanarArm() + PlanarArm(), "second root element");
  const std::string whole = PlanarArm();
  for (size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_FALSE(Read(whole.substr(0, size)).ok()) << size;
  }
}

}  // namespace
}  // namespace sightline
