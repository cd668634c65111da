// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_collision.h"

#include <gtest/gtest.h>

#include "tests/core/part/test_meshes.h"
#include "tests/planning/robot/robot_files.h"

namespace sightline {
namespace {

Eigen::Isometry3d At(double x, double y, double z) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  return pose;
}

class RobotCollisionTest : public RobotFilesTest {
 protected:
  void SetUp() override {
    RobotFilesTest::SetUp();
    RobotMount mount;
    // Its tip has a block of its own; an arm folded back by 180 degrees would lie on itself.
    mount.urdf_file = Write("arm.urdf", PlanarArm(R"(lower="-3.2" upper="3.2")", R"(
<joint name="hand_joint" type="revolute"><parent link="tip"/><child link="hand"/><axis xyz="0 0 1"/>
 <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="hand"><collision><origin xyz="0.05 0 0"/><geometry><sphere radius="0.03"/></geometry>
</collision></link>)"));
    mount.tip_link = "hand";
    auto model = ReadRobotModel(mount);
    ASSERT_TRUE(model.ok()) << model.status();
    model_ = *std::move(model);
  }

  RobotModel model_;
};

TEST_F(RobotCollisionTest, PrimitivesAndMeshesTouchWhereTheyShould) {
  const CollisionSolid box = CollisionSolid::FromBox({0.2, 0.2, 0.2});
  const CollisionSolid ball = CollisionSolid::FromShape({SphereShape{0.05}, At(0, 0, 0)}, 0);
  const CollisionSolid post = CollisionSolid::FromShape({CylinderShape{0.05, 0.4}, At(0, 0, 0)}, 0);
  const CollisionSolid mesh =
      CollisionSolid::FromMesh(BoxMesh({-0.1f, -0.1f, -0.1f}, {0.1f, 0.1f, 0.1f}));
  for (const CollisionSolid* solid : {&box, &mesh}) {
    EXPECT_TRUE(Touch(*solid, At(0, 0, 0), ball, At(0.149, 0, 0)));
    EXPECT_FALSE(Touch(*solid, At(0, 0, 0), ball, At(0.151, 0, 0)));
    // Beside an edge: the ball's bounding box overlaps, the ball does not.
    EXPECT_FALSE(Touch(*solid, At(0, 0, 0), ball, At(0.14, 0.14, 0)));
    EXPECT_TRUE(Touch(*solid, At(0, 0, 0), post, At(0.149, 0, 0.29)));
    EXPECT_FALSE(Touch(*solid, At(0, 0, 0), post, At(0.149, 0, 0.31)));
    EXPECT_TRUE(Touch(*solid, At(1, 2, 3), post, At(1.149, 2, 3)));
  }
  EXPECT_TRUE(Touch(CollisionSolid::FromBody(CylinderBody{{0, 0, -0.1}, 0.05, 0.2}, 0.01),
                    At(0, 0, 0), ball, At(0, 0.105, -0.1)));
  EXPECT_FALSE(Touch(CollisionSolid::FromBody(CylinderBody{{0, 0, -0.1}, 0.05, 0.2}, 0),
                     At(0, 0, 0), ball, At(0, 0.105, -0.1)));
}

TEST_F(RobotCollisionTest, NeighboursMayTouchOthersNot) {
  const RobotCollision collision(model_, {});
  EXPECT_FALSE(collision.WithItself(model_.LinkPoses({0, 0, 0})));
  // Folded back upon itself: neighbours, so that it is the hand that counts, which is at the
  // shoulder.
  const auto folded = collision.WithItself(model_.LinkPoses({0, 3.14159, 0}));
  ASSERT_TRUE(folded);
  EXPECT_EQ(folded->first, "upper");
  EXPECT_EQ(folded->second, "hand");
}

TEST_F(RobotCollisionTest, LoadIsLookedAtSaveAtItsOwnLink) {
  const CollisionSolid camera = CollisionSolid::FromBody(BoxBody{{0, 0, 0}, {0.1, 0.1, 0.1}}, 0);
  // Over the hand, in which it reaches: its own link.
  const RobotCollision near(model_, {{"camera", camera, camera, At(0.08, 0, 0)}});
  EXPECT_FALSE(near.WithItself(model_.LinkPoses({0, 0, 0})));
  // On a bar that reaches back to the fore arm.
  const RobotCollision back(model_, {{"camera", camera, camera, At(-0.2, 0, 0)}});
  const auto contact = back.WithItself(model_.LinkPoses({0, 0, 0}));
  ASSERT_TRUE(contact);
  EXPECT_EQ(contact->first, "camera");
  EXPECT_EQ(contact->second, "fore");
}

TEST_F(RobotCollisionTest, KeepsItsDistanceFromSurroundings) {
  const RobotCollision collision(model_, {});
  const auto links = model_.LinkPoses({0, 0, 0});
  const auto wall = [&](double y) {
    return std::vector<NamedSolid>{{"wall", CollisionSolid::FromBox({4, 0.02, 4}), At(0, y, 0)}};
  };
  // The hand's ball has 30 mm radius and 5 mm around it.
  EXPECT_FALSE(collision.WithSurroundings(links, wall(0.046), true));
  const auto contact = collision.WithSurroundings(links, wall(0.044), true);
  ASSERT_TRUE(contact);
  EXPECT_EQ(contact->first, "hand");
  EXPECT_EQ(contact->second, "wall");
}

TEST_F(RobotCollisionTest, NothingPassesBetweenTwoSteps) {
  const RobotCollision collision(model_, {});
  const auto links = model_.LinkPoses({0, 0, 0});
  // A sheet of 0.1 mm that comes from far on one side and goes far to the other.
  for (const double start_m : {0.5, 0.5013, 0.5037, 0.5071}) {
    const std::vector<NamedSolid> sheet = {
        {"sheet", CollisionSolid::FromBox({0.5, 0.0001, 0.5}), At(0.5, 0, 0)}};
    EXPECT_TRUE(
        collision.WithMovingSurroundings(links, sheet, {0, start_m, 0}, {0, -0.5, 0}, true));
    EXPECT_FALSE(
        collision.WithMovingSurroundings(links, sheet, {0, start_m, 0}, {0, 0.04, 0}, true));
  }
}

TEST_F(RobotCollisionTest, BoundsTheMotionOfAnyPoint) {
  const RobotCollision collision(model_, {});
  const JointPositions from = {0.1, -0.3, 0.2}, to = {0.25, 0.1, -0.1};
  const auto a = model_.LinkPoses(from), b = model_.LinkPoses(to);
  double farthest_m = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, 0.01, 0.01)}) {
      if (model_.links[i].name == "hand" || model_.links[i].name == "tip") continue;
      farthest_m = std::max(farthest_m, (a[i] * p - b[i] * p).norm());
    }
  }
  EXPECT_GE(collision.FarthestMotion(from, to), farthest_m);
  EXPECT_LE(collision.FarthestMotion(from, to), 5 * farthest_m);
  EXPECT_EQ(collision.FarthestMotion(from, from), 0);
}

}  // namespace
}  // namespace sightline
