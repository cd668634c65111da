// SPDX-License-Identifier: Apache-2.0
// The visibility field's estimates: how far from exact, and always the same.
#include "coverage_server/scan/fast_evaluator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <thread>

#include "core/targets/poisson_disk.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

// Ranks with ties sharing their mean rank.
std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t i = 0; i < order.size();) {
    size_t j = i;
    while (j < order.size() && values[order[j]] == values[order[i]]) ++j;
    for (size_t k = i; k < j; ++k) ranks[order[k]] = 0.5 * static_cast<double>(i + j - 1);
    i = j;
  }
  return ranks;
}

double Spearman(const std::vector<double>& a, const std::vector<double>& b) {
  const auto x = Ranks(a), y = Ranks(b);
  const double mean = 0.5 * static_cast<double>(x.size() - 1);
  double xy = 0, xx = 0, yy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xy / std::sqrt(xx * yy);
}

// Targets that face camera and laser and lie inside the field of view at their lit moment.
TargetBits Inner(const CoverageScene& scene, const Measurement& m) {
  const Rig& rig = scene.rig();
  const ScanGeometry g = MakeScanGeometry(rig, m);
  TargetBits inner(scene.targets().size());
  const double tan_x = 0.5 * rig.camera.columns_px / rig.camera.FocalLengthPx();
  const double tan_y = 0.5 * rig.camera.rows_px / rig.camera.FocalLengthPx();
  for (size_t t = 0; t < inner.size(); ++t) {
    const Eigen::Vector3d p = scene.targets().positions_m[t].cast<double>();
    const double stage_m = g.LitStagePosition(PartToWorld(g, scene.part_centre_m(), p, 0));
    const Eigen::Vector3d x = PartToWorld(g, scene.part_centre_m(), p, stage_m);
    const Eigen::Vector3d n = g.part_rotation * scene.targets().normals[t].cast<double>();
    const Eigen::Vector3d view = x - g.camera.origin_m, light = x - g.laser.origin_m;
    const double depth = view.dot(g.camera.z_axis);
    if (n.dot(view) < 0 && n.dot(light) < 0 &&
        std::abs(view.dot(g.camera.x_axis)) < depth * tan_x &&
        std::abs(view.dot(g.camera.y_axis)) < depth * tan_y && view.norm() < rig.max_range_m) {
      inner.Set(t);
    }
  }
  return inner;
}

// `max_inner_bias` is for targets that themselves face both sensors and are in view; at the rim a
// target may be covered through its neighbourhood alone.
void ExpectCloseToExact(SceneDefinition definition, const char* name, int scans, uint64_t seed,
                        double max_inner_bias) {
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const double targets = static_cast<double>(scene->targets().size());
  Random random(seed);
  std::vector<double> fast_counts, exact_counts;
  double sum = 0, absolute = 0, worst = 0, different = 0, inner_sum = 0;
  int disagree = 0, feasible = 0;
  for (int tries = 0; feasible < scans && tries < 50 * scans; ++tries) {
    const Measurement m = RandomMeasurement(random);
    FastCoverage fast;
    scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
    if (fast.feasibility != Feasibility::kFeasible || fast.covered.Count() == 0) continue;
    const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
    // Travel or a collision at the very end of the travel may be judged otherwise.
    if (exact.feasibility != Feasibility::kFeasible) {
      ++disagree;
      continue;
    }
    ++feasible;
    const auto f = static_cast<double>(fast.covered.Count()),
               e = static_cast<double>(exact.covered.Count());
    fast_counts.push_back(f);
    exact_counts.push_back(e);
    sum += (f - e) / targets;
    absolute += std::abs(f - e) / targets;
    worst = std::max(worst, std::abs(f - e) / targets);
    const TargetBits inner = Inner(*scene, m);
    TargetBits inner_fast = fast.covered, inner_exact = exact.covered;
    inner_fast &= inner;
    inner_exact &= inner;
    inner_sum += static_cast<double>(inner_fast.Count() - inner_exact.Count()) / targets;
    different += static_cast<double>(fast.covered.CountNotIn(exact.covered) +
                                     exact.covered.CountNotIn(fast.covered)) /
                 targets;
  }
  ASSERT_EQ(feasible, scans);
  // The better half by exact count.
  std::vector<double> sorted = exact_counts, fast_good, exact_good;
  std::sort(sorted.begin(), sorted.end());
  for (size_t i = 0; i < exact_counts.size(); ++i) {
    if (exact_counts[i] < sorted[sorted.size() / 2]) continue;
    fast_good.push_back(fast_counts[i]);
    exact_good.push_back(exact_counts[i]);
  }
  const double rank = Spearman(fast_good, exact_good);
  std::printf(
      "%s: %.0f targets, %d scans: error %.4f, bias %+.4f (inside %+.4f), worst %.4f, different "
      "targets %.4f, "
      "rank correlation of the better half %.4f, feasibility differs %d\n",
      name, targets, scans, absolute / scans, sum / scans, inner_sum / scans, worst,
      different / scans, rank, disagree);
  EXPECT_LT(absolute / scans, 0.01);
  EXPECT_LT(std::abs(sum / scans), 0.005);
  EXPECT_LT(std::abs(inner_sum / scans), max_inner_bias);
  EXPECT_LT(different / scans, 0.02);
  EXPECT_GT(rank, 0.98);
  EXPECT_LE(disagree, 1 + scans / 20);
}

