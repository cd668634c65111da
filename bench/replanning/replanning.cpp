// SPDX-License-Identifier: Apache-2.0
// Planning again after the first half of a plan was measured, judged on a part whose truth is
// known: it lies 2 mm and 1 degree off and has a bump of 1 mm.
//
// The first plan is made for the CAD model. Points of its first half are the exact points of the
// moved part with the bump, disturbed by noise of detection in the image and triangulated with the
// stated rig. `sightline plan --resume --measured` plans the rest. What the second halves of both
// plans measure is then evaluated on the truth.
#include <spawn.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/random/counter_random.h"
#include "core/registration/deformed_mesh.h"
#include "core/registration/rigid_registration.h"
#include "core/rig/scan_geometry.h"
#include "core/targets/poisson_disk.h"
#include "core/triangulation/triangulation.h"
#include "coverage_server/scene/coverage_scene.h"
#include "sightline/v1/plan.pb.h"

namespace sightline::bench {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct Options {
  std::string inspection = "bench/replanning/inspection.json";
  std::string folder = "build/replanning";
  double shift_mm = 2, turn_deg = 1, bump_mm = 1, bump_width_mm = 8, noise_px = 0.2;
  int64_t seed = 1;
  int64_t evaluations_per_scan = 10000;
};

void RunSightline(std::vector<std::string> arguments) {
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "sightline";
  arguments.insert(arguments.begin(), program.string());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  if (posix_spawn(&pid, program.c_str(), nullptr, nullptr, argv.data(), environ) != 0) {
    Fail("spawn", program.string());
  }
  int status = 0;
  waitpid(pid, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    Fail("sightline " + arguments[1], "ended with status " + std::to_string(status));
  }
}

std::vector<Measurement> ReadScans(const std::string& path, v1::Plan* plan) {
  const absl::Status status = ReadStrictJsonFile(path, plan);
  if (!status.ok()) Fail(path, std::string(status.message()));
  std::vector<Measurement> scans;
  for (const v1::PlannedScan& scan : plan->scans()) {
    scans.push_back(MeasurementFromProto(scan.measurement()));
  }
  return scans;
}

std::unique_ptr<CoverageScene> Build(const TriangleMesh& part, const Rig& rig,
                                     const TargetSampling& sampling) {
  SceneDefinition definition;
  definition.part = part;
  definition.rig = rig;
  definition.sampling = sampling;
  auto scene = CoverageScene::Build(std::move(definition), {});
  if (!scene.ok()) Fail("scene", std::string(scene.status().message()));
  return *std::move(scene);
}

TargetBits Covered(const CoverageScene& scene, const std::vector<Measurement>& scans,
                   int* infeasible) {
  TargetBits covered(scene.targets().size());
  for (const Measurement& scan : scans) {
    const ExactCoverage exact = scene.EvaluateExact(scan, nullptr, nullptr);
    if (exact.feasibility != Feasibility::kFeasible) {
      ++*infeasible;
      continue;
    }
    covered |= exact.covered;
  }
  covered &= scene.measurable();
  return covered;
}

// In the middle of the largest even surface that is measured: the covered target with most others
// within 20 mm whose normals are within 5 degrees.
size_t PlaceOfBump(const TargetSet& targets, const TargetBits& covered) {
  size_t best = 0;
  int most = -1;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (!covered.Test(t)) continue;
    int near = 0;
    for (size_t other = 0; other < targets.size(); ++other) {
      near += (targets.positions_m[other] - targets.positions_m[t]).squaredNorm() < 4e-4f &&
              targets.normals[other].dot(targets.normals[t]) > 0.9962f;
    }
    if (near <= most) continue;
    most = near;
    best = t;
  }
  return best;
}

TriangleMesh WithBump(const TriangleMesh& mesh, const Eigen::Vector3f& place,
                      const Eigen::Vector3f& normal, const Options& options) {
  TargetSampling fine;
  fine.spacing_m = 0.002;
  const auto places = SampleTargets(mesh, fine);
  if (!places.ok()) Fail("bump", std::string(places.status().message()));
  DeviationField field;
  field.spacing_m = fine.spacing_m;
  for (size_t i = 0; i < places->size(); ++i) {
    const double r_mm = 1e3 * (places->positions_m[i] - place).norm();
    if (r_mm > 4 * options.bump_width_mm || places->normals[i].dot(normal) < 0.5f) continue;
    field.positions_m.push_back(places->positions_m[i]);
    field.normals.push_back(places->normals[i]);
    field.deviations_m.push_back(1e-3 * options.bump_mm *
                                 std::exp(-0.5 * std::pow(r_mm / options.bump_width_mm, 2)));
  }
  return DeformMesh(mesh, field);
}

