// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/urdf/robot_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <numbers>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/limits/within_limits.h"
#include "tests/planning/robot/robot_files.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;

class RobotModelTest : public RobotFilesTest {
 protected:
  absl::Status Refusal(const std::string& urdf) const {
    RobotMount mount;
    mount.urdf_file = Write("arm.urdf", urdf);
    mount.tip_link = "tip";
    return ReadRobotModel(mount).status();
  }
  void ExpectRefused(const std::string& urdf, const std::string& why) const {
    const absl::Status status = Refusal(urdf);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("arm.urdf: "));
    EXPECT_THAT(std::string(status.message()), HasSubstr(why));
  }
};

// Products of the published Denavit-Hartenberg matrices, computed by another program.
TEST_F(RobotModelTest, ExampleArmIsWhatItsMakerPublishes) {
  const auto model = ReadRobotModel(ArmMount());
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->joints.size(), 6u);
  EXPECT_EQ(model->joints[2].name, "elbow_joint");
  const struct {
    JointPositions q;
    double rows[12];
  } golden[] = {
      {{0, 0, 0, 0, 0, 0}, {1, 0, 0, -1.184250000, 0, 0, -1, -0.290700000, 0, 1, 0, 0.060850000}},
      {{-kPi / 2, -kPi / 2, kPi / 2, -kPi / 2, -kPi / 2, 0},
       {1, 0, 0, -0.174150000, 0, -1, 0, 0.691400000, 0, 0, -1, 0.676850000}},
      {{0.3, -1.1, 1.4, -0.7, 0.9, 0.2},
       {0.836850684, 0.209954090, -0.505569196, -0.839187328, -0.544736061, 0.227845070,
        -0.807062109, -0.517718584, -0.054254542, 0.950792251, 0.305041867, 0.483001645}}};
  for (const auto& expected : golden) {
    const Eigen::Isometry3d tip = model->LinkPoses(expected.q)[model->tip];
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        EXPECT_NEAR(tip(row, column), expected.rows[4 * row + column], 1e-8) << row << column;
      }
    }
  }
}

TEST_F(RobotModelTest, ReadsLimitsSolidsAndWhatHangsBesideTheChain) {
  RobotMount mount;
  mount.urdf_file = Write("arm.urdf", PlanarArm(R"(lower="-2" upper="1")", R"(
<joint name="finger" type="prismatic"><parent link="fore"/><child link="jaw"/><axis xyz="0 1 0"/>
 <limit lower="0.01" upper="0.05" effort="1" velocity="1"/></joint><link name="jaw"/>)"));
  mount.tip_link = "tip";
  const auto model = ReadRobotModel(mount);
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->joints.size(), 2u);
  EXPECT_EQ(model->joints[1].min, -2);
  EXPECT_EQ(model->joints[1].max, 1);
  EXPECT_EQ(model->joints[1].max_speed, 2);
  EXPECT_EQ(model->home, (JointPositions{0, -0.5}));
  const auto links = model->LinkPoses({kPi / 2, -kPi / 2});
  EXPECT_TRUE(links[model->tip].translation().isApprox(Eigen::Vector3d(0.4, 0.5, 0), 1e-12));
  // The jaw is at the end of its range that is next to 0.
  for (size_t i = 0; i < model->links.size(); ++i) {
    if (model->links[i].name != "jaw") continue;
    EXPECT_TRUE(links[i].translation().isApprox(Eigen::Vector3d(0, 0.51, 0), 1e-12));
  }
  // From a link in the middle of the tree.
  mount.base_link = "upper";
  const auto fore = ReadRobotModel(mount);
  ASSERT_TRUE(fore.ok()) << fore.status();
  ASSERT_EQ(fore->joints.size(), 1u);
  EXPECT_NEAR(fore->LinkPoses({0})[fore->tip].translation().x(), 0.9, 1e-12);
}