SceneDefinition Small(TriangleMesh part) {
  SceneDefinition definition;
  definition.part = std::move(part);
  definition.sampling.spacing_m = 0.003;
  definition.sampling.coverage_radius_m = 0.002;
  definition.field_directions = 1024;
  return definition;
}

TEST(FastEvaluator, SteppedPartIsCloseToExact) {
  ExpectCloseToExact(Small(SteppedPart()), "stepped", 40, 31, 0.002);
}

// Targets just beyond the limit may be covered through their neighbourhood: they count as inside.
TEST(FastEvaluator, LimitedIncidenceIsCloseToExact) {
  SceneDefinition definition = Small(SteppedPart());
  definition.sampling.max_incidence_rad = 0.9;
  ExpectCloseToExact(std::move(definition), "incidence", 40, 35, 0.005);
}

TEST(FastEvaluator, BlindHoleIsCloseToExact) {
  ExpectCloseToExact(Small(BlindHolePart()), "hole", 40, 32, 0.002);
}

// Frames and columns so far apart that not every target gets a point. The tangent plane stands for
// the surface then: + 0.4 % inside the rim.
TEST(FastEvaluator, SparseGridIsCloseToExact) {
  SceneDefinition definition = Small(SteppedPart());
  definition.rig.camera.columns_px = definition.rig.camera.rows_px = 64;
  definition.rig.scan_step_m = 0.005;
  ExpectCloseToExact(std::move(definition), "sparse", 40, 33, 0.005);
}

TEST(FastEvaluator, CylinderHeadIsCloseToExact) {
  SceneDefinition definition;
  definition.part = CylinderHead();
  ASSERT_FALSE(definition.part.triangles.empty());
  definition.sampling.spacing_m = 0.01;
  definition.field_directions = 256;
  ExpectCloseToExact(std::move(definition), "cylinder head", 10, 34, 0.002);
}

TEST(FastEvaluator, SameForAnyBatchAndThread) {
  SceneDefinition definition = Small(BlindHolePart());
  definition.field_directions = 256;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  Random random(41);
  std::vector<Measurement> measurements;
  for (int i = 0; i < 300; ++i) measurements.push_back(RandomMeasurement(random));
  std::vector<float> weights(scene->targets().size());
  for (float& w : weights) w = static_cast<float>(random.Uniform(0, 2));
  TargetBits covered(scene->targets().size());
  for (size_t t = 0; t < covered.size(); t += 3) covered.Set(t);
  std::vector<FastGain> whole(measurements.size());
  scene->EvaluateGains(measurements, &covered, weights, whole, nullptr);
  const auto same = [&](const std::vector<FastGain>& gains) {
    for (size_t i = 0; i < gains.size(); ++i) {
      if (gains[i].feasibility != whole[i].feasibility ||
          gains[i].new_targets != whole[i].new_targets ||
          gains[i].covered_targets != whole[i].covered_targets ||
          gains[i].weighted_gain != whole[i].weighted_gain) {
        return false;
      }
    }
    return true;
  };
  for (const size_t batch : {size_t{1}, size_t{7}, size_t{64}, size_t{129}}) {
    std::vector<FastGain> gains(measurements.size());
    for (size_t i = 0; i < gains.size(); i += batch) {
      const size_t n = std::min(batch, gains.size() - i);
      scene->EvaluateGains(std::span(measurements).subspan(i, n), &covered, weights,
                           std::span(gains).subspan(i, n), nullptr);
    }
    EXPECT_TRUE(same(gains)) << batch;
  }
  std::vector<std::vector<FastGain>> results(3, std::vector<FastGain>(measurements.size()));
  std::vector<std::thread> threads;
  for (auto& gains : results) {
    threads.emplace_back(
        [&] { scene->EvaluateGains(measurements, &covered, weights, gains, nullptr); });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& gains : results) EXPECT_TRUE(same(gains));

  // Gains count what the coverage bits say: measurable, and new if not covered before.
  std::vector<FastCoverage> bits(measurements.size());
  scene->EvaluateFastCoverage(measurements, bits, nullptr);
  int feasible = 0;
  for (size_t i = 0; i < bits.size(); ++i) {
    EXPECT_EQ(bits[i].feasibility, whole[i].feasibility);
    if (bits[i].feasibility != Feasibility::kFeasible) continue;
    feasible += bits[i].covered.Count() > 0;
    TargetBits b = bits[i].covered;
    b &= scene->measurable();
    EXPECT_EQ(b.Count(), whole[i].covered_targets);
    EXPECT_EQ(b.CountNotIn(covered), whole[i].new_targets);
    double weight = 0;
    for (size_t t = 0; t < b.size(); ++t) {
      if (b.Test(t) && !covered.Test(t)) weight += static_cast<double>(weights[t]);
    }
    EXPECT_NEAR(weight, whole[i].weighted_gain, 1e-9 * (1 + weight));
  }
  EXPECT_GT(feasible, 50);
}

