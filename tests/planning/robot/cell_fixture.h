// SPDX-License-Identifier: Apache-2.0
// A box on a stage under the arm of the examples, and a box on a turntable that rides on a stage.
#pragma once

#include <memory>
#include <numbers>
#include <utility>

#include "core/targets/target_set.h"
#include "planning/robot/robot_cell.h"
#include "tests/core/part/test_meshes.h"
#include "tests/planning/robot/robot_files.h"

namespace sightline {

constexpr double kPi = std::numbers::pi;

class CellTest : public RobotFilesTest {
 protected:
  // 200 x 100 x 60 mm; its centre is (0.1, 0.05, 0.03).
  static CellTask HeadTask() {
    CellTask task;
    task.mount = ArmMount();
    task.mount.base_link = "cell";
    task.mount.base.translation() = Eigen::Vector3d(0, -0.7, 0);
    task.mount.load_on_tip.translation() = Eigen::Vector3d(0, 0.0875, 0.15);
    task.mount.home = {-kPi / 2, -kPi / 2, kPi / 2, -kPi / 2, -kPi / 2, 0};
    task.head = HeadScan();
    task.part = std::make_shared<const TriangleMesh>(BoxMesh({0, 0, 0}, {0.2f, 0.1f, 0.06f}));
    task.part_centre_m = Eigen::Vector3d(0.1, 0.05, 0.03);
    return task;
  }
  static Measurement HeadScan() {
    Measurement scan;
    scan.camera_distance_m = 0.35;
    scan.triangulation_angle_rad = kPi / 6;
    scan.camera_polar_rad = 0.2;
    return scan;
  }

  static constexpr char kTurntable[] = R"(<robot name="turntable"><link name="bed"/>
<joint name="stage" type="prismatic"><parent link="bed"/><child link="carriage"/><axis xyz="1 0 0"/>
 <limit lower="-0.3" upper="0.3" effort="1" velocity="0.2"/></joint>
<link name="carriage"><collision><origin xyz="0 0 -0.06"/>
 <geometry><box size="0.2 0.2 0.02"/></geometry></collision></link>
<joint name="turn" type="continuous"><parent link="carriage"/><child link="plate"/><axis xyz="0 0 1"/>
 <limit effort="1" velocity="1"/></joint>
<link name="plate"><collision><origin xyz="0 0 -0.035"/>
 <geometry><cylinder radius="0.1" length="0.01"/></geometry></collision></link></robot>)";
  CellTask TurntableTask() const {
    CellTask task = HeadTask();
    task.mount = RobotMount();
    task.mount.load = RobotMount::Load::kPart;
    task.mount.urdf_file = Write("turntable.urdf", kTurntable);
    task.mount.tip_link = "plate";
    // The part's centre on the axis, its lowest face 0.03 m below.
    task.mount.load_on_tip.translation() = -task.part_centre_m;
    return task;
  }

  static std::unique_ptr<RobotCell> Make(CellTask task) {
    auto cell = RobotCell::Make(std::move(task));
    EXPECT_TRUE(cell.ok()) << cell.status();
    return cell.ok() ? *std::move(cell) : nullptr;
  }
};

}  // namespace sightline
