// SPDX-License-Identifier: Apache-2.0
// Limits by the light of materials on the cylinder head: whether the table says what rendered
// frames of the part show, how many scans a plan needs in each material, and what the limit costs a
// gain query.
//
// Agreement is counted over segments of the laser line, 32 image columns long, of random frames.
// The table calls a segment detectable if a permitted exposure shows the line at most of its
// points. The frame shows it if with one of the permitted exposures and focus distances that are
// tried at least 90 % of its columns are found, and a tenth of them clipped at most. The focus
// distances are those of the nearest, the middle and the farthest part of the line, since the table
// states what any permitted setting shows. Frames have shadows, multiple reflections and the slopes
// of the part; the table knows facets alone.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/random/random.h"
#include "core/rig/scan_geometry.h"
#include "coverage_server/detectability/light_limit.h"
#include "coverage_server/scene/coverage_scene.h"
#include "render_worker/detectability/detectability_table.h"
#include "render_worker/optical_planning/frame_light.h"
#include "render_worker/optical_planning/lens_image.h"
#include "render_worker/optical_planning/line_evaluation.h"
#include "render_worker/optical_planning/setting_judge.h"
#include "render_worker/render/part_scene.h"

namespace sightline::bench {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr char kName[] = "material_limits";

struct Options {
  std::vector<std::string> materials = {"sand_cast_aluminium", "machined_aluminium",
                                        "black_anodised", "matt_white_paint"};
  int frames = 20;  // of each material
  int targets = 8000;
  int exposures = 13;
  double power_w = 0.001, min_exposure_s = 2e-5, max_exposure_s = 4e-3;
  double goal = 0.9;
  double seconds = 4;  // of each timing
  int rounds = 5;
  std::string json;
  std::string list;  // CSV file of all segments
};

template <typename T>
T Must(absl::StatusOr<T> value) {
  if (!value.ok()) Fail(kName, std::string(value.status().message()));
  return *std::move(value);
}

std::filesystem::path SourceFolder() {
  const char* folder = std::getenv("SIGHTLINE_SOURCE_DIR");
  return folder != nullptr ? std::filesystem::path(folder) : std::filesystem::current_path();
}

Inspection InspectionWith(const Options& options, const std::string& material) {
  const std::string json = absl::StrCat(R"({"part": {"file": "cylinder_head.glb"},
    "camera": {"sensor_file": "../catalogue/cameras/bfly_pge_23s6c.json"},
    "lens": {"focal_length_m": 0.016, "f_number": 8, "transmission": 0.87},
    "laser": {"distance_m": 0.5, "fan_angle_deg": 60, "wavelength_m": 661e-9,
      "divergence_rad": 0.24e-3, "beam_focus_distance_m": 0.6, "power_w": )",
                                        options.power_w, R"(},
    "rig": {"part_holding": "PART_HOLDING_FREE"},
    "materials": [{"file": "../catalogue/materials/)",
                                        material, R"(.json"}]})");
  v1::Inspection message;
  if (const absl::Status s = ParseStrictJson(json, kName, &message); !s.ok()) {
    Fail(kName, std::string(s.message()));
  }
  Inspection inspection =
      Must(ParseInspection(message, kName, (SourceFolder() / "examples/cylinder_head").string()));
  inspection.optics->realisations = 2;
  return inspection;
}

std::unique_ptr<CoverageScene> SceneOf(const TriangleMesh& mesh, const Inspection& inspection,
                                       double spacing_m,
                                       const std::optional<Detectability>& detectability) {
  SceneDefinition definition;
  definition.part = mesh;
  definition.rig = inspection.rig;
  definition.sampling.spacing_m = spacing_m;
  definition.detectability = detectability;
  return Must(CoverageScene::Build(std::move(definition), {}));
}

// A segment of the line in a frame.
struct Segments {
  int both = 0, neither = 0, table_only = 0, frame_only = 0;

  int Count() const { return both + neither + table_only + frame_only; }
  double Agreement() const { return static_cast<double>(both + neither) / std::max(1, Count()); }
};

// A segment of the line as the list has it.
struct Segment {
  double depth_m = 0, slope = 0;  // slope: rows per column
  double camera_incidence_deg = 0, laser_incidence_deg = 0;
  bool table = false;
  double found = 0, clipped = 0;  // largest share of found columns, and clipped share there
  double exposure_s = 0;          // with which these were found
  int focus = -1;                 // index of the first focus distance that shows it; -1: none does
  ExposureRange needed{};         // by the table, at the first crossing
};

// The exact points of one frame by column.
using PointsOfFrame = std::multimap<int, const MeasurementPoint*>;