// Points of a scan of the truth in the coordinates that a scanner delivers them in: those of the
// CAD model if the part lay where it should. False: the scan cannot be made.
bool WritePoints(const CoverageScene& truth, const PartPose& pose, const Measurement& scan,
                 const Options& options, uint64_t stream, const std::string& path) {
  std::vector<MeasurementPoint> points;
  if (truth.EvaluateExact(scan, &points, nullptr).feasibility != Feasibility::kFeasible) {
    return false;
  }
  const ScanGeometry geometry = MakeScanGeometry(truth.rig(), scan);
  CounterRandom random(static_cast<uint64_t>(options.seed), stream);
  std::vector<Eigen::Vector3f> positions, normals;
  for (const MeasurementPoint& point : points) {
    const double stage_m = point.frame * truth.rig().scan_step_m;
    const TriangulationSetup setup = MakeTriangulationSetup(
        truth.rig().camera, WorldToPart(geometry, truth.part_centre_m(), geometry.camera, stage_m),
        WorldToPart(geometry, truth.part_centre_m(), geometry.laser, stage_m));
    const auto noise = random.NormalPair();
    const Eigen::Vector2d image_px = ProjectPoint(setup, point.position_m.cast<double>()) +
                                     options.noise_px * Eigen::Vector2d(noise[0], noise[1]);
    const Eigen::Vector3d measured = Triangulate(setup, image_px);
    if (!measured.allFinite()) continue;
    positions.push_back((pose.Matrix() * measured).cast<float>());
    normals.push_back((pose.Rotation() * point.normal.cast<double>()).cast<float>());
  }
  if (const auto status = WritePlyPoints(path, positions, normals); !status.ok()) {
    Fail(path, std::string(status.message()));
  }
  return true;
}

double Part(const TargetBits& covered, const CoverageScene& scene) {
  return 100.0 * static_cast<double>(covered.Count()) /
         static_cast<double>(scene.measurable().Count());
}