TEST_F(RobotModelTest, MeshesBelongToTheDigest) {
  const std::string cube =
      "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  Write("hand.obj", cube);
  RobotMount mount;
  mount.tip_link = "tip";
  const auto with = [&](const std::string& mesh) {
    mount.urdf_file =
        Write("arm.urdf",
              absl::StrReplaceAll(PlanarArm(), {{R"(<link name="tip"/>)",
                                                 R"(<link name="tip"><collision><geometry><mesh )" +
                                                     mesh + "/></geometry></collision></link>"}}));
    return ReadRobotModel(mount);
  };
  const auto model = with(R"(filename="hand.obj" scale="0.001 0.001 0.001")");
  ASSERT_TRUE(model.ok()) << model.status();
  const Shape& shape = model->links[model->tip].shapes.at(0);
  EXPECT_NEAR(std::get<MeshShape>(shape.solid)->BoundingBox().max().x(), 0.1, 1e-6);
  Write("hand.obj", absl::StrReplaceAll(cube, {{"100 0 0", "90 0 0"}}));
  const auto other = with(R"(filename="hand.obj" scale="0.001 0.001 0.001")");
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_NE(other->digest, model->digest);

  for (const auto& [mesh, why] : {
           std::pair{R"(filename="missing.stl")", "no such file"},
           std::pair{R"(filename="../hand.obj")", "must be a path below the folder"},
           std::pair{R"(filename="/etc/passwd")", "must be a path below the folder"},
           std::pair{R"(filename="package://arm/hand.stl")", "give its path relative to the URDF"},
           std::pair{R"(filename="hand.obj" scale="0 1 1")", "scale must be finite and not 0"},
           std::pair{R"(filename="hand.obj" scale="nan 1 1")", "arm.urdf: "},
           std::pair{R"(filename="hand.obj")", "looks like millimetres"},
           std::pair{R"(filename="hand.obj")", "correct the scale of <mesh>"},
           std::pair{R"(filename="arm.urdf")", "arm.urdf"},
       }) {
    const auto refused = with(mesh);
    ASSERT_FALSE(refused.ok()) << mesh;
    EXPECT_THAT(std::string(refused.status().message()), HasSubstr(why)) << mesh;
  }
}

// A tetrahedron with edges of 0.1 m along the axes, in files of any unit. The volume from the
// triangles' winding is positive where normals point outwards.
TEST_F(RobotModelTest, MeshesAreMetresTimesScale) {
  RobotMount mount;
  mount.tip_link = "tip";
  for (const auto& [unit_m, scale, mirrored] : {
           std::tuple{1.0, "1 1 1", false},
           std::tuple{1.0, "", false},
           std::tuple{1e-3, "0.001 0.001 0.001", false},
           std::tuple{1e-2, "0.01 0.01 0.01", false},
           std::tuple{0.0254, "0.0254 0.0254 0.0254", false},
           std::tuple{1e-6, "1e-6 1e-6 1e-6", false},
           std::tuple{0.1, "0.1 0.1 0.1", false},
           std::tuple{5e-4, "0.0005 0.0005 0.0005", false},
           std::tuple{1.0, "1 -1 1", true},
           std::tuple{1e-2, "-0.01 0.01 0.01", true},
           std::tuple{1e-3, "-0.001 -0.001 -0.001", true},
           std::tuple{1e-3, "-0.001 -0.001 0.001", false},
       }) {
    const std::string d = absl::StrCat(0.1 / unit_m);
    Write("hand.obj", absl::StrCat("v 0 0 0\nv ", d, " 0 0\nv 0 ", d, " 0\nv 0 0 ", d,
                                   "\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"));
    const std::string mesh =
        absl::StrCat("<mesh filename=\"hand.obj\"",
                     *scale == 0 ? std::string() : absl::StrCat(" scale=\"", scale, "\""), "/>");
    mount.urdf_file = Write(
        "arm.urdf", absl::StrReplaceAll(PlanarArm(), {{"<box size=\"0.4 0.02 0.02\"/>", mesh}}));
    const auto model = ReadRobotModel(mount);
    ASSERT_TRUE(model.ok()) << scale << ": " << model.status();
    const auto fore = std::ranges::find(model->links, "fore", &RobotLink::name);
    ASSERT_EQ(fore->shapes.size(), 1u);
    const TriangleMesh& hand = *std::get<MeshShape>(fore->shapes[0].solid);
    EXPECT_TRUE(hand.BoundingBox().sizes().isApprox(Eigen::Vector3d::Constant(0.1), 1e-6)) << scale;
    double volume_m3 = 0;
    for (size_t t = 0; t < hand.triangles.size(); ++t) {
      volume_m3 += hand.Corner(t, 0).dot(hand.Corner(t, 1).cross(hand.Corner(t, 2))) / 6;
    }
    EXPECT_NEAR(volume_m3, 1e-3 / 6, 1e-9) << scale;
    const Eigen::AlignedBox3d box = hand.BoundingBox();
    EXPECT_EQ((box.center().array() < 0).count() % 2 == 1, mirrored) << scale;
  }
}

TEST_F(RobotModelTest, MissingMeshesNameTheFileThatIsThere) {
  Write("hand.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string urdf = absl::StrReplaceAll(
      PlanarArm(), {{"<box size=\"0.4 0.02 0.02\"/>", "<mesh filename=\"Hand.OBJ\"/>"}});
  const absl::Status status = Refusal(urdf);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("Hand.OBJ"), HasSubstr("no such file"), HasSubstr("\"hand.obj\"")));
}