// Whether the table shows the line at most of the segment's crossings; unset: it is no smooth,
// whole piece of surface.
std::optional<bool> TableSays(const LightLimit& limit, const ScanGeometry& geometry,
                              const Eigen::Vector3d& centre_m, double stage_m, const Rig& rig,
                              const PointsOfFrame& points, const RegionOfInterest& roi,
                              const std::vector<LineCrossing>& line,
                              const std::vector<size_t>& crossings, Segment* segment) {
  constexpr size_t kFewest = 12;
  if (crossings.size() < kFewest) return std::nullopt;
  const SensorPose camera = WorldToPart(geometry, centre_m, geometry.camera, stage_m),
                   laser = WorldToPart(geometry, centre_m, geometry.laser, stage_m);
  int shown = 0;
  Eigen::Vector3d first_normal = Eigen::Vector3d::Zero();
  for (const size_t i : crossings) {
    const int column = roi.column_px + line[i].column_px + rig.camera.columns_px / 2;
    const double row = roi.row_px + line[i].row_px;
    const MeasurementPoint* nearest = nullptr;
    double distance_px = 3;
    const auto [begin, end] = points.equal_range(column);
    for (auto it = begin; it != end; ++it) {
      const Eigen::Vector3d view = it->second->position_m.cast<double>() - camera.origin_m;
      const double at =
          rig.camera.FocalLengthPx() * view.dot(camera.y_axis) / view.dot(camera.z_axis);
      if (std::abs(at - row) >= distance_px) continue;
      distance_px = std::abs(at - row);
      nearest = it->second;
    }
    if (nearest == nullptr) return std::nullopt;
    const Eigen::Vector3d place = nearest->position_m.cast<double>(),
                          normal = nearest->normal.cast<double>();
    const Eigen::Vector3d to_camera = camera.origin_m - place, to_laser = laser.origin_m - place;
    if (first_normal.isZero()) {
      first_normal = normal;
      const auto degrees = [&](const Eigen::Vector3d& d) {
        return std::acos(std::clamp(normal.dot(d.normalized()), -1.0, 1.0)) / kRadPerDeg;
      };
      segment->camera_incidence_deg = degrees(to_camera);
      segment->laser_incidence_deg = degrees(to_laser);
      segment->depth_m = -to_camera.dot(camera.z_axis);
      segment->needed = limit.tables().front().At(
          to_camera.norm(), to_laser.norm(), std::cos(segment->camera_incidence_deg * kRadPerDeg),
          std::cos(segment->laser_incidence_deg * kRadPerDeg),
          to_camera.normalized().dot(to_laser.normalized()));
    }
    if (normal.dot(first_normal) < std::cos(10 * kRadPerDeg)) return std::nullopt;
    shown +=
        limit.At(limit.EntryOf(0), normal, to_camera, to_laser).verdict == LightVerdict::kDetected;
  }
  const LineCrossing &first = line[crossings.front()], &last = line[crossings.back()];
  segment->slope = (last.row_px - first.row_px) / std::max(1, last.column_px - first.column_px);
  return 2 * static_cast<size_t>(shown) > crossings.size();
}

