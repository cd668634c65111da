// SPDX-License-Identifier: Apache-2.0
// Scenes that differ in their targets alone share the points that scans measure.
#include "coverage_server/scan/measured_scans.h"

#include <gtest/gtest.h>

#include <atomic>

#include "coverage_server/scene/coverage_scene.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

std::unique_ptr<CoverageScene> Scene(int64_t seed, const MeasuredScans& shared) {
  SceneDefinition definition;
  definition.part = SteppedPart();
  definition.sampling.seed = seed;
  definition.field_directions = 64;
  SceneBuildOptions options;
  options.threads = 1;
  options.measured_scans = shared;
  auto scene = CoverageScene::Build(std::move(definition), options);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *std::move(scene) : nullptr;
}

void ExpectSame(const CoverageScene& a, const CoverageScene& b, const Measurement& measurement) {
  std::vector<MeasurementPoint> points[2];
  const ExactCoverage of_a = a.EvaluateExact(measurement, &points[0], nullptr),
                      of_b = b.EvaluateExact(measurement, &points[1], nullptr);
  EXPECT_EQ(of_a.feasibility, of_b.feasibility);
  EXPECT_EQ(of_a.covered.ToBytes(), of_b.covered.ToBytes());
  EXPECT_EQ(of_a.measurement_points, of_b.measurement_points);
  EXPECT_EQ(of_a.first_frame, of_b.first_frame);
  ASSERT_EQ(points[0].size(), points[1].size());
  for (size_t i = 0; i < points[0].size(); ++i) {
    ASSERT_EQ(points[0][i].position_m, points[1][i].position_m);
    ASSERT_EQ(points[0][i].frame, points[1][i].frame);
  }
}

TEST(MeasuredScans, AnswersDoNotDependOnWhatIsKept) {
  const MeasuredScans shared = {std::make_shared<LruStore<MeasuredScans::Points>>(64 << 20),
                                "part"};
  const auto first = Scene(1, shared), second = Scene(2, shared);
  const auto first_alone = Scene(1, {}), second_alone = Scene(2, {});
  ASSERT_TRUE(first && second && first_alone && second_alone);
  Random random(3);
  constexpr int kScans = 20;
  for (int i = 0; i < kScans; ++i) {
    const Measurement measurement = RandomMeasurement(random);
    ExpectSame(*first, *first_alone, measurement);
    // Measured by the other scene, and asked for again.
    ExpectSame(*second, *second_alone, measurement);
    ExpectSame(*first, *first_alone, measurement);
  }
  EXPECT_EQ(shared.store->count(), kScans);
}

TEST(MeasuredScans, OtherPartsHaveOthers) {
  const auto store = std::make_shared<LruStore<MeasuredScans::Points>>(1 << 20);
  const MeasuredScans one = {store, "one"}, two = {store, "two"}, none;
  Measurement measurement;
  one.Add(measurement, std::make_shared<MeasuredScans::Points>(3));
  ASSERT_NE(one.Find(measurement), nullptr);
  EXPECT_EQ(one.Find(measurement)->size(), 3U);
  EXPECT_EQ(two.Find(measurement), nullptr);
  measurement.offset_y_m = 1e-9;
  EXPECT_EQ(one.Find(measurement), nullptr);
  // Without a store, and beyond its limit.
  none.Add(measurement, std::make_shared<MeasuredScans::Points>(3));
  EXPECT_EQ(none.Find(measurement), nullptr);
  one.Add(measurement, std::make_shared<MeasuredScans::Points>(1 << 20));
  EXPECT_EQ(one.Find(measurement), nullptr);
}

TEST(MeasuredScans, ABrokenOffScanIsNotKept) {
  const MeasuredScans shared = {std::make_shared<LruStore<MeasuredScans::Points>>(64 << 20),
                                "part"};
  const auto scene = Scene(1, shared);
  ASSERT_NE(scene, nullptr);
  const std::atomic<bool> cancelled = true;
  scene->EvaluateExact(OverheadMeasurement(0.5), nullptr, &cancelled);
  EXPECT_EQ(shared.store->count(), 0);
}

}  // namespace
}  // namespace sightline
