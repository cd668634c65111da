// SPDX-License-Identifier: Apache-2.0
// Virtual parts whose truth is known, scanned and judged as `sightline inspect` does: how often is
// a part accepted or rejected wrongly, and how often does the stated interval hold the true value?
//
// One part is drawn as follows. Every toleranced feature gets a deviation of its own kind (a dent,
// a shift, another size) and a true value within its zone; in half of the parts one feature gets a
// value beyond it, by 1 to 5 expanded uncertainties U. Each scan draws its own calibration errors
// of camera and laser, all scans of a part share those of the lens, every point has noise of line
// detection, and the part is moved and turned in its holder. Points are triangulated with the
// nominal set-up. Registration, surface, values and decisions are those of the product.
//
// Points are spread evenly over the faces that camera and laser see: there is no occlusion.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "bench/common/measure.h"
#include "core/conformance/measured_value.h"
#include "core/part/load_part.h"
#include "core/random/counter_random.h"
#include "core/rig/scan_geometry.h"
#include "core/targets/poisson_disk.h"
#include "core/triangulation/triangulation.h"
#include "planner_client/inspect/judge_measured.h"
#include "planning/requirements/characteristic_of.h"

namespace sightline::bench {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kPointSpacing_m = 0.7e-3;
constexpr double kLargestIncidence_rad = 75 * kDegree;
constexpr double kNoisePx = 0.1;
constexpr double kDentWidth_m = 5e-3;  // standard deviation of its bell

enum class DefectShape { kDent, kShift, kSize };

// A toleranced region with the deviation that its defects have.
struct VirtualFeature {
  std::string name;
  ToleranceKind kind;
  DefectShape shape;
  double zone_m;
  Eigen::AlignedBox3d box_m;
};

struct VirtualModel {
  std::string name;
  TriangleMesh mesh;
  std::vector<VirtualFeature> features;
};

void AddQuad(TriangleMesh& mesh, const std::array<Vector3d, 4>& corners) {
  const auto first = static_cast<uint32_t>(mesh.positions_m.size());
  for (const Vector3d& corner : corners) mesh.positions_m.push_back(corner.cast<float>());
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

void AddBox(TriangleMesh& mesh, const Vector3d& low, const Vector3d& high) {
  const auto at = [&](int i) {
    return Vector3d(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                    i & 4 ? high.z() : low.z());
  };
  for (const auto& q : {std::array{0, 2, 3, 1}, std::array{4, 5, 7, 6}, std::array{0, 1, 5, 4},
                        std::array{2, 6, 7, 3}, std::array{0, 4, 6, 2}, std::array{1, 3, 7, 5}}) {
    AddQuad(mesh, {at(q[0]), at(q[1]), at(q[2]), at(q[3])});
  }
}

// Two boxes, one on the other: 80 x 60 x 50 mm.
VirtualModel MakeStep() {
  VirtualModel model;
  model.name = "step of two boxes";
  AddBox(model.mesh, {0, 0, 0}, {0.08, 0.06, 0.03});
  AddBox(model.mesh, {0, 0, 0.03}, {0.03, 0.045, 0.05});
  model.features = {
      {"large top",
       ToleranceKind::kSurfaceProfile,
       DefectShape::kDent,
       3e-4,
       {Vector3d(0.034, 0.004, 0.0299), Vector3d(0.076, 0.056, 0.0301)}},
      {"small top",
       ToleranceKind::kFlatness,
       DefectShape::kDent,
       1.5e-4,
       {Vector3d(0.003, 0.003, 0.0499), Vector3d(0.027, 0.042, 0.0501)}},
      {"end face",
       ToleranceKind::kPosition,
       DefectShape::kShift,
       1.2e-4,
       {Vector3d(0.0799, 0.003, 0.003), Vector3d(0.0801, 0.057, 0.027)}},
  };
  return model;
}

// A plate of 80 x 80 x 12 mm with a bore of 40 mm.
VirtualModel MakePlate() {
  constexpr int kFacets = 192;
  constexpr double kHalf = 0.04, kRadius = 0.02, kHeight = 0.012;
  VirtualModel model;
  model.name = "plate with a bore";
  const auto round = [](int i, double z) {
    const double a = 2 * std::numbers::pi * i / kFacets;
    return Vector3d(kRadius * std::cos(a), kRadius * std::sin(a), z);
  };
  const auto square = [](int i, double z) {
    const double a = 2 * std::numbers::pi * i / kFacets;
    const double r = kHalf / std::max(std::abs(std::cos(a)), std::abs(std::sin(a)));
    return Vector3d(r * std::cos(a), r * std::sin(a), z);
  };
  for (int i = 0; i < kFacets; ++i) {
    AddQuad(model.mesh,
            {round(i, kHeight), square(i, kHeight), square(i + 1, kHeight), round(i + 1, kHeight)});
    AddQuad(model.mesh, {round(i, 0), round(i + 1, 0), square(i + 1, 0), square(i, 0)});
    AddQuad(model.mesh,
            {square(i, 0), square(i + 1, 0), square(i + 1, kHeight), square(i, kHeight)});
    AddQuad(model.mesh, {round(i, 0), round(i, kHeight), round(i + 1, kHeight), round(i + 1, 0)});
  }
  const Eigen::AlignedBox3d wall(Vector3d(-0.021, -0.021, 0.001), Vector3d(0.021, 0.021, 0.011));
  model.features = {
      {"top",
       ToleranceKind::kSurfaceProfile,
       DefectShape::kDent,
       3e-4,
       {Vector3d(-0.038, -0.038, 0.0119), Vector3d(0.038, -0.022, 0.0121)}},
      {"bore, place", ToleranceKind::kPosition, DefectShape::kShift, 1e-4, wall},
      {"bore, diameter", ToleranceKind::kLinearSize, DefectShape::kSize, 1e-4, wall},
  };
  return model;
}

Rig MakeRig() {
  Rig rig;
  rig.camera.columns_px = rig.camera.rows_px = 640;
  rig.camera.vertical_fov_rad = 22 * kDegree;
  return rig;
}

std::vector<Measurement> MakeScans() {
  std::vector<Measurement> scans;
  for (int i = 0; i < 4; ++i) {
    Measurement scan;
    scan.camera_distance_m = 0.4;
    scan.triangulation_angle_rad = 0.5;
    scan.part_gamma_rad = 0.5 * std::numbers::pi * i;
    scan.camera_polar_rad = 0.8;
    scans.push_back(scan);
  }
  return scans;
}

// Standard deviations that a careful calibration leaves.
TriangulationErrors CalibrationDeviations() {
  TriangulationErrors s = TriangulationErrors::Zero();
  s.segment<3>(kCameraAlpha).setConstant(2e-5);
  s.segment<3>(kCameraX).setConstant(8e-6);
  s[kSheetTiltX] = s[kSheetTiltZ] = 2e-5;
  s[kSheetOffset] = 8e-6;
  s.tail<3>() << 0.2, 0.1, 0.1;  // focal length and principal point [px]: those of the lens
  return s;
}

Inspection MakeInspection(const VirtualModel& model, bool calibration) {
  Inspection inspection;
  inspection.name = model.name;
  inspection.rig = MakeRig();
  inspection.targets.spacing_m = 0.003;
  inspection.uncertainty.emplace();
  inspection.uncertainty->detection.standard_deviations_px = {kNoisePx};
  inspection.uncertainty->prior_standard_deviation_m = 1e-3;
  inspection.uncertainty->resolution_m = 0.003;
  if (calibration) {
    inspection.uncertainty->calibration = CalibrationDeviations().cwiseAbs2().asDiagonal();
  }
  inspection.tolerances.emplace();
  for (const VirtualFeature& feature : model.features) {
    TolerancedRegion region;
    region.name = feature.name;
    region.zone_width_m = feature.zone_m;
    region.box_m = feature.box_m;
    inspection.tolerances->regions.push_back(region);
  }
  return inspection;
}

// The drawn deviation of one feature: its shape times an amplitude.
struct Deviation {
  const VirtualFeature* feature = nullptr;
  Vector3d dent_m = Vector3d::Zero();
  Vector3d along = Vector3d::UnitX();
  double sign = 1;
  double amplitude_m = 0;

  double At(const Vector3d& p, const Vector3d& n) const {
    if (!feature->box_m.contains(p)) return 0;
    switch (feature->shape) {
      case DefectShape::kDent: {
        const double r = (p - dent_m).norm() / kDentWidth_m;
        return sign * amplitude_m * std::exp(-0.5 * r * r);
      }
      case DefectShape::kShift:
        return sign * amplitude_m * n.dot(along);
      case DefectShape::kSize:
        return sign * amplitude_m;
    }
    return 0;
  }
};

struct VirtualPart {
  std::vector<Deviation> deviations;
  std::vector<double> true_values_m;  // deviations from the nominal size for sizes
  int defective = -1;

  double At(const Vector3d& p, const Vector3d& n) const {
    double sum = 0;
    for (const Deviation& deviation : deviations) sum += deviation.At(p, n);
    return sum;
  }
};

// The inputs that all parts of a model share.
struct Bench {
  VirtualModel model;
  Inspection inspection;
  Requirements requirements;
  TargetSet targets;
  std::vector<Measurement> scans = MakeScans();
  std::vector<std::string> files;
  std::vector<double> expanded_m;  // typical U of every feature
  bool verbose = false;
};

// Value of a feature whose deviations at its targets are known without error.
MeasuredValue TrueValue(const Bench& bench, size_t f, const VirtualPart& part) {
  const TolerancedFeature& toleranced = bench.requirements.features[f];
  const auto bound =
      BindCharacteristic(toleranced, bench.requirements, bench.targets, kMostDenseTargets);
  if (!bound.ok()) Fail("virtual_parts", std::string(bound.status().message()));
  Feature feature;
  Eigen::VectorXd h(static_cast<Eigen::Index>(bound->targets.size()));
  for (const uint32_t t : bound->targets) {
    FeatureTarget target;
    target.position_m = bench.targets.positions_m[t].cast<double>();
    target.normal = bench.targets.normals[t].cast<double>().normalized();
    target.uncertainty = {1e-9, 1e-9, 0, 0};
    h[static_cast<Eigen::Index>(feature.targets.size())] =
        part.At(target.position_m, target.normal);
    feature.targets.push_back(target);
  }
  const auto fit = FitCharacteristic(feature, bound->characteristic);
  if (!fit.ok()) Fail("virtual_parts", std::string(fit.status().message()));
  const auto value = EvaluateMeasured(feature, *fit, h, {.width_m = toleranced.zone_width_m});
  if (!value.ok()) Fail("virtual_parts", std::string(value.status().message()));
  return *value;
}

double NominalSize(const Bench& bench, size_t f) {
  if (bench.model.features[f].shape != DefectShape::kSize) return 0;
  VirtualPart none;
  return TrueValue(bench, f, none).value_m;
}

// Largest value that conforms: sizes may differ by half the zone to either side.
double LimitOf(const VirtualFeature& feature) {
  return feature.shape == DefectShape::kSize ? 0.5 * feature.zone_m : feature.zone_m;
}

VirtualPart DrawPart(const Bench& bench, bool defective, bool at_limit, CounterRandom& random) {
  VirtualPart part;
  const size_t count = bench.model.features.size();
  if (defective) part.defective = static_cast<int>(random.Uniform() * static_cast<double>(count));
  for (size_t f = 0; f < count; ++f) {
    const VirtualFeature& feature = bench.model.features[f];
    Deviation deviation;
    deviation.feature = &feature;
    const Vector3d side = feature.box_m.sizes();
    deviation.dent_m =
        feature.box_m.min() + Vector3d(side.x() * random.Uniform(), side.y() * random.Uniform(),
                                       side.z() * random.Uniform());
    const double angle = 2 * std::numbers::pi * random.Uniform();
    if (side.x() > 1e-3 && side.y() > 1e-3 && feature.shape == DefectShape::kShift) {
      deviation.along = {std::cos(angle), std::sin(angle), 0};
    }
    deviation.sign = random.Uniform() < 0.5 ? -1 : 1;
    const double limit_m = LimitOf(feature);
    double value_m = limit_m * random.Uniform();
    if (at_limit) value_m = limit_m;
    if (static_cast<int>(f) == part.defective) {
      value_m = limit_m + (1 + 4 * random.Uniform()) * bench.expanded_m[f];
    }
    // Values are proportional to amplitudes.
    deviation.amplitude_m = 1e-4;
    VirtualPart alone;
    alone.deviations = {deviation};
    const double unit_m = std::abs(TrueValue(bench, f, alone).value_m - NominalSize(bench, f));
    deviation.amplitude_m *= value_m / unit_m;
    part.deviations.push_back(deviation);
    part.true_values_m.push_back(value_m);
  }
  // Features share surfaces: the bore's size moves no axis, but its facets are evaluated together.
  for (size_t f = 0; f < count; ++f) {
    part.true_values_m[f] = TrueValue(bench, f, part).value_m;
  }
  return part;
}

Vector3d PointOnTriangle(const TriangleMesh& mesh, size_t t, CounterRandom& random) {
  double u = random.Uniform(), v = random.Uniform();
  if (u + v > 1) u = 1 - u, v = 1 - v;
  const Vector3d a = mesh.Corner(t, 0);
  return a + u * (mesh.Corner(t, 1) - a) + v * (mesh.Corner(t, 2) - a);
}

// Points of one scan, triangulated with the nominal set-up from images of the true one.
void WriteScan(const Bench& bench, const VirtualPart& part, size_t s,
               const TriangulationErrors& errors, const Eigen::Isometry3d& pose,
               CounterRandom& random) {
  const TriangleMesh& mesh = bench.model.mesh;
  const Rig& rig = bench.inspection.rig;
  const ScanGeometry geometry = MakeScanGeometry(rig, bench.scans[s]);
  const Vector3d centre_m = mesh.BoundingBox().center();
  std::vector<Eigen::Vector3f> positions, normals;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3d n = mesh.Normal(t);
    const double expected = mesh.Area(t) / (kPointSpacing_m * kPointSpacing_m);
    const int count = static_cast<int>(expected + random.Uniform());
    for (int i = 0; i < count; ++i) {
      const Vector3d p = PointOnTriangle(mesh, t, random);
      const Vector3d x = p + part.At(p, n) * n;
      const double stage_m = geometry.LitStagePosition(PartToWorld(geometry, centre_m, x, 0));
      const TriangulationSetup setup = MakeTriangulationSetup(
          rig.camera, WorldToPart(geometry, centre_m, geometry.camera, stage_m),
          WorldToPart(geometry, centre_m, geometry.laser, stage_m));
      const auto faces = [&](const Vector3d& origin_m) {
        return n.dot((origin_m - x).normalized()) > std::cos(kLargestIncidence_rad);
      };
      if (!faces(setup.camera.origin_m) || !faces(setup.laser.origin_m)) continue;
      Eigen::Vector2d px = ProjectPoint(setup, x);
      if (px.minCoeff() < 0 || px.x() > rig.camera.columns_px || px.y() > rig.camera.rows_px) {
        continue;
      }
      px += kNoisePx * Eigen::Vector2d(random.Normal(), random.Normal());
      const Vector3d measured = pose * Triangulate(setup, px, errors);
      if (!measured.allFinite()) continue;
      positions.push_back(measured.cast<float>());
      normals.push_back((pose.rotation() * n).cast<float>());
    }
  }
  if (absl::Status status = WritePlyPoints(bench.files[s], positions, normals); !status.ok()) {
    Fail("virtual_parts", std::string(status.message()));
  }
}

// How far the registration is from the drawn pose, with its standard deviations.
void PrintPose(const PartPose& drawn, const MeasuredPart& part) {
  const PoseVector off = part.registration.pose.parameters - drawn.parameters;
  const PoseVector deviation = part.registration.covariance.diagonal().cwiseSqrt();
  std::printf("  pose off by");
  for (int i = 0; i < 6; ++i) {
    const double unit = i < 3 ? 1 / kDegree : 1e3;
    std::printf(" %.4f (%.4f)", unit * off[i], unit * deviation[i]);
  }
  std::printf(" deg, mm\n");
  for (const MeasuredPart::PointCounts& counts : part.counts) {
    std::printf("  %lld points, %lld off the model, %lld outliers\n",
                static_cast<long long>(counts.read), static_cast<long long>(counts.off_model),
                static_cast<long long>(counts.among_neighbours));
  }
}

// Unset: the registration refuses the points by name.
std::optional<v1::InspectionResult> MeasureAndJudge(const Bench& bench, const VirtualPart& part,
                                                    bool calibration, CounterRandom& random) {
  PartPose pose;
  pose.centre_m = bench.model.mesh.BoundingBox().center();
  for (int i = 0; i < 3; ++i) {
    pose.parameters[i] = 0.3 * kDegree * random.Normal();
    pose.parameters[3 + i] = 5e-4 * random.Normal();
  }
  const TriangulationErrors deviations = CalibrationDeviations();
  TriangulationErrors lens = TriangulationErrors::Zero();
  if (calibration) {
    for (int i = kFocalLengthError; i <= kPrincipalY; ++i)
      lens[i] = deviations[i] * random.Normal();
  }
  std::vector<MeasuredFile> files;
  for (size_t s = 0; s < bench.scans.size(); ++s) {
    TriangulationErrors errors = lens;
    for (int i = kCameraAlpha; calibration && i < kFocalLengthError; ++i) {
      errors[i] = deviations[i] * random.Normal();
    }
    WriteScan(bench, part, s, errors, Eigen::Isometry3d(pose.Matrix().matrix()), random);
    files.push_back({bench.files[s], static_cast<int>(s)});
  }
  const auto found = FindMeasuredPart(bench.model.mesh, bench.inspection, files, bench.scans, {});
  if (!found.ok()) {
    std::printf("refused: %s\n", std::string(found.status().message()).c_str());
    return std::nullopt;
  }
  if (bench.verbose) PrintPose(pose, *found);
  const auto surface = EstimateSurface(bench.model.mesh, bench.inspection, *found);
  if (!surface.ok()) Fail("virtual_parts", std::string(surface.status().message()));
  return JudgeMeasured(bench.inspection, bench.requirements, *found, bench.scans, *surface).result;
}

// Decisions and intervals of one kind of feature.
struct Tally {
  int conforming = 0, defective = 0, wrongly_rejected = 0, wrongly_accepted = 0;
  int accepted_good = 0, rejected_defects = 0, undecided = 0, evaluated = 0, held = 0;

