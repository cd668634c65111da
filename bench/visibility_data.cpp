// SPDX-License-Identifier: Apache-2.0
// Time and memory of a scene's visibility data by rasterization, and how both grow with triangles
// and targets; next to the same field from Embree rays.
#include <meshoptimizer.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "bench/common/embree_coverage.h"
#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "core/targets/poisson_disk.h"
#include "coverage_server/measurability/measurability.h"
#include "coverage_server/scan/fast_evaluator.h"
#include "coverage_server/scan/target_lookup.h"
#include "coverage_server/visibility/surface_probes.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline::bench {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

TriangleMesh Simplified(const TriangleMesh& mesh, size_t triangles) {
  std::vector<uint32_t> indices;
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  std::vector<uint32_t> simplified(indices.size());
  simplified.resize(meshopt_simplify(simplified.data(), indices.data(), indices.size(),
                                     mesh.positions_m[0].data(), mesh.positions_m.size(), 12,
                                     3 * triangles, 1, 0, nullptr));
  TriangleMesh result;
  result.positions_m = mesh.positions_m;
  for (size_t i = 0; i < simplified.size(); i += 3) {
    result.triangles.push_back({simplified[i], simplified[i + 1], simplified[i + 2]});
  }
  return result;
}

// Splits edges longer than a limit at their middle until there are enough triangles. Both sides of
// an edge split alike, so the mesh stays closed.
TriangleMesh Subdivided(TriangleMesh mesh, size_t triangles) {
  double limit_m = mesh.BoundingBox().sizes().norm();
  while (mesh.triangles.size() < triangles) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) -> int64_t {
      if ((mesh.positions_m[a] - mesh.positions_m[b]).norm() <= limit_m) return -1;
      const auto [entry, added] =
          middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(mesh.positions_m.size()));
      if (added) mesh.positions_m.push_back(0.5f * (mesh.positions_m[a] + mesh.positions_m[b]));
      return entry->second;
    };
    std::vector<std::array<uint32_t, 3>> split;
    for (const auto& t : mesh.triangles) {
      int64_t m[3];
      int splits = 0;
      for (int k = 0; k < 3; ++k) splits += (m[k] = middle(t[k], t[(k + 1) % 3])) >= 0;
      const auto add = [&](int64_t a, int64_t b, int64_t c) {
        split.push_back(
            {static_cast<uint32_t>(a), static_cast<uint32_t>(b), static_cast<uint32_t>(c)});
      };
      if (splits == 3) {
        add(t[0], m[0], m[2]), add(t[1], m[1], m[0]), add(t[2], m[2], m[1]), add(m[0], m[1], m[2]);
        continue;
      }
      if (splits == 0) {
        split.push_back(t);
        continue;
      }
      // Turned so that the first edge is split, and with two the second as well.
      int k = 0;
      while (m[k] < 0 || (splits == 2 && m[(k + 1) % 3] < 0)) ++k;
      const uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
      if (splits == 1) {
        add(a, m[k], c), add(m[k], b, c);
      } else {
        const int64_t n = m[(k + 1) % 3];
        add(m[k], b, n), add(a, m[k], n), add(a, n, c);
      }
    }
    mesh.triangles = std::move(split);
    limit_m *= 0.97;
  }
  return mesh;
}

// A smooth field of small shifts: no flat regions are left that simplification could merge, as on a
// scanned or sculpted part.
void MakeWavy(TriangleMesh& mesh) {
  constexpr float kAmplitudeM = 2.5e-4f, kWaveNumber = 2 * std::numbers::pi_v<float> / 4e-3f;
  for (Eigen::Vector3f& p : mesh.positions_m) {
    const Eigen::Vector3f q = kWaveNumber * p;
    p += kAmplitudeM * Eigen::Vector3f(std::sin(q.y() + 0.7f) + std::sin(q.z()),
                                       std::sin(q.z() + 1.3f) + std::sin(q.x()),
                                       std::sin(q.x() + 2.1f) + std::sin(q.y()));
  }
}

