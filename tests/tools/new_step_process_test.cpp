// SPDX-License-Identifier: Apache-2.0
// `sightline new`, `part` and `plan` of a STEP file, with the importer beside the program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <BRepPrimAPI_MakeBox.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Writer.hxx>
#include <filesystem>
#include <string>

#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class NewStepProcessTest : public BoxProcessTest {
 protected:
  NewStepProcessTest() : BoxProcessTest("{}") {}

  void SetUp() override {
    BoxProcessTest::SetUp();
    Message::DefaultMessenger()->ChangePrinters().Clear();
    STEPControl_Writer writer;
    ASSERT_EQ(writer.Transfer(BRepPrimAPI_MakeBox(50, 30, 20).Shape(), STEPControl_AsIs),
              IFSelect_RetDone);
    ASSERT_EQ(writer.Write((folder_ + "/Box 1.STP").c_str()), IFSelect_RetDone);
    setenv("XDG_CACHE_HOME", (folder_ + "/cache").c_str(), 1);
  }
};

TEST_F(NewStepProcessTest, IsTakenWhereverAPartIs) {
  const auto [looked, size] = Run("part 'Box 1.STP'");
  ASSERT_EQ(looked, 0) << size;
  EXPECT_THAT(size, HasSubstr("50.00 x 30.00 x 20.00 mm"));
  const auto [made, said] = Run("new 'Box 1.STP' --out task/i.json --spacing-mm 2 < /dev/null");
  ASSERT_EQ(made, 0) << said;
  EXPECT_THAT(said, HasSubstr("50 x 30 x 20 mm"));
  const auto [planned, output] =
      Run("plan task/i.json --out plan --evaluations-per-scan 300 --bound-evaluations 0 "
          "--no-pictures --no-point-clouds --field-directions 576");
  ASSERT_EQ(planned, 0) << output;
  EXPECT_GT(Read<v1::Plan>("plan/plan.json").coverage().coverage(), 0.5);
  // Meshed once.
  int meshes = 0;
  for (const auto& entry : fs::directory_iterator(folder_ + "/cache/sightline/step")) {
    meshes += entry.path().extension() == ".glb";
  }
  EXPECT_EQ(meshes, 1);
  // Jobs of a service keep theirs elsewhere.
  EXPECT_EQ(Run("--step-cache job_cache part 'Box 1.STP'").first, 0);
  EXPECT_TRUE(fs::exists(folder_ + "/job_cache"));
  EXPECT_THAT(Run("part 'Box 1.STP' --unit mm").second,
              AllOf(HasSubstr("Box 1.STP: unit is given"), HasSubstr("says its unit itself")));
}

TEST_F(NewStepProcessTest, WhatIsNoStepFileIsNamed) {
  Write("wrong.step", "no STEP at all");
  const auto [code, said] = Run("part wrong.step");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, HasSubstr("wrong.step"));
  EXPECT_EQ(Run("part none.step").first, 2);
}

}  // namespace
}  // namespace sightline