// Compares one frame; false if it shows no line.
bool CompareFrame(PartScene& part, const CoverageScene& scene, const LightLimit& limit,
                  const Options& options, const Measurement& measurement, Random& random,
                  Segments* segments, std::vector<Segment>* list) {
  std::vector<MeasurementPoint> points;
  if (scene.EvaluateExact(measurement, &points, nullptr).feasibility != Feasibility::kFeasible ||
      points.empty()) {
    return false;
  }
  const int frame = points[static_cast<size_t>(random.Uniform() * points.size())].frame;
  PointsOfFrame of_frame;
  for (const MeasurementPoint& point : points) {
    if (point.frame == frame) of_frame.emplace(point.column_px, &point);
  }
  const Inspection& inspection = part.inspection();
  PartFrameRequest request;
  request.measurement = measurement;
  request.stage_position_m = frame * inspection.rig.scan_step_m;
  RenderLimits limits;
  limits.threads = 2;
  const FrameGlance glance = Must(GlanceAtFrame(part, request, {}, 48, limits));
  if (glance.lit_samples == 0) return false;
  FrameSetup setup = PartFrameSetup(inspection, request);
  setup.lens.focus_distance_m = measurement.camera_distance_m;
  const std::array<double, 2> depths = {glance.nearest_m, glance.farthest_m};
  FrameLightOptions light_options;
  light_options.margin_px = LensMarginPx(setup, {}, depths);
  light_options.roi = glance.roi;
  light_options.limits = limits;
  auto traced = TraceFrameLight(part, request, {}, light_options);
  if (!traced.ok()) return false;
  const auto light = std::make_shared<const FrameLight>(*std::move(traced));
  SettingJudge judge(inspection, {}, {{light, 1}}, 1, limits);
  const double middle_m = light->median_line_depth_m;
  std::vector<Segment> shown;
  std::vector<std::vector<size_t>> blocks;
  const RegionOfInterest roi = light->grid.roi;
  int focus = 0;
  for (const double focus_m : {middle_m, glance.nearest_m, glance.farthest_m}) {
    OpticalSetting setting;
    setting.lens.f_number = inspection.rig.lens->f_number;
    setting.lens.focus_distance_m = focus_m;
    setting.laser_power_w = inspection.rig.laser.power_w;
    if (const absl::Status s = judge.LookThrough(setting.lens); !s.ok()) return false;
    for (int e = 0; e < options.exposures; ++e) {
      setting.exposure_time_s =
          options.min_exposure_s * std::pow(options.max_exposure_s / options.min_exposure_s,
                                            static_cast<double>(e) / (options.exposures - 1));
      FrameSetup exposed = judge.Setup(0, setting, 0);
      FrameSetup at_line = exposed;
      at_line.plate.camera_distance_m = middle_m;
      const DetectionPlan plan = PlanDetection(at_line, inspection.optics->detector);
      const DetectedLine detected = Must(ExposeAndDetect(judge.light(0), exposed, {}, plan));
      const double reach_px = 3 * inspection.optics->prior_uncertainty_px;
      const std::vector<LineSums> sums =
          JudgeLine(detected, plan, light->line, roi.columns_px, reach_px);
      if (blocks.empty()) {
        blocks = CrossingsOfBlocks(plan, light->line, roi.columns_px);
        shown.assign(blocks.size(), Segment{});
      }
      for (size_t b = 0; b < blocks.size(); ++b) {
        const LineSums& block = sums[b];
        const double found = block.found / std::max(1.0, block.crossings),
                     clipped = block.clipped / std::max(1.0, block.found);
        if (found > shown[b].found) {
          shown[b].found = found;
          shown[b].clipped = clipped;
          shown[b].exposure_s = setting.exposure_time_s;
        }
        if (found >= 0.9 && clipped <= inspection.optics->max_clipped_fraction &&
            shown[b].focus < 0) {
          shown[b].focus = focus;
        }
      }
    }
    ++focus;
  }
  const ScanGeometry geometry = MakeScanGeometry(inspection.rig, measurement);
  for (size_t b = 0; b < blocks.size(); ++b) {
    const auto table = TableSays(limit, geometry, scene.part_centre_m(), request.stage_position_m,
                                 inspection.rig, of_frame, roi, light->line, blocks[b], &shown[b]);
    if (!table) continue;
    const bool seen = shown[b].focus >= 0;
    ++(*table ? (seen ? segments->both : segments->table_only)
              : (seen ? segments->frame_only : segments->neither));
    shown[b].table = *table;
    list->push_back(shown[b]);
  }
  return true;
}

struct QueryCost {
  double without_us = 0, with_us = 0, ratio = 0;
};

// CPU time of a gain query, the two scenes in turn.
QueryCost CostOf(const CoverageScene& without, const CoverageScene& with, const Options& options,
                 const std::vector<Measurement>& scans) {
  const auto run = [&](const CoverageScene& scene) {
    constexpr size_t kBatch = 64;
    std::vector<FastGain> gains(kBatch);
    const double cpu = OwnCpuSeconds();
    int64_t queries = 0;
    while (OwnCpuSeconds() - cpu < options.seconds) {
      for (size_t i = 0; i + kBatch <= scans.size(); i += kBatch) {
        scene.EvaluateGains(std::span(scans).subspan(i, kBatch), nullptr, {}, gains, nullptr);
        queries += kBatch;
      }
    }
    return 1e6 * (OwnCpuSeconds() - cpu) / static_cast<double>(queries);
  };
  std::vector<double> a, b, ratio;
  for (int round = 0; round < options.rounds; ++round) {
    a.push_back(run(without));
    b.push_back(run(with));
    ratio.push_back(b.back() / a.back());
  }
  return {Median(a), Median(b), Median(ratio)};
}