  void Add(const v1::InspectedFeature& feature, double truth_m, bool conforms) {
    ++(conforms ? conforming : defective);
    if (!feature.has_value_m()) return;
    ++evaluated;
    held += truth_m >= feature.interval_lower_m() && truth_m <= feature.interval_upper_m();
    const bool accepted = feature.decision() == v1::InspectedFeature::CONFORMS;
    const bool rejected = feature.decision() == v1::InspectedFeature::DOES_NOT_CONFORM;
    undecided += !accepted && !rejected;
    wrongly_rejected += conforms && rejected;
    wrongly_accepted += !conforms && accepted;
    accepted_good += conforms && accepted;
    rejected_defects += !conforms && rejected;
  }
  Json ToJson() const {
    return {{"conforming", conforming},
            {"wrongly_rejected", wrongly_rejected},
            {"accepted", accepted_good},
            {"defective", defective},
            {"wrongly_accepted", wrongly_accepted},
            {"rejected", rejected_defects},
            {"undecided", undecided},
            {"evaluated", evaluated},
            {"interval_holds", evaluated > 0 ? static_cast<double>(held) / evaluated : 0.0}};
  }
  void Print(const std::string& name) const {
    std::printf("%-34s %5d %9d %9d %7d %9d %9d %10d %8.1f %%\n", name.c_str(), conforming,
                accepted_good, wrongly_rejected, defective, rejected_defects, wrongly_accepted,
                undecided, evaluated > 0 ? 100.0 * held / evaluated : 0.0);
  }
};

struct Options {
  int parts = 20;
  uint64_t seed = 1;
  double zone_in_u = 8;
  bool calibration = true, at_limit = false, verbose = false;
};

Bench MakeBench(VirtualModel model, const Options& options, const std::string& folder) {
  Bench bench;
  bench.model = std::move(model);
  bench.verbose = options.verbose;
  bench.inspection = MakeInspection(bench.model, options.calibration);
  auto requirements = MakeRequirements(bench.inspection, bench.model.mesh, std::nullopt, {});
  if (!requirements.ok()) Fail("virtual_parts", std::string(requirements.status().message()));
  bench.requirements = *std::move(requirements);
  for (size_t f = 0; f < bench.model.features.size(); ++f) {
    bench.requirements.features[f].kind = bench.model.features[f].kind;
  }
  auto targets = SampleTargets(bench.model.mesh, bench.inspection.targets);
  if (!targets.ok()) Fail("virtual_parts", std::string(targets.status().message()));
  bench.targets = *std::move(targets);
  for (size_t s = 0; s < bench.scans.size(); ++s) {
    bench.files.push_back(absl::StrCat(folder, "/scan_0", s + 1, ".ply"));
  }
  // Typical U: of a part without deviations.
  CounterRandom random(options.seed, 1'000'000);
  VirtualPart none;
  const auto result = MeasureAndJudge(bench, none, options.calibration, random);
  if (!result) Fail("virtual_parts", "a part without deviations is refused");
  for (const v1::InspectedFeature& feature : result->features()) {
    if (options.verbose)
      std::printf("  %s: %s\n", feature.name().c_str(), feature.because().c_str());
    bench.expanded_m.push_back(feature.expanded_uncertainty_m());
  }
  return bench;
}

// Zones of `options.zone_in_u` typical U, by a first look with those of the model.
void SetZones(const Options& options, const std::string& folder, VirtualModel* model) {
  const Bench first = MakeBench(*model, options, folder);
  for (size_t f = 0; f < model->features.size(); ++f) {
    model->features[f].zone_m = options.zone_in_u * first.expanded_m[f];
  }
}

Json RunModel(VirtualModel model, const Options& options, const std::string& folder) {
  if (options.zone_in_u > 0) SetZones(options, folder, &model);
  const Bench bench = MakeBench(std::move(model), options, folder);
  std::vector<Tally> tallies(bench.model.features.size());
  for (int p = 0; p < options.parts; ++p) {
    CounterRandom random(options.seed, static_cast<uint64_t>(p));
    const VirtualPart part =
        DrawPart(bench, p % 2 == 1 && !options.at_limit, options.at_limit, random);
    const auto result = MeasureAndJudge(bench, part, options.calibration, random);
    if (!result) continue;
    for (size_t f = 0; f < tallies.size(); ++f) {
      const v1::InspectedFeature& feature = result->features(static_cast<int>(f));
      const double truth_m = part.true_values_m[f];
      const double off_m = std::abs(truth_m - NominalSize(bench, f));
      const bool conforms = off_m <= LimitOf(bench.model.features[f]) * (1 + 1e-9);
      tallies[f].Add(feature, truth_m, conforms);
      if (options.verbose) {
        std::printf("  part %d %s: truth %.4f mm, value %.4f, interval %.4f to %.4f, U %.4f: %s\n",
                    p, feature.name().c_str(), 1e3 * truth_m, 1e3 * feature.value_m(),
                    1e3 * feature.interval_lower_m(), 1e3 * feature.interval_upper_m(),
                    1e3 * feature.expanded_uncertainty_m(), feature.because().c_str());
      }
    }
  }
  Json results;
  for (size_t f = 0; f < tallies.size(); ++f) {
    const std::string name = absl::StrCat(bench.model.name, ": ", bench.model.features[f].name);
    tallies[f].Print(name);
    Json row = tallies[f].ToJson();
    row["feature"] = name;
    row["zone_m"] = bench.model.features[f].zone_m;
    row["expanded_uncertainty_m"] = bench.expanded_m[f];
    results.push_back(row);
  }
  return results;
}

int Run(int argc, char** argv) {
  CLI::App app("Wrong verdicts and coverage of intervals on virtual parts");
  Options options;
  bool no_calibration = false;
  std::string json = "build/bench/virtual_parts.json";
  app.add_option("--parts", options.parts, "of each model; every second has a defect")
      ->check(CLI::Range(1, 100000));
  app.add_option("--zone-in-u", options.zone_in_u,
                 "width of the zones in typical expanded uncertainties; 0: those of the model")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--seed", options.seed, "of everything drawn");
  app.add_flag("--no-calibration", no_calibration, "scanners without calibration errors");
  app.add_flag("--at-limit", options.at_limit, "all features of all parts at their limits");
  app.add_flag("--verbose", options.verbose, "a line for every feature of every part");
  app.add_option("--json", json, "file of the results");
  CLI11_PARSE(app, argc, argv);
  options.calibration = !no_calibration;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::string folder =
      (std::filesystem::temp_directory_path() / absl::StrCat("virtual_parts_", getpid())).string();
  std::filesystem::create_directories(folder);
  std::printf("%-34s %5s %9s %9s %7s %9s %9s %10s %10s\n", "feature", "good", "accepted",
              "rejected", "defect", "rejected", "accepted", "undecided", "interval");
  Json results;
  for (VirtualModel& model : std::vector<VirtualModel>{MakeStep(), MakePlate()}) {
    for (Json& row : RunModel(std::move(model), options, folder)) results.push_back(row);
  }
  std::filesystem::remove_all(folder);
  WriteResults(json, "virtual_parts",
               {{"parts", options.parts},
                {"zone_in_u", options.zone_in_u},
                {"at_limit", options.at_limit},
                {"features", results}});
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) { return sightline::bench::Run(argc, argv); }