TEST_F(RobotModelTest, SoftLimitsBoundTheJoint) {
  RobotMount mount;
  mount.tip_link = "tip";
  const auto with = [&](const std::string& safety) {
    mount.urdf_file = Write(
        "arm.urdf",
        absl::StrReplaceAll(PlanarArm(R"(lower="-2" upper="1")"),
                            {{"velocity=\"2\"/>", absl::StrCat("velocity=\"2\"/>", safety)}}));
    return ReadRobotModel(mount);
  };
  const struct {
    const char* limits;
    double min, max;
  } cases[] = {
      {R"(k_velocity="1")", -2, 1},  // none stated
      {R"(soft_lower_limit="0" soft_upper_limit="0" k_velocity="1")", -2, 1},
      {R"(soft_lower_limit="-1.5" soft_upper_limit="0.5" k_velocity="1")", -1.5, 0.5},
      {R"(soft_lower_limit="-1.5" soft_upper_limit="3" k_velocity="1")", -1.5, 1},
      {R"(soft_lower_limit="-12.6" soft_upper_limit="13" k_velocity="1")", -2, 1},  // wider
      {R"(soft_upper_limit="0.5" k_velocity="1")", 0, 0.5},  // the other one is 0 by default
  };
  for (const auto& c : cases) {
    const auto model = with(absl::StrCat("<safety_controller ", c.limits, "/>"));
    ASSERT_TRUE(model.ok()) << c.limits << ": " << model.status();
    EXPECT_EQ(model->joints[1].min, c.min) << c.limits;
    EXPECT_EQ(model->joints[1].max, c.max) << c.limits;
    EXPECT_EQ(model->home[1], (c.min + c.max) / 2) << c.limits;
  }
  const auto none =
      with(R"(<safety_controller soft_lower_limit="1.5" soft_upper_limit="2" k_velocity="1"/>)");
  EXPECT_THAT(std::string(none.status().message()),
              AllOf(HasSubstr("joint elbow: limits are -2 to 1"), HasSubstr("1.5 to 2")));
  ExpectRefused(absl::StrReplaceAll(PlanarArm(),
                                    {{"type=\"revolute\"", "type=\"continuous\""},
                                     {"velocity=\"2\"/>",
                                      "velocity=\"2\"/><safety_controller soft_lower_limit=\"-1\" "
                                      "soft_upper_limit=\"1\" k_velocity=\"1\"/>"}}),
                "joint elbow: turns without end");
}

