// SPDX-License-Identifier: Apache-2.0
// `sightline new` and then `sightline plan`, as a new user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <tuple>

#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kQuickPlan[] =
    " --evaluations-per-scan 3000 --bound-evaluations 0 --no-pictures --no-point-clouds "
    "--field-directions 576";

// A tetrahedron with edges of 30 to 42.
constexpr char kStl[] =
    "solid t\n"
    "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 30 0\nvertex 30 0 "
    "0\nendloop\nendfacet\n"
    "facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 30 0 0\nvertex 0 0 "
    "30\nendloop\nendfacet\n"
    "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 30\nvertex 0 30 "
    "0\nendloop\nendfacet\n"
    "facet normal 1 1 1\nouter loop\nvertex 30 0 0\nvertex 0 30 0\nvertex 0 0 "
    "30\nendloop\nendfacet\n"
    "endsolid t\n";

class NewProcessTest : public BoxProcessTest {
 protected:
  NewProcessTest() : BoxProcessTest("{}") {}
};

TEST_F(NewProcessTest, WhatItWritesPlansAsItIs) {
  Write("t.stl", kStl);
  const auto [made, said] =
      Run("new t.stl --unit mm --out task/i.json --spacing-mm 1.5 < /dev/null");
  ASSERT_EQ(made, 0) << said;
  const auto [planned, output] = Run(std::string("plan task/i.json --out plan") + kQuickPlan);
  ASSERT_EQ(planned, 0) << output;
  const v1::Plan plan = Read<v1::Plan>("plan/plan.json");
  EXPECT_GT(plan.scans_size(), 0);
  EXPECT_GT(plan.coverage().coverage(), 0.5);
}

// With the half metre of Table 2.1 hardly a scan of the search would see a part of 42 mm.
TEST_F(NewProcessTest, ASmallPartNeedsNoDomain) {
  Write("t.stl", kStl);
  Write("bare.json", R"({"part": {"file": "t.stl", "unit": "mm"},
                         "targets": {"spacing_m": 0.0015, "coverage_radius_m": 0.0009}})");
  const auto [planned, output] = Run(std::string("plan bare.json --out plan") + kQuickPlan);
  ASSERT_EQ(planned, 0) << output;
  const v1::Plan plan = Read<v1::Plan>("plan/plan.json");
  EXPECT_GE(plan.coverage().coverage(), 0.95) << output;
  for (const v1::PlannedScan& scan : plan.scans()) {
    EXPECT_LE(std::abs(scan.measurement().offset_y_m()), 0.06);
    EXPECT_LE(std::abs(scan.measurement().offset_z_m()), 0.06);
  }
}

TEST_F(NewProcessTest, WithoutATerminalItAsksNothing) {
  const auto [code, said] = Run("new box.obj --out a.json < /dev/null");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, AllOf(HasSubstr("--unit is missing"), HasSubstr("60 x 40 x 20 mm")));
  EXPECT_FALSE(fs::exists(folder_ + "/a.json"));
}

TEST_F(NewProcessTest, TheBareCommandAndTyposHelp) {
  auto [code, said] = Run("");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, AllOf(HasSubstr("sightline new bracket.step"), HasSubstr("--help")));
  std::tie(code, said) = Run("planz box.json");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, HasSubstr("did you mean plan?"));
  std::tie(code, said) = Run("plan");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, HasSubstr("sightline plan needs inspection, --out"));
  std::tie(code, said) = Run("plan nothing.json --out x --strategy refind");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(said, HasSubstr("nearest is \"refined\""));
  std::tie(code, said) = Run("--version");
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace sightline