// The field's bits for every `stride`-th cell from rays, a probe at a time. Returns the fraction of
// bits above the horizon that differ from `field`.
double EmbreeField(const EmbreeMesh& mesh, const TargetSet& targets, const SurfaceProbes& probes,
                   const VisibilityField& field, int stride, int threads, double* seconds,
                   double* cpu_seconds) {
  constexpr float kAbove = 0.05f, kLiftM = 5e-5f, kFarM = 10;
  const OctahedralMap& map = field.map();
  const size_t cells = static_cast<size_t>(map.cells() / stride);
  std::vector<std::vector<uint8_t>> bits(cells, std::vector<uint8_t>(targets.size()));
  const double cpu = OwnCpuSeconds();
  const Stopwatch watch;
  ParallelFor(threads, cells, [&](size_t i) {
    const Eigen::Vector3f d = map.Direction(static_cast<int>(i) * stride);
    alignas(32) RTCRay8 rays;
    alignas(32) int active[8];
    for (size_t t = 0; t < targets.size(); ++t) {
      if (targets.normals[t].dot(d) < kAbove) continue;
      for (int k = 0; k < kProbesPerTarget; ++k) {
        const size_t probe = t * kProbesPerTarget + k;
        const Eigen::Vector3f p = probes.positions_m[probe] + kLiftM * probes.normals[probe];
        active[k] = -1;
        rays.org_x[k] = p.x(), rays.org_y[k] = p.y(), rays.org_z[k] = p.z();
        rays.dir_x[k] = d.x(), rays.dir_y[k] = d.y(), rays.dir_z[k] = d.z();
        rays.tnear[k] = 0, rays.tfar[k] = kFarM, rays.time[k] = 0;
        rays.mask[k] = 0xffffffff, rays.flags[k] = 0;
      }
      mesh.Occluded(active, rays);
      for (int k = 0; k < kProbesPerTarget; ++k) {
        if (rays.tfar[k] > 0) bits[i][t] |= static_cast<uint8_t>(1 << k);
      }
    }
  });
  *seconds = watch.Seconds();
  *cpu_seconds = OwnCpuSeconds() - cpu;
  int64_t different = 0, all = 0;
  for (size_t i = 0; i < cells; ++i) {
    const int cell = static_cast<int>(i) * stride;
    for (size_t t = 0; t < targets.size(); ++t) {
      if (targets.normals[t].dot(map.Direction(cell)) < kAbove) continue;
      all += kProbesPerTarget;
      different += std::popcount(static_cast<uint8_t>(field.Probes(t, cell) ^ bits[i][t]));
    }
  }
  return static_cast<double>(different) / static_cast<double>(all);
}

struct Case {
  size_t triangles;
  int targets;
  bool wavy;
};

// Builds what a coverage scene builds, phase by phase.
Json Measure(const Case& c, int embree_stride) {
  const std::unique_ptr<TriangleMesh> head = LoadBenchPart("head");
  TriangleMesh mesh = *head;
  if (c.triangles < head->triangles.size() * 9 / 10) {
    mesh = Simplified(*head, c.triangles);
  } else if (c.triangles > head->triangles.size() * 11 / 10) {
    mesh = Subdivided(*head, c.triangles);
  }
  if (c.wavy) MakeWavy(mesh);
  TargetSampling sampling;
  sampling.spacing_m = SpacingForTargets(*head, c.targets);
  const double rss_before = PeakRssMiB();

  const Stopwatch all;
  Stopwatch phase;
  const auto targets = SampleTargets(mesh, sampling);
  if (!targets.ok()) Fail("targets", std::string(targets.status().message()));
  const double targets_s = phase.Seconds();
  phase = {};
  std::vector<Occluder> occluders;
  occluders.push_back({ObstacleFrame::kPart, TriangleBvh(mesh)});
  const double bvh_s = phase.Seconds();
  phase = {};
  const SurfaceProbes probes = MakeSurfaceProbes(mesh, occluders[0].bvh, *targets, sampling);
  const double probes_s = phase.Seconds();
  phase = {};
  const double cpu = OwnCpuSeconds() + ChildCpuSeconds();
  const auto field = BuildVisibilityField(mesh, {}, *targets, probes, {});
  if (!field.ok()) Fail("field", std::string(field.status().message()));
  const double field_s = phase.Seconds();
  const double field_cpu_s = OwnCpuSeconds() + ChildCpuSeconds() - cpu;
  phase = {};
  const FastEvaluator fast(*targets, sampling, probes, **field);
  const TargetLookup lookup(*targets, sampling);
  const double tables_s = phase.Seconds();
  phase = {};
  TargetBits measurable(targets->size());
  const size_t half = targets->size() / 2 / kTargetsPerBlock * kTargetsPerBlock;
  ParallelFor(2, 2, [&](size_t i) {
    MarkMeasurable(*targets, **field, occluders, {10 * kDeg, 80 * kDeg}, i == 0 ? 0 : half,
                   i == 0 ? half : targets->size(), measurable);
  });
  const double measurability_s = phase.Seconds();
  const double total_s = all.Seconds();
  const double rss = PeakRssMiB(), worker_rss = PeakChildRssMiB();

  phase = {};
  const EmbreeMesh embree(mesh, 2);
  const double embree_bvh_s = phase.Seconds();
  double sampled_s = 0, sampled_cpu_s = 0;
  const double differing =
      EmbreeField(embree, *targets, probes, **field, embree_stride, 2, &sampled_s, &sampled_cpu_s);
  const double embree_field_s = sampled_s * embree_stride;
  const double embree_field_cpu_s = sampled_cpu_s * embree_stride;
  return {{"triangles", mesh.triangles.size()},
          {"wavy", c.wavy},
          {"targets", targets->size()},
          {"measurable", measurable.Count()},
          {"directions", (*field)->map().cells()},
          {"targets_s", targets_s},
          {"bvh_s", bvh_s},
          {"probes_s", probes_s},
          {"field_s", field_s},
          {"field_cpu_s", field_cpu_s},
          {"tables_s", tables_s},
          {"measurability_s", measurability_s},
          {"total_s", total_s},
          {"field_bytes", (*field)->bytes()},
          {"lookup_bytes", lookup.bytes()},
          {"rss_before_mib", rss_before},
          {"peak_rss_mib", rss},
          {"peak_worker_rss_mib", worker_rss},
          {"embree_bvh_s", embree_bvh_s},
          {"embree_field_s", embree_field_s},
          {"embree_field_cpu_s", embree_field_cpu_s},
          {"embree_field_measured_fraction", 1.0 / embree_stride},
          {"bits_that_differ_from_embree", differing}};
}