// Every limit that a file states bounds the joint, or a remark says that it does not.
TEST_F(RobotModelTest, LimitsWithoutEffectAreRemarked) {
  RobotMount mount;
  mount.tip_link = "tip";
  const auto remarks = [&](const std::string& type, const std::string& limits,
                           const std::string& safety) {
    mount.urdf_file =
        Write("arm.urdf",
              absl::StrReplaceAll(
                  PlanarArm(limits),
                  {{R"(name="elbow" type="revolute")", "name=\"elbow\" type=\"" + type + "\""},
                   {"velocity=\"2\"/>", absl::StrCat("velocity=\"2\"/>", safety)}}));
    const auto model = ReadRobotModel(mount);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->remarks : std::vector<std::string>{"refused"};
  };
  EXPECT_THAT(remarks("continuous", R"(lower="-1" upper="2")", ""),
              ElementsAre(HasSubstr("joint elbow: its limits -1 to 2 rad have no effect")));
  EXPECT_THAT(remarks("continuous", R"(upper="2")", ""),
              ElementsAre(HasSubstr("joint elbow: its limits 0 to 2 rad have no effect")));
  // Stated limits of 0 differ from limits that are left out, though urdfdom gives both the same.
  for (const char* zero : {R"(lower="0" upper="0")", R"(lower="0.0")", R"(upper="0")"}) {
    EXPECT_THAT(remarks("continuous", zero, ""),
                ElementsAre(AllOf(HasSubstr("joint elbow: its limits 0 to 0 rad have no effect"),
                                  HasSubstr("\"fixed\""))))
        << zero;
  }
  EXPECT_THAT(remarks("continuous", "", ""), ElementsAre());
  const std::string limits = R"(lower="-1" upper="2")";
  for (const char* zero : {R"(soft_lower_limit="0" soft_upper_limit="0" )",
                           R"(soft_lower_limit="0" )", R"(soft_upper_limit="0.0" )"}) {
    EXPECT_THAT(remarks("revolute", limits,
                        absl::StrCat("<safety_controller ", zero, "k_velocity=\"1\"/>")),
                ElementsAre(HasSubstr("joint elbow: the soft limits 0 to 0")))
        << zero;
  }
  EXPECT_THAT(remarks("revolute", limits, R"(<safety_controller k_velocity="1"/>)"), ElementsAre());
  EXPECT_THAT(
      remarks("revolute", limits,
              R"(<safety_controller soft_lower_limit="0" soft_upper_limit="1" k_velocity="1"/>)"),
      ElementsAre());
}

TEST_F(RobotModelTest, LimitsInDegreesAreNamed) {
  for (const char* degrees :
       {R"(lower="-180" upper="180")", R"(lower="0" upper="90")", R"(lower="-13" upper="2")"}) {
    ExpectRefused(PlanarArm(degrees), "joint elbow: limits are ");
    ExpectRefused(PlanarArm(degrees), "they look like degrees");
  }
  // Joints of published robots that turn more than once.
  EXPECT_TRUE(Refusal(PlanarArm(R"(lower="-10" upper="10")")).ok());
  ExpectRefused(PlanarArm(R"(lower="x" upper="90")"), "joint elbow: <limit>: lower must be");
  // Metres of a linear joint are metres.
  const auto slide = [](const std::string& limits) {
    return absl::StrReplaceAll(PlanarArm(limits), {{R"(name="elbow" type="revolute")",
                                                    R"(name="elbow" type="prismatic")"}});
  };
  EXPECT_TRUE(Refusal(slide(R"(lower="0" upper="90")")).ok());
  ExpectRefused(slide(R"(lower="0" upper="600")"), "joint elbow: limits are 0 to 600 m");
}

TEST_F(RobotModelTest, RemarksOnSolidsThatAreLikelyForgotten) {
  RobotMount mount;
  mount.tip_link = "tip";
  const auto remarks = [&](const std::string& urdf) {
    mount.urdf_file = Write("arm.urdf", urdf);
    const auto model = ReadRobotModel(mount);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->remarks : std::vector<std::string>{"refused"};
  };
  EXPECT_THAT(remarks(PlanarArm()), ElementsAre());
  EXPECT_THAT(remarks(absl::StrReplaceAll(PlanarArm(), {{"collision>", "visual>"}})),
              ElementsAre(HasSubstr("no link that moves has a solid"),
                          HasSubstr("links upper, fore have a <visual> but no <collision>")));
  // A pedestal is no solid of the chain.
  const std::string bare = R"(<robot name="bare"><link name="base"><collision><geometry>
<sphere radius="0.1"/></geometry></collision></link><joint name="turn" type="continuous">
<parent link="base"/><child link="tip"/><limit effort="1" velocity="1"/></joint>
<link name="tip"/></robot>)";
  EXPECT_THAT(remarks(bare), ElementsAre(HasSubstr("no link that moves has a solid")));
  EXPECT_THAT(remarks(absl::StrReplaceAll(PlanarArm(), {{"velocity=\"2\"", "velocity=\"120\""}})),
              ElementsAre(HasSubstr("joint elbow: limit velocity is 120 rad/s")));
  EXPECT_THAT(remarks(PlanarArm(R"(lower="-2" upper="2")", R"(<link name="rod"/>
<joint name="rod_joint" type="revolute"><parent link="base"/><child link="rod"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="elbow"/></joint>)")),
              ElementsAre(HasSubstr("joint rod_joint mimics joint elbow")));
}