// ---- the bytes of the field do not depend on who renders it

struct FieldInput {
  TriangleMesh part = BlindHolePart();
  TargetSampling sampling;
  TargetSet targets;
  SurfaceProbes probes;
  FieldInput() {
    auto sampled = SampleTargets(part, sampling);
    EXPECT_TRUE(sampled.ok()) << sampled.status();
    if (sampled.ok()) targets = *sampled;
    probes = MakeSurfaceProbes(part, TriangleBvh(part), targets, sampling);
  }
  std::string Bytes(int processes, bool coherent = true) const {
    FieldBuildOptions options;
    options.directions = 256;
    options.processes = processes;
    options.coherent_occlusion = coherent;
    auto field = BuildVisibilityField(part, {}, targets, probes, options);
    EXPECT_TRUE(field.ok()) << field.status();
    if (!field.ok()) return "";
    return {reinterpret_cast<const char*>((*field)->BlockData(0)), (*field)->bytes()};
  }
};

constexpr char kOutputVariable[] = "SIGHTLINE_TEST_FIELD_OUTPUT";

// Not a test: what the next one runs in a copy of this program that has no worker program near.
TEST(VisibilityFieldBytes, DISABLED_WriteInProcess) {
  const char* path = std::getenv(kOutputVariable);
  ASSERT_NE(path, nullptr);
  std::ofstream(path, std::ios::binary) << FieldInput().Bytes(1);
}

TEST(VisibilityFieldBytes, SameForAnyNumberOfProcesses) {
  const FieldInput input;
  const std::string one = input.Bytes(1);
  ASSERT_GT(one.size(), 100000u);
  EXPECT_TRUE(one == input.Bytes(2));
  EXPECT_TRUE(one == input.Bytes(3));

  const auto folder =
      std::filesystem::temp_directory_path() / ("sightline-field-" + std::to_string(getpid()));
  ASSERT_TRUE(std::filesystem::create_directory(folder));
  const auto program = folder / "test", output = folder / "bytes";
  std::filesystem::copy_file(std::filesystem::read_symlink("/proc/self/exe"), program);
  const std::string command =
      "env -u SIGHTLINE_BIN_DIR " + std::string(kOutputVariable) + "=" + output.string() + " " +
      program.string() +
      " --gtest_also_run_disabled_tests --gtest_filter='*DISABLED_WriteInProcess' > /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream file(output, std::ios::binary);
  const std::string in_process((std::istreambuf_iterator<char>(file)), {});
  EXPECT_TRUE(one == in_process) << in_process.size() << " bytes";
  file.close();
  std::filesystem::remove_all(folder);
}

