// SPDX-License-Identifier: Apache-2.0
// URDF files in a folder of their own, and the arm of the examples.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/inspection/robot_mount.h"

namespace sightline {

// The UR10e of examples/cylinder_head_robot.
inline std::string ExampleArm() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  return std::string(source == nullptr ? "." : source) +
         "/examples/cylinder_head_robot/ur10e_cell.urdf";
}

inline RobotMount ArmMount() {
  RobotMount mount;
  mount.urdf_file = ExampleArm();
  mount.base_link = "base_link";
  mount.tip_link = "flange";
  return mount;
}

class RobotFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_NE(mkdtemp(folder_.data()), nullptr); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) const {
    const std::string path = folder_ + "/" + name;
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }

  std::string folder_ = "/tmp/sightline-robot-XXXXXX";
};

// Two links of 0.5 m and 0.4 m that turn in the horizontal plane, the second one within `limits`.
inline std::string PlanarArm(const std::string& limits = R"(lower="-2" upper="2")",
                             const std::string& more = "") {
  return R"(<robot name="planar"><link name="base"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
 <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="upper"><collision><origin xyz="0.25 0 0"/>
 <geometry><box size="0.5 0.02 0.02"/></geometry></collision></link>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
 <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit )" +
         limits + R"( effort="1" velocity="2"/></joint>
<link name="fore"><collision><origin xyz="0.2 0 0"/>
 <geometry><box size="0.4 0.02 0.02"/></geometry></collision></link>
<joint name="end" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0.4 0 0"/></joint>
<link name="tip"/>)" +
         more + "</robot>";
}

}  // namespace sightline