TEST_F(RobotModelTest, MeshFilesAreReadOnceAndHaveALimitTogether) {
  // 20 MB of comments beside four triangles: quick to read once, not 1500 times.
  std::string cube =
      "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  while (cube.size() < 20'000'000) cube += "# nothing\n";
  Write("hand.obj", cube);
  RobotMount mount;
  mount.tip_link = "tip";
  const auto with = [&](const std::string& solids) {
    mount.urdf_file = Write(
        "arm.urdf",
        absl::StrReplaceAll(
            PlanarArm(), {{R"(<link name="tip"/>)", R"(<link name="tip">)" + solids + "</link>"}}));
    return WithinLimits({.cpu_time_s = 20}, [&] {
      const auto model = ReadRobotModel(mount);
      return model.ok() ? absl::StrCat(model->links[model->tip].shapes.size(), " solids")
                        : std::string(model.status().message());
    });
  };
  const auto solid = [](const std::string& scale) {
    return R"(<collision><geometry><mesh filename="hand.obj" scale=")" + scale +
           R"("/></geometry></collision>)";
  };
  std::string same, different;
  for (int i = 0; i < 1500; ++i) same += solid("1 1 1");
  for (int i = 0; i < 1500; ++i) different += solid(absl::StrCat("1 1 1.0", 1000 + i));
  EXPECT_EQ(with(same), "1500 solids");
  EXPECT_THAT(with(different), HasSubstr("mesh files have more than 268435456 bytes together"));
}

TEST_F(RobotModelTest, RefusesWhatAChainCannotBe) {
  ExpectRefused("", "");
  ExpectRefused("<robot", "");
  ExpectRefused("not xml at all", "");
  ExpectRefused("<robot name=\"r\"></robot>", "");
  ExpectRefused(PlanarArm("x=\"1\""), "");  // no limits: 0 to 0
  ExpectRefused(PlanarArm(R"(lower="1" upper="-1")"), "joint elbow: limits are 1 to -1");
  ExpectRefused(PlanarArm(R"(lower="nan" upper="1")"), "");
  ExpectRefused(PlanarArm(R"(lower="-inf" upper="1")"), "");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(),
                                    {{R"(effort="1" velocity="2")", R"(effort="1" velocity="0")"}}),
                "joint elbow: limit velocity is 0");
  ExpectRefused(
      absl::StrReplaceAll(PlanarArm(),
                          {{R"(<limit lower="-2" upper="2" effort="1" velocity="2"/>)", ""}}),
      "elbow");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(),
                                    {{R"(<origin xyz="0.5 0 0"/>)", R"(<origin xyz="nan 0 0"/>)"}}),
                "");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(),
                                    {{R"(<origin xyz="0.5 0 0"/>)", R"(<origin xyz="500 0 0"/>)"}}),
                "joint elbow: origin xyz is 500, must be in [-100, 100] m");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(), {{R"(<box size="0.4 0.02 0.02"/>)",
                                                   R"(<box size="0.4 -1 0.02"/>)"}}),
                "link fore: box size is -1");
  ExpectRefused(
      absl::StrReplaceAll(PlanarArm(), {{R"(<axis xyz="0 0 1"/>)", R"(<axis xyz="0 0 0"/>)"}}),
      "axis is zero");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(), {{R"(name="elbow" type="revolute")",
                                                   R"(name="elbow" type="planar")"}}),
                "joint elbow: is neither fixed, revolute, continuous nor prismatic");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(),
                                    {{"effort=\"1\" velocity=\"2\"/>",
                                      "effort=\"1\" velocity=\"2\"/><mimic joint=\"shoulder\"/>"}}),
                "joint elbow: mimics another joint");
  ExpectRefused(absl::StrReplaceAll(PlanarArm(), {{"name=\"tip\"", "name=\"hand\""},
                                                  {"link=\"tip\"", "link=\"hand\""}}),
                "has no link \"tip\" (rig.robot.tip_link); it has base, upper, fore, hand");
}

