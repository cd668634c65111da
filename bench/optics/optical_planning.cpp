// SPDX-License-Identifier: Apache-2.0
// One frame's choice of f-number and exposure, phase by phase: light transport once, optics once
// per f-number and realisation, sensor and detection per exposure; the search next to the full grid
// of exposures; and what is promised of the chosen setting against images rendered from scratch.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/common/measure.h"
#include "render_worker/optical_planning/choose_setting.h"
#include "render_worker/optical_planning/frame_light.h"
#include "render_worker/optical_planning/lens_image.h"
#include "render_worker/render/part_inspection.h"

namespace sightline::bench {
namespace {

constexpr char kName[] = "optical_planning";

struct Options {
  std::string json;
  std::string inspection = "examples/cylinder_head_optics/inspection.json";
  int threads = 2;
  int fresh = 20;
  bool grid = true;
};

template <typename T>
T Must(absl::StatusOr<T> value) {
  if (!value.ok()) Fail(kName, std::string(value.status().message()));
  return *std::move(value);
}

std::unique_ptr<PartScene> Load(const Inspection& inspection) {
  const AssetResolver assets = [](const std::string& file) { return file; };
  return Must(LoadPartScene(inspection, assets, nullptr));
}

// The best of the exposures asked for, and how many those were.
struct Best {
  JudgedSetting judged;
  int asked = 0;
  double seconds = 0;
};
Best SearchWith(SettingJudge& judge, const ExposureGrid& grid, double power_w, bool every) {
  std::vector<JudgedSetting> judged;
  const Stopwatch watch;
  Must(SearchExposure(grid, every,
                      [&](std::span<const int> indices) -> absl::StatusOr<std::vector<double>> {
                        std::vector<double> times, costs;
                        for (const int index : indices) times.push_back(grid.At(index));
                        for (JudgedSetting& j : Must(judge.Judge(times, power_w))) {
                          costs.push_back(j.cost());
                          judged.push_back(std::move(j));
                        }
                        return costs;
                      }));
  const auto best =
      std::min_element(judged.begin(), judged.end(),
                       [](const auto& a, const auto& b) { return a.cost() < b.cost(); });
  return {*best, static_cast<int>(judged.size()), watch.Seconds()};
}

// The chosen setting's promise against images that were not there when it was made: other speckle,
// other noise, light traced anew through the finite pupil.
Json CompareWithFresh(const Options& options, Inspection inspection,
                      const PartFrameRequest& request, const FrameLight& light,
                      const JudgedSetting& best) {
  // Other light as exact as the search had it; its noise is not what is looked at.
  inspection.render.noise_target_relative = std::max(inspection.render.noise_target_relative, 0.1);
  const auto scene = Load(inspection);
  int in_u = 0, in_coverage = 0, in_cost = 0;
  std::vector<double> u, coverage;
  const LineCost cost{inspection.optics->prior_uncertainty_px, inspection.optics->false_line_weight,
                      inspection.optics->max_clipped_fraction};
  const auto holds = [](const QualityEstimate::Interval& interval, double value) {
    return value >= interval.lower && value <= interval.upper ? 1 : 0;
  };
  const Stopwatch watch;
  for (int i = 0; i < options.fresh; ++i) {
    PartFrameRequest fresh = request;
    // A tenth of a micrometre on: another piece of surface as far as speckle goes.
    fresh.stage_position_m += 1e-7 * (i + 1);
    const LensSetting& lens = best.setting.lens;
    fresh.setting = CameraSetting{lens.f_number,          best.setting.exposure_time_s,
                                  lens.focus_distance_m,  best.setting.laser_power_w,
                                  lens.sensor_tilt_x_rad, lens.sensor_tilt_y_rad};
    RenderLimits limits;
    limits.threads = options.threads;
    const RenderedPartFrame frame = Must(RenderPartFrame(*scene, fresh, {}, false, limits));
    FrameSetup setup = PartFrameSetup(inspection, fresh);
    setup.plate.camera_distance_m = light.median_line_depth_m;
    const DetectionPlan plan = PlanDetection(setup, inspection.optics->detector);
    const DetectedLine detected = Must(DetectLine(frame.image.raw_dn, plan));
    LineSums total;
    for (const LineSums& s : JudgeLine(detected, plan, light.line, setup.roi.columns_px,
                                       3 * cost.prior_uncertainty_px)) {
      total += s;
    }
    const LineQuality quality = QualityOf(total, cost);
    u.push_back(quality.u_px);
    coverage.push_back(quality.profile_coverage);
    in_u += holds(best.quality.u_px(), quality.u_px);
    in_coverage += holds(best.quality.profile_coverage(), quality.profile_coverage);
    in_cost += holds(best.quality.cost(), quality.cost);
  }
  const LineQuality& promised = best.quality.mean();
  std::printf(
      "\n%d fresh images (%.0f s): u %.4f px promised, %.4f found (%+.1f %%); coverage %.4f "
      "promised, %.4f found; inside the intervals: u %d, coverage %d, cost %d\n",
      options.fresh, watch.Seconds(), promised.u_px, Mean(u), 100 * (Mean(u) / promised.u_px - 1),
      promised.profile_coverage, Mean(coverage), in_u, in_coverage, in_cost);
  return {{"fresh", options.fresh},
          {"u_promised_px", promised.u_px},
          {"u_found_px", Mean(u)},
          {"coverage_promised", promised.profile_coverage},
          {"coverage_found", Mean(coverage)},
          {"u_inside", in_u},
          {"coverage_inside", in_coverage},
          {"cost_inside", in_cost}};
}

int Run(const Options& options) {
  PrintMachine();
  const Inspection inspection = Must(ReadInspection(options.inspection));
  const OpticsPlanning& planning = inspection.optics.value();
  const auto scene = Load(inspection);
  std::array<double, kMeasurementParameters> values{};
  for (int i = 0; i < kMeasurementParameters; ++i) {
    values[i] = inspection.domain.parameters[i].values.at(0);
  }
  const PartFrameRequest request{FromArray(values), 0, std::nullopt};
  RenderLimits limits;
  limits.threads = options.threads;
  const FrameGlance glance = Must(GlanceAtFrame(*scene, request, {}, 0, limits));
  FrameLightOptions light_options;
  light_options.limits = limits;
  light_options.margin_px = 0;
  FrameSetup frame = PartFrameSetup(inspection, request);
  for (const double n : {planning.f_numbers.front(), planning.f_numbers.back()}) {
    frame.lens.f_number = n;
    light_options.margin_px =
        std::max(light_options.margin_px,
                 LensMarginPx(frame, {}, std::vector<double>{glance.nearest_m, glance.farthest_m}));
  }
  const Stopwatch total;
  Stopwatch watch;
  double cpu = OwnCpuSeconds();
  const auto light =
      std::make_shared<const FrameLight>(Must(TraceFrameLight(*scene, request, {}, light_options)));
  const double light_s = watch.Seconds();
  std::printf(
      "%d x %d pixels, %zu crossings of the true line; light transport %.1f s (%.1f CPU s)\n",
      frame.roi.columns_px, frame.roi.rows_px, light->line.size(), light_s, OwnCpuSeconds() - cpu);
  SettingJudge judge(scene->inspection(), {}, {{light, 1}}, 1, limits);
  const ExposureGrid grid = MakeExposureGrid(judge, scene->inspection(), {});
  std::printf("\n%8s%10s%8s%9s%12s%9s%9s%9s%10s%9s\n", "f-number", "optics s", "asked", "search s",
              "best ms", "cost", "+-", "u px", "coverage", "bias");
  Json rows = Json::array();
  std::vector<JudgedSetting> curve;
  double grid_s = 0;
  for (const double n : planning.f_numbers) {
    watch = Stopwatch();
    if (const absl::Status s = judge.LookThrough({n, *frame.lens.focus_distance_m, 0, 0});
        !s.ok()) {
      Fail(kName, std::string(s.message()));
    }
    const double optics_s = watch.Seconds();
    const ExposureGrid here = AtFNumber(grid, planning.f_numbers[0], n);
    const Best best = SearchWith(judge, here, inspection.rig.laser.power_w, false);
    const LineQuality& q = best.judged.quality.mean();
    std::printf("%8.3g%10.1f%8d%9.1f%12.4g%9.4f%9.4f%9.4f%9.2f%%%9.3f\n", n, optics_s, best.asked,
                best.seconds, 1e3 * best.judged.setting.exposure_time_s, best.judged.cost(),
                best.judged.quality.CostStandardError(), q.u_px, 100 * q.profile_coverage,
                q.bias_px);
    Json row = {{"f_number", n},
                {"optics_s", optics_s},
                {"search_s", best.seconds},
                {"asked", best.asked},
                {"exposure_time_s", best.judged.setting.exposure_time_s},
                {"cost", best.judged.cost()},
                {"u_px", q.u_px},
                {"coverage", q.profile_coverage}};
    if (options.grid) {
      const Best all = SearchWith(judge, here, inspection.rig.laser.power_w, true);
      std::printf("%8s%10s%8d%9.1f%12.4g%9.4f\n", "grid", "", all.asked, all.seconds,
                  1e3 * all.judged.setting.exposure_time_s, all.judged.cost());
      row["grid_cost"] = all.judged.cost();
      row["grid_exposure_time_s"] = all.judged.setting.exposure_time_s;
      row["grid_s"] = all.seconds;
      grid_s += all.seconds;
    }
    std::fflush(stdout);
    rows.push_back(row);
    curve.push_back(best.judged);
  }
  const double total_s = total.Seconds() - grid_s;
  std::printf("\nsearch with everything before it: %.0f s; the full grids besides: %.0f s\n",
              total_s, grid_s);
  const JudgedSetting& best = *std::min_element(
      curve.begin(), curve.end(), [](const auto& a, const auto& b) { return a.cost() < b.cost(); });
  Json results = {{"light_transport_s", light_s}, {"total_s", total_s}, {"rows", rows}};
  if (options.fresh > 0) {
    results["fresh"] = CompareWithFresh(options, inspection, request, *light, best);
  }
  WriteResults(options.json, kName, results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app{"Optical planning of one frame, phase by phase."};
  sightline::bench::Options options;
  app.add_option("--json", options.json, "file for the results");
  app.add_option("--inspection", options.inspection, "with one fixed measurement")
      ->capture_default_str();
  app.add_option("--threads", options.threads)->capture_default_str();
  app.add_option("--fresh", options.fresh, "new rendered images")->capture_default_str();
  app.add_flag("!--no-grid", options.grid, "not the full grids of exposures");
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
