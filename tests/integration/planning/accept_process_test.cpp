// SPDX-License-Identifier: Apache-2.0
// `sightline accept` as a process: figures of acceptance.json that must agree with each other.
#include <gtest/gtest.h>

#include <filesystem>

#include "sightline/v1/acceptance.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

constexpr char kAccepted[] = R"({
  "name": "rig", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "uncertainty": {"line_detection": {"standard_deviation_px": 0.1}},
  "acceptance": {"runs": 60}
})";

class AcceptProcessTest : public BoxProcessTest {
 protected:
  AcceptProcessTest() : BoxProcessTest(kAccepted) {}
};

TEST_F(AcceptProcessTest, TestsWithinThePredictionAgreeWithTheSimulatedMagnitude) {
  const auto [code, output] = Run("accept inspection.json --out accepted --no-images");
  ASSERT_EQ(code, 0) << output;
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/accepted/report.html"));
  const auto result = Read<v1::AcceptanceResult>("accepted/acceptance.json");
  ASSERT_GT(result.quantities_size(), 5);
  for (const v1::AcceptanceQuantity& quantity : result.quantities()) {
    SCOPED_TRACE(quantity.artefact() + ", " + quantity.quantity());
    ASSERT_TRUE(quantity.has_within_predicted());
    // A fraction of 0.95 of the tests is within simulated_m, up to one test.
    const double one_test = 1.0 / result.runs();
    if (quantity.simulated_m() < quantity.predicted_m()) {
      EXPECT_GE(quantity.within_predicted(), 0.95 - one_test);
    } else {
      EXPECT_LE(quantity.within_predicted(), 0.95 + one_test);
    }
  }
}

}  // namespace
}  // namespace sightline
