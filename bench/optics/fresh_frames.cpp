// SPDX-License-Identifier: Apache-2.0
// Validates a plan with its settings by new images: frames drawn at random from its scans, rendered
// as `sightline render` does, their lines detected and compared with the true ones.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "bench/common/measure.h"
#include "core/field_limits/field_checks.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "render_worker/optical_planning/detection_noise.h"
#include "render_worker/optical_planning/frame_light.h"
#include "render_worker/optical_planning/line_evaluation.h"
#include "render_worker/optical_planning/optics_answer.h"
#include "render_worker/render/part_inspection.h"
#include "sightline/v1/plan.pb.h"

namespace sightline::bench {
namespace {

constexpr char kName[] = "fresh_frames";

template <typename T>
T Must(absl::StatusOr<T> value) {
  if (!value.ok()) Fail(kName, std::string(value.status().message()));
  return *std::move(value);
}

CameraSetting SettingOf(const v1::OpticalSetting& message) {
  return {message.f_number(),
          message.exposure_time_s(),
          message.focus_distance_m(),
          message.laser_power_w(),
          Radians(message.sensor_tilt_x_deg()),
          Radians(message.sensor_tilt_y_deg())};
}

int Run(const std::string& inspection_file, const std::string& plan_file, int count, unsigned seed,
        const std::string& json) {
  PrintMachine();
  Inspection inspection = Must(ReadInspection(inspection_file));
  if (!inspection.optics) inspection.optics = OpticsPlanning{};
  // Other light as exact as the search has it; its noise is not what is looked at.
  inspection.render.noise_target_relative = std::max(inspection.render.noise_target_relative, 0.1);
  inspection.render.seed = seed;
  v1::Plan plan;
  if (const absl::Status s = ReadStrictJsonFile(plan_file, &plan); !s.ok()) {
    Fail(kName, std::string(s.message()));
  }
  const AssetResolver assets = [](const std::string& file) { return file; };
  const auto scene = Must(LoadPartScene(inspection, assets, nullptr));
  std::mt19937_64 random(seed);
  RenderLimits limits;
  limits.threads = 2;
  const LineCost cost{inspection.optics->prior_uncertainty_px, 0};
  std::vector<DetectedBlock> blocks;
  std::vector<double> u_px, height_um, found;
  Json frames = Json::array();
  const Stopwatch watch;
  for (int i = 0; static_cast<int>(u_px.size()) < count && i < 4 * count; ++i) {
    const v1::PlannedScan& scan = plan.scans(i % plan.scans_size());
    const int trigger = static_cast<int>(random() % scan.trigger_positions_m_size());
    PartFrameRequest request;
    request.measurement = MeasurementFromProto(scan.measurement());
    // A tenth of a micrometre on: another piece of surface as far as speckle goes.
    request.stage_position_m = scan.trigger_positions_m(trigger) + 1e-7;
    request.setting = SettingOf(scan.setting());
    FrameLightOptions light_options;
    light_options.margin_px = 0;
    light_options.limits = limits;
    const auto light = TraceFrameLight(*scene, request, {}, light_options);
    if (!light.ok()) continue;  // no line in this frame
    const RenderedPartFrame frame = Must(RenderPartFrame(*scene, request, {}, false, limits));
    FrameSetup setup = PartFrameSetup(inspection, request);
    setup.plate.camera_distance_m = light->median_line_depth_m;
    const DetectionPlan detection = PlanDetection(setup, inspection.optics->detector);
    const DetectedLine detected = Must(DetectLine(frame.image.raw_dn, detection));
    const std::vector<LineSums> sums = JudgeLine(
        detected, detection, light->line, setup.roi.columns_px, 3 * cost.prior_uncertainty_px);
    const auto of_blocks = CrossingsOfBlocks(detection, light->line, setup.roi.columns_px);
    LineSums total;
    for (size_t b = 0; b < sums.size(); ++b) {
      total += sums[b];
      if (of_blocks[b].empty()) continue;
      DetectedBlock block{.crossings = sums[b].crossings,
                          .found = sums[b].found,
                          .deviation_px = sums[b].deviation_px,
                          .deviation2_px2 = sums[b].deviation2_px2};
      for (const size_t crossing : of_blocks[b]) {
        const auto points = static_cast<double>(of_blocks[b].size());
        block.distance_m += light->line_views[crossing].distance_m / points;
        block.incidence_rad += light->line_views[crossing].incidence_rad / points;
      }
      blocks.push_back(block);
    }
    const LineQuality quality = QualityOf(total, cost);
    u_px.push_back(quality.u_px);
    found.push_back(quality.profile_coverage);
    height_um.push_back(1e6 * quality.u_px * HeightPerPixel(setup, light->median_line_depth_m));
    frames.push_back({{"scan", i % plan.scans_size() + 1},
                      {"frame", trigger},
                      {"line_points", total.crossings},
                      {"u_px", u_px.back()},
                      {"u_height_um", height_um.back()},
                      {"found", found.back()}});
  }
  const auto noise = LearnDetectionNoise(blocks);
  std::printf("%zu fresh frames of %d scans (%.0f s): u %.4f px, %.2f um, %.4f of the line found\n",
              u_px.size(), plan.scans_size(), watch.Seconds(), Mean(u_px), Mean(height_um),
              Mean(found));
  Json result = {{"frames", frames},
                 {"mean_u_px", Mean(u_px)},
                 {"mean_u_height_um", Mean(height_um)},
                 {"mean_found", Mean(found)}};
  if (noise) {
    result["detection"] =
        Json::parse(ToJson(DetectionToProto(*noise, blocks, static_cast<int>(u_px.size()))));
  }
  WriteResults(json, kName, result);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("A plan with its settings, judged by fresh images");
  std::string inspection, plan, json;
  int frames = 60;
  unsigned seed = 1001;
  app.add_option("--inspection", inspection)->required();
  app.add_option("--plan", plan, "plan.json with the setting of every scan")->required();
  app.add_option("--frames", frames)->check(CLI::Range(1, 10000));
  app.add_option("--seed", seed);
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(inspection, plan, frames, seed, json);
}