void PrintFound(const v1::AsMeasured& found, const PartPose& truth, const Eigen::Vector3f& bump,
                double bump_mm) {
  const auto vector = [](const v1::Vector3& v) { return Eigen::Vector3d(v.x(), v.y(), v.z()); };
  const Eigen::Vector3d turn_deg = vector(found.rotation_deg());
  const Eigen::Vector3d shift_m = vector(found.translation_m());
  PoseVector error;
  error << turn_deg * kDegree - truth.parameters.head<3>(), shift_m - truth.parameters.tail<3>();
  PoseCovariance covariance;
  for (int k = 0; k < 36; ++k) covariance(k / 6, k % 6) = found.covariance(k);
  std::printf("pose          found      truth      error    2 sigma\n");
  static constexpr const char* kNames[] = {"turn x, deg", "turn y, deg", "turn z, deg",
                                           "shift x, mm", "shift y, mm", "shift z, mm"};
  for (int k = 0; k < 6; ++k) {
    const double scale = k < 3 ? 1 / kDegree : 1e3;
    std::printf("%s %10.5f %10.5f %10.5f %10.5f\n", kNames[k],
                scale * (truth.parameters[k] + error[k]), scale * truth.parameters[k],
                scale * error[k], 2 * scale * std::sqrt(covariance(k, k)));
  }
  std::printf("error over its covariance (chi of 6 degrees of freedom, 95 %%: 3.55): %.2f\n",
              std::sqrt(error.dot(covariance.ldlt().solve(error))));
  std::printf("not fixed: %d; residual standard deviation %.4f mm\n", found.not_fixed_size(),
              1e3 * found.residual_standard_deviation_m());
  const v1::SurfaceDeviation& d = found.deviation();
  std::printf(
      "bump of %.2f mm: largest deviation found %.3f mm (2 u %.3f mm), %.1f mm from its place; "
      "significant at %lld of %lld targets\n",
      bump_mm, 1e3 * d.largest_m(), 2e3 * d.largest_uncertainty_m(),
      1e3 * (vector(d.largest_place_m()) - bump.cast<double>()).norm(),
      static_cast<long long>(d.significant_targets()), static_cast<long long>(d.known_targets()));
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::string first_folder = options.folder + "/first",
                    again_folder = options.folder + "/again";
  std::filesystem::create_directories(options.folder + "/measured");
  std::filesystem::create_directories(again_folder);
  const std::string effort = std::to_string(options.evaluations_per_scan);
  Stopwatch watch;
  RunSightline({"plan", options.inspection, "--out", first_folder, "--no-pictures",
                "--no-point-clouds", "--bound-evaluations", "0", "--seed",
                std::to_string(options.seed), "--evaluations-per-scan", effort});
  const double first_s = watch.Seconds();
  v1::Plan first_plan;
  const std::vector<Measurement> first = ReadScans(first_folder + "/plan.json", &first_plan);
  const size_t half = (first.size() + 1) / 2;

  const auto inspection = ReadInspection(options.inspection);
  if (!inspection.ok()) Fail("inspection", std::string(inspection.status().message()));
  auto model = LoadPart(inspection->part_file, inspection->part_unit);
  if (!model.ok()) Fail("part", std::string(model.status().message()));

  const std::vector<Measurement> measured(first.begin(),
                                          first.begin() + static_cast<std::ptrdiff_t>(half));
  const std::vector<Measurement> rest(first.begin() + static_cast<std::ptrdiff_t>(half),
                                      first.end());
  int infeasible = 0;
  const auto nominal = Build(*model, inspection->rig, inspection->targets);
  const TargetBits nominal_half = Covered(*nominal, measured, &infeasible);
  const size_t bump_at = PlaceOfBump(nominal->targets(), nominal_half);
  const Eigen::Vector3f bump = nominal->targets().positions_m[bump_at];

  PartPose pose;
  pose.centre_m = model->BoundingBox().center();
  pose.parameters.head<3>() =
      options.turn_deg * kDegree * Eigen::Vector3d(0.5, 0.6, 0.6).normalized();
  pose.parameters.tail<3>() =
      1e-3 * options.shift_mm * Eigen::Vector3d(0.6, -0.6, 0.5).normalized();
  Rig rig = inspection->rig;
  rig.part_placement = {pose.Rotation(),
                        pose.centre_m - pose.Rotation().transpose() * pose.parameters.tail<3>()};
  const auto truth = Build(WithBump(*model, bump, nominal->targets().normals[bump_at], options),
                           rig, inspection->targets);

  std::vector<std::string> again = {"plan",
                                    options.inspection,
                                    "--out",
                                    again_folder,
                                    "--resume",
                                    "--no-pictures",
                                    "--no-point-clouds",
                                    "--bound-evaluations",
                                    "0",
                                    "--seed",
                                    std::to_string(options.seed),
                                    "--evaluations-per-scan",
                                    effort};
  std::vector<Measurement> made;
  for (size_t i = 0; i < half; ++i) {
    char name[64];
    std::snprintf(name, sizeof name, "/measured/scan_%02zu.ply", i + 1);
    if (!WritePoints(*truth, pose, first[i], options, i, options.folder + name)) {
      std::printf("scan %zu cannot be made on the part as it lies\n", i + 1);
      continue;
    }
    made.push_back(first[i]);
    again.insert(again.end(), {"--measured", options.folder + name});
  }
  std::filesystem::copy_file(first_folder + "/plan.json", again_folder + "/plan.json",
                             std::filesystem::copy_options::overwrite_existing);
  watch = {};
  RunSightline(again);
  const double again_s = watch.Seconds();
  v1::Plan again_plan;
  const std::vector<Measurement> second = ReadScans(again_folder + "/plan.json", &again_plan);
  const std::vector<Measurement> new_rest(second.begin() + static_cast<std::ptrdiff_t>(made.size()),
                                          second.end());

  PrintFound(again_plan.as_measured(), pose, bump, options.bump_mm);
  std::printf("\nplanned in %.1f s, planned again in %.1f s\n", first_s, again_s);
  std::printf("goal %.2f %%; old plan on the CAD model: %zu scans, %.2f %%\n",
              100 * inspection->goal.coverage, first.size(),
              100 * first_plan.coverage().coverage());
  const TargetBits base = Covered(*truth, made, &infeasible);
  std::printf("on the part as it is (%lld measurable targets):\n",
              static_cast<long long>(truth->measurable().Count()));
  std::printf("%-34s %5s %12s %12s %11s\n", "second half", "scans", "settles, %", "together, %",
              "infeasible");
  std::printf("%-34s %5d %12s %12.2f %11s\n", "none (measured first half)", 0, "",
              Part(base, *truth), "");
  const auto row = [&](const char* name, const std::vector<Measurement>& scans) {
    int bad = 0;
    TargetBits all = Covered(*truth, scans, &bad);
    const double alone = Part(all, *truth);
    all |= base;
    std::printf("%-34s %5zu %12.2f %12.2f %11d\n", name, scans.size(), alone, Part(all, *truth),
                bad);
  };
  row("old", rest);
  row("planned again", new_rest);
  if (new_rest.size() > rest.size()) {
    row("planned again, as many as the old",
        {new_rest.begin(), new_rest.begin() + static_cast<std::ptrdiff_t>(rest.size())});
  }
  std::printf("the command says of its plan: %.2f %%, of the old one on the part: %.2f %%\n",
              100 * again_plan.as_measured().settled(),
              100 * again_plan.as_measured().earlier_settled());
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Planning again after the first half of a plan was measured");
  sightline::bench::Options options;
  app.add_option("--inspection", options.inspection);
  app.add_option("--folder", options.folder);
  app.add_option("--shift-mm", options.shift_mm);
  app.add_option("--turn-deg", options.turn_deg);
  app.add_option("--bump-mm", options.bump_mm);
  app.add_option("--bump-width-mm", options.bump_width_mm, "standard deviation of its Gaussian");
  app.add_option("--noise-px", options.noise_px);
  app.add_option("--seed", options.seed);
  app.add_option("--evaluations-per-scan", options.evaluations_per_scan);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