// Adds the segments of a material to the CSV file; nothing without a file.
void WriteList(const std::string& path, const std::string& material,
               const std::vector<Segment>& list) {
  if (path.empty()) return;
  std::ofstream file(path, std::ios::app);
  if (file.tellp() == 0) {
    file << "material,depth_m,slope,camera_incidence_deg,laser_incidence_deg,table,found,clipped,"
            "exposure_s,focus,table_shortest_s,table_longest_s\n";
  }
  for (const Segment& s : list) {
    file << absl::StrJoin(
                std::make_tuple(material, s.depth_m, s.slope, s.camera_incidence_deg,
                                s.laser_incidence_deg, s.table ? 1 : 0, s.found, s.clipped,
                                s.exposure_s, s.focus, s.needed.shortest_s, s.needed.longest_s),
                ",")
         << "\n";
  }
  if (!file) Fail(kName, path + ": cannot be written");
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::unique_ptr<TriangleMesh> head = LoadBenchPart("head");
  TriangleMesh mesh = *head;
  // One material everywhere.
  mesh.triangle_material.clear();
  mesh.material_names.clear();
  const double spacing_m = SpacingForTargets(mesh, options.targets);
  const AssetResolver assets = [](const std::string& file) { return file; };
  std::printf(
      "%g mW, exposures of %g to %g ms, f/8, %d frames of each material, %d exposures of each "
      "frame\n%-22s %8s %9s %9s %6s %8s %11s %11s %11s %7s %9s %9s %7s\n",
      1e3 * options.power_w, 1e3 * options.min_exposure_s, 1e3 * options.max_exposure_s,
      options.frames, options.exposures, "material", "table s", "segments", "agreement", "both",
      "neither", "table only", "frame only", "measurable", "scans", "us off", "us on", "ratio");
  Json rows = Json::array();
  for (const std::string& name : options.materials) {
    Inspection inspection = InspectionWith(options, name);
    DetectabilityTask task;
    task.part_materials = {""};
    task.f_number = inspection.rig.lens->f_number;
    DetectabilityHooks hooks;
    hooks.limits.threads = 2;
    const Stopwatch watch;
    v1::Detectability message;
    *message.mutable_table() = Must(MakeDetectabilityTable(inspection, {}, assets, task, hooks));
    const double table_s = watch.Seconds();
    message.set_min_exposure_time_s(options.min_exposure_s);
    message.set_max_exposure_time_s(options.max_exposure_s);
    const Detectability detectability = Must(ParseDetectability(message, name));
    const auto without = SceneOf(mesh, inspection, spacing_m, std::nullopt),
               with = SceneOf(mesh, inspection, spacing_m, detectability);
    const std::vector<Measurement> scans = RandomScans(*without, 1024, 1);
    const QueryCost cost = CostOf(*without, *with, options, scans);

    PartSceneInput input;
    input.inspection = inspection;
    input.part = mesh;
    input.assets = assets;
    const auto part = Must(PartScene::Make(std::move(input)));
    const LightLimit limit(detectability, mesh);
    Segments segments;
    std::vector<Segment> list;
    Random random(7);
    int frames = 0;
    for (size_t i = 0; frames < options.frames && i < scans.size(); ++i) {
      frames += CompareFrame(*part, *without, limit, options, scans[i], random, &segments, &list);
    }
    WriteList(options.list, name, list);
    const double measurable = static_cast<double>(with->measurable().Count()) /
                              static_cast<double>(with->targets().size());
    const size_t plan =
        measurable > 0 ? GreedyPlanScans(*with, options.goal, 2000, 1).size() : size_t{0};
    std::printf("%-22s %8.1f %9d %8.1f%% %6d %8d %11d %11d %10.1f%% %7zu %9.1f %9.1f %7.3f\n",
                name.c_str(), table_s, segments.Count(), 100 * segments.Agreement(), segments.both,
                segments.neither, segments.table_only, segments.frame_only, 100 * measurable, plan,
                cost.without_us, cost.with_us, cost.ratio);
    rows.push_back({{"material", name},
                    {"table_s", table_s},
                    {"frames", frames},
                    {"segments", segments.Count()},
                    {"agreement", segments.Agreement()},
                    {"table_and_frame", segments.both},
                    {"neither", segments.neither},
                    {"table_only", segments.table_only},
                    {"frame_only", segments.frame_only},
                    {"measurable_fraction", measurable},
                    {"scans", plan},
                    {"query_us_without", cost.without_us},
                    {"query_us_with", cost.with_us},
                    {"query_ratio", cost.ratio}});
  }
  WriteResults(options.json, kName, {{"materials", rows}});
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Limits by the light of materials against rendered frames");
  sightline::bench::Options options;
  app.add_option("--materials", options.materials, "of examples/catalogue/materials");
  app.add_option("--frames", options.frames, "of each material");
  app.add_option("--targets", options.targets);
  app.add_option("--exposures", options.exposures)->check(CLI::Range(2, 100));
  app.add_option("--power-w", options.power_w);
  app.add_option("--max-exposure-s", options.max_exposure_s);
  app.add_option("--goal", options.goal);
  app.add_option("--seconds", options.seconds, "of each timing");
  app.add_option("--rounds", options.rounds);
  app.add_option("--json", options.json);
  app.add_option("--list", options.list, "CSV file that gets a row for each segment");
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