TEST_F(RobotModelTest, RefusesLoops) {
  // Beside the tree, and of the tree itself.
  ExpectRefused(PlanarArm(R"(lower="-2" upper="2")", R"(
<link name="a"/><link name="b"/>
<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint>)"),
                "in a loop");
  ExpectRefused(PlanarArm(R"(lower="-2" upper="2")", R"(
<joint name="back" type="fixed"><parent link="tip"/><child link="base"/></joint>)"),
                "in a loop");
  ExpectRefused(PlanarArm(R"(lower="-2" upper="2")", R"(
<joint name="itself" type="fixed"><parent link="base"/><child link="base"/></joint>)"),
                "link base is in a loop");
  ExpectRefused(PlanarArm(R"(lower="-2" upper="2")", R"(
<joint name="second" type="fixed"><parent link="base"/><child link="tip"/></joint>)"),
                "link tip has two parents");
}

TEST_F(RobotModelTest, RefusesFilesThatAreMadeToHurt) {
  ExpectRefused(R"(<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><robot name="&b;"/>)",
                "document type declaration");
  std::string deep;
  for (int i = 0; i < 500000; ++i) deep += "<a>";
  ExpectRefused(deep, "nested more than 64 deep");
  // TinyXML, which reads by recursion, sees elements where XML has none.
  const auto repeated = [](const std::string& text) {
    std::string all;
    while (all.size() < 3'000'000) all += text;
    return all;
  };
  ExpectRefused(repeated("</a>") + deep.substr(0, 900'000), "closes an element that is not open");
  ExpectRefused(repeated("<a><!--></a>-->"), "nested more than 64 deep");
  ExpectRefused("<?xml >" + deep, "declaration that does not end in ?>");
  ExpectRefused("<a><![CDATA[]]>" + deep, "CDATA");
  // And compares every attribute with all others.
  std::string attributes = "<robot";
  for (int i = 0; i < 200'000; ++i) absl::StrAppend(&attributes, " a", i, "=\"\"");
  ExpectRefused(attributes + "/>", "more than 64 attributes");
  ExpectRefused(std::string((4 << 20) + 1, ' '), "a URDF has at most 4194304");
  ExpectRefused(PlanarArm() + std::string(1, '\0'), "zero bytes");
  std::string many = "<robot name=\"many\"><link name=\"tip\"/>";
  for (int i = 0; i < 300; ++i) {
    const std::string n = std::to_string(i);
    many += "<link name=\"l" + n + "\"/><joint name=\"j" + n +
            "\" type=\"fixed\"><parent link=\"tip\"/><child link=\"l" + n + "\"/></joint>";
  }
  ExpectRefused(many + "</robot>", "has 301 links, at most 200");

  RobotMount mount;
  mount.tip_link = "tip";
  mount.urdf_file = folder_ + "/missing.urdf";
  EXPECT_EQ(ReadRobotModel(mount).status().code(), absl::StatusCode::kNotFound);
  mount.urdf_file = folder_;
  EXPECT_THAT(std::string(ReadRobotModel(mount).status().message()),
              HasSubstr("is not a regular file"));
  mount.urdf_file = folder_ + "/pipe.urdf";
  ASSERT_EQ(mkfifo(mount.urdf_file.c_str(), 0600), 0);
  EXPECT_THAT(std::string(ReadRobotModel(mount).status().message()),
              HasSubstr("is not a regular file"));
}

TEST_F(RobotModelTest, HomeMustFitTheChain) {
  RobotMount mount;
  mount.urdf_file = Write("arm.urdf", PlanarArm());
  mount.tip_link = "tip";
  mount.home = {0.1};
  EXPECT_THAT(std::string(ReadRobotModel(mount).status().message()),
              HasSubstr("rig.robot.home_position has 1 entries"));
  mount.home = {0.1, 2.5};
  EXPECT_THAT(std::string(ReadRobotModel(mount).status().message()),
              HasSubstr("rig.robot.home_position[1] is 2.5, joint elbow allows [-2, 2]"));
  mount.home = {0.1, 1.5};
  EXPECT_TRUE(ReadRobotModel(mount).ok());
}

}  // namespace
}  // namespace sightline