// In a process of its own, so that peak memory is that of one case.
Json MeasureApart(const Case& c, int embree_stride) {
  int out[2];
  if (pipe(out) != 0) Fail("visibility_data", "no pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    close(out[0]);
    const std::string text = Measure(c, embree_stride).dump();
    const bool written = write(out[1], text.data(), text.size()) == std::ssize(text);
    _exit(written ? 0 : 1);
  }
  close(out[1]);
  std::string text;
  char buffer[4096];
  ssize_t got;
  while ((got = read(out[0], buffer, sizeof(buffer))) > 0) text.append(buffer, got);
  close(out[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0 || text.empty()) Fail("visibility_data", "a case ended with an error");
  return Json::parse(text);
}

int Run(const std::vector<size_t>& triangles, const std::vector<int>& targets, int embree_stride,
        const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  std::printf(
      "Seconds. field: rendered by 2 processes; total: all phases, as a coverage scene does them. "
      "Embree: the same field by rays, 2 threads, 1/%d of the directions measured and scaled; "
      "ratios are Embree / field. bits: raster against rays, above the horizon.\n\n",
      embree_stride);
  std::printf(
      "%-13s %8s %7s %5s %6s %7s %6s %7s %7s | %7s %6s | %9s %10s %6s | %8s %8s %10s | %6s\n",
      "triangles", "targets", "sampl.", "BVH", "probes", "field", "tables", "measbl.", "total",
      "Embree", "ratio", "field CPU", "Embree CPU", "ratio", "field MB", "peak MiB", "worker MiB",
      "bits");
  Json results = Json::array();
  std::vector<Case> cases;
  for (const int t : targets) {
    for (const size_t n : triangles) {
      cases.push_back({n, t, false});
      if (n > 110000) cases.push_back({n, t, true});
    }
  }
  for (const Case& c : cases) {
    const Json r = MeasureApart(c, embree_stride);
    const auto v = [&](const char* key) { return r[key].get<double>(); };
    const std::string label =
        std::to_string(r["triangles"].get<size_t>()) + (c.wavy ? " wavy" : "");
    std::printf(
        "%-13s %8.0f %7.2f %5.2f %6.2f %7.2f %6.2f %7.2f %7.2f | %7.1f %5.1fx | %9.1f %10.1f "
        "%5.1fx | %8.0f %8.0f %10.0f | %5.2f%%\n",
        label.c_str(), v("targets"), v("targets_s"), v("bvh_s"), v("probes_s"), v("field_s"),
        v("tables_s"), v("measurability_s"), v("total_s"), v("embree_field_s"),
        v("embree_field_s") / v("field_s"), v("field_cpu_s"), v("embree_field_cpu_s"),
        v("embree_field_cpu_s") / v("field_cpu_s"), v("field_bytes") / 1e6, v("peak_rss_mib"),
        v("peak_worker_rss_mib"), 100 * v("bits_that_differ_from_embree"));
    std::fflush(stdout);
    results.push_back(r);
  }
  WriteResults(json, "visibility_data", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Time and memory of visibility data");
  std::vector<size_t> triangles = {20000, 100000, 500000, 2000000};
  std::vector<int> targets = {20000, 200000};
  int embree_stride = 64;
  std::string json;
  app.add_option("--triangles", triangles)->delimiter(',');
  app.add_option("--targets", targets)->delimiter(',');
  app.add_option("--embree-stride", embree_stride, "every how manieth direction gets rays");
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(triangles, targets, embree_stride, json);
}