// Blocks of neighbours are skipped whole; targets in any order make blocks that never are.
TEST(FastEvaluator, SkippedBlocksHoldNothingThatIsCovered) {
  const TriangleMesh part = SteppedPart();
  TargetSampling sampling;
  sampling.spacing_m = 0.002;
  const auto sampled = SampleTargets(part, sampling);
  ASSERT_TRUE(sampled.ok());
  const TargetSet& near = *sampled;
  const size_t count = near.size();
  ASSERT_GT(count, 20u * kTargetsPerBlock);
  std::vector<size_t> order(count);
  std::iota(order.begin(), order.end(), size_t{0});
  Random random(51);
  for (size_t i = count - 1; i > 0; --i) std::swap(order[i], order[random.Next() % (i + 1)]);
  TargetSet mixed;
  for (const size_t t : order) {
    mixed.positions_m.push_back(near.positions_m[t]);
    mixed.normals.push_back(near.normals[t]);
    mixed.regions.push_back(near.regions[t]);
    mixed.triangles.push_back(near.triangles[t]);
  }
  const TriangleBvh bvh(part);
  const SurfaceProbes near_probes = MakeSurfaceProbes(part, bvh, near, sampling);
  SurfaceProbes mixed_probes;
  for (const size_t t : order) {
    for (int k = 0; k < kProbesPerTarget; ++k) {
      const size_t probe = t * kProbesPerTarget + static_cast<size_t>(k);
      mixed_probes.positions_m.push_back(near_probes.positions_m[probe]);
      mixed_probes.normals.push_back(near_probes.normals[probe]);
    }
  }
  FieldBuildOptions options;
  options.directions = 256;
  const auto near_field = BuildVisibilityField(part, {}, near, near_probes, options);
  const auto mixed_field = BuildVisibilityField(part, {}, mixed, mixed_probes, options);
  ASSERT_TRUE(near_field.ok() && mixed_field.ok());
  const FastEvaluator by_place(near, sampling, near_probes, **near_field);
  const FastEvaluator by_chance(mixed, sampling, mixed_probes, **mixed_field);

  Rig rig;
  rig.laser.fan_angle_rad = 0.3;
  int64_t covered = 0, scans_with_all = 0;
  for (int i = 0; i < 400; ++i) {
    const Measurement m = RandomMeasurement(random);
    rig.max_range_m = i % 4 == 1 ? random.Uniform(0.3, 0.6) : 1.5;
    PointLimits depth;
    if (i % 4 == 2) depth = {.min_m = m.camera_distance_m, .max_m = m.camera_distance_m + 0.01};
    if (i % 4 == 3) {
      depth.max_depth_times_distance_m2 =
          random.Uniform(0.9, 1.1) * std::pow(m.camera_distance_m, 2);
    }
    const ScanInPart scan = MakeScanInPart(rig, part.BoundingBox().center(), m, depth);
    FastScan a, b;
    by_place.Evaluate({&scan, 1}, {&a, 1}, false, nullptr);
    by_chance.Evaluate({&scan, 1}, {&b, 1}, false, nullptr);
    for (size_t t = 0; t < count; ++t) {
      ASSERT_EQ(a.covered.Test(order[t]), b.covered.Test(t)) << "scan " << i << ", target " << t;
    }
    covered += a.covered.Count();
    scans_with_all += a.covered.Count() == static_cast<int64_t>(count);
  }
  EXPECT_GT(covered, 400);
  EXPECT_EQ(scans_with_all, 0);
}

// Leaving out clusters that the direction before did not see must not lose visible ones for good.
TEST(VisibilityFieldBytes, CoherentOcclusionChangesHardlyAnything) {
  const FieldInput input;
  const std::string coherent = input.Bytes(2, true), plain = input.Bytes(2, false);
  ASSERT_EQ(coherent.size(), plain.size());
  int64_t different = 0, set = 0;
  for (size_t i = 0; i < plain.size(); ++i) {
    different += std::popcount(static_cast<uint8_t>(coherent[i] ^ plain[i]));
    set += std::popcount(static_cast<uint8_t>(plain[i]));
  }
  std::printf("coherent occlusion: %ld of %ld bits differ\n", different, set);
  EXPECT_GT(set, 100000);
  EXPECT_LE(static_cast<double>(different), 0.001 * static_cast<double>(set));
}

TEST(VisibilityFieldBytes, CancelledBuildSaysSo) {
  const FieldInput input;
  const std::atomic<bool> cancelled = true;
  FieldBuildOptions options;
  options.directions = 4096;
  options.cancelled = &cancelled;
  EXPECT_EQ(
      BuildVisibilityField(input.part, {}, input.targets, input.probes, options).status().code(),
      absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace sightline
