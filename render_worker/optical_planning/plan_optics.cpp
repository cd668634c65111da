// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/plan_optics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/image_file/grey_png.h"
#include "render_worker/optical_planning/choose_setting.h"
#include "render_worker/optical_planning/lens_image.h"
#include "render_worker/optical_planning/optics_answer.h"
#include "render_worker/optical_planning/representative_frames.h"
#include "render_worker/render/part_view.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

constexpr char kNoLine[] = "NO_LINE";
// Largest number of evenly spaced frames of a scan that are evaluated coarsely; more add nothing.
constexpr int kMostGlances = 64;
// Larger single frames are cut to the rows about their line, as those of scans are.
constexpr int64_t kWholeFramePixels = int64_t{1} << 20;
// Margin around the line, so that false lines next to it are seen.
constexpr int kRoiMargin_px = 48;
// Frames of all scans together that one common setting is chosen by.
constexpr int kCommonFrames = 16;
// A scan's own best f-number costs at most this much more than the common best, for all scans
// together.
constexpr double kWorthTrying = 1.6;
// Approximate fractions of the work on a group of frames: tracing their light, the choice, and the
// frames with the chosen setting. The rest is the frame that checks them.
constexpr double kShareOfTracing = 0.2, kShareOfChoice = 0.75, kShareOfFrames = 0.025;
constexpr int kPictureColumns_px = 384, kPictureRows_px = 128;
// Below this fraction the frames represent their scan poorly.
constexpr double kPoorlyRepresented = 0.5;

bool IsCancelled(const RenderLimits& limits) {
  return limits.cancelled != nullptr && *limits.cancelled;
}

// A frame with its coarse evaluation.
struct SeenFrame {
  const OpticsTask::Frame* frame = nullptr;
  FrameGlance glance;
};

struct Scan {
  int number = 0;
  int frames = 0;  // in all
  double travel_m = 0;
  std::vector<SeenFrame> seen;  // some of them, evenly spaced
  double lit_samples = 0;       // of those seen, times frames over seen

  bool lit() const { return lit_samples > 0; }
};

// A frame that represents others, with the length of line that it represents.
struct ChosenFrame {
  const SeenFrame* seen = nullptr;
  int scan = 0;
  double share = 0;        // of its scan
  double lit_samples = 0;  // it stands for
};

// Frames that get one setting.
struct FrameGroup {
  int scan = 0;  // 0: several
  std::vector<ChosenFrame> frames;
  double represented_fraction = 1;
  const SeenFrame* check = nullptr;  // the one least like them; of a single scan
  SettingGroup setting;
};

class OpticsPlanner {
 public:
  OpticsPlanner(PartScene& scene, std::span<const ActiveEffect> effects, const OpticsTask& task,
                const OpticsHooks& hooks)
      : scene_(scene),
        inspection_(scene.inspection()),
        planning_(*inspection_.optics),
        effects_(effects),
        task_(task),
        hooks_(hooks) {}

  absl::StatusOr<v1::OpticsPlan> Run() {
    const FrameSetup nominal = PartFrameSetup(inspection_, task_.frames[0].request);
    SIGHTLINE_RETURN_IF_ERROR(CheckEffectsActOnParts(nominal, effects_));
    v1::OpticsPlan plan;
    plan.set_inspection_name(inspection_.name);
    plan.set_seed(static_cast<int64_t>(task_.seed));
    for (const std::string& warning : ScaleWarnings(scene_, nominal)) plan.add_warnings(warning);
    SIGHTLINE_RETURN_IF_ERROR(LookAtScans(&plan));

    std::vector<FrameGroup> groups;
    if (scans_.size() > 1) groups.push_back(GroupOf(All(), FramesPerScanTogether()));
    if (scans_.size() == 1 || task_.per_scan) {
      for (const Scan& scan : scans_) {
        groups.push_back(GroupOf({&scan}, planning_.frames_per_scan));
      }
    }
    for (size_t g = 0; g < groups.size(); ++g) {
      done_ = 0.05 + 0.95 * static_cast<double>(g) / static_cast<double>(groups.size());
      share_ = 0.95 / static_cast<double>(groups.size());
      auto choice = Choose(groups[g], &plan);
      if (ErrorReason(choice.status()) == kNoLine && groups[g].scan != 0 && groups.size() > 1) {
        plan.add_warnings(absl::StrCat("scan ", groups[g].scan, ": ", choice.status().message()));
        continue;
      }
      if (!choice.ok()) return choice.status();
      if (groups[g].scan == 0 || groups.size() == 1) {
        *plan.mutable_common() = *choice;
        plan.mutable_common()->set_scan(0);
      }
      if (groups[g].scan != 0 && groups.size() > 1) *plan.add_scans() = *std::move(choice);
    }
    if (!poorly_represented_.empty()) {
      plan.add_warnings(absl::StrFormat(
          "%s: the rendered frames represent less than %.0f %% of the variance between the scan's "
          "frames (represented_fraction); increase optics.frames_per_scan",
          absl::StrJoin(poorly_represented_, ", "), 100 * kPoorlyRepresented));
    }
    *plan.mutable_best() = plan.common().best();
    *plan.mutable_curve() = plan.common().curve();
    plan.set_evaluated_images(evaluated_images_);
    return plan;
  }

 private:
  void Say(double fraction, const std::string& message) const {
    if (hooks_.on_progress) hooks_.on_progress(std::clamp(fraction, 0.0, 1.0), message);
  }

  // A coarse look at every scan; those without light are left out, with a warning.
  absl::Status LookAtScans(v1::OpticsPlan* plan) {
    std::vector<int> numbers;
    for (const OpticsTask::Frame& frame : task_.frames) {
      if (std::find(numbers.begin(), numbers.end(), frame.scan) == numbers.end()) {
        numbers.push_back(frame.scan);
      }
    }
    for (size_t n = 0; n < numbers.size(); ++n) {
      std::vector<const OpticsTask::Frame*> frames;
      for (const OpticsTask::Frame& frame : task_.frames) {
        if (frame.scan == numbers[n]) frames.push_back(&frame);
      }
      Scan scan;
      scan.number = numbers[n];
      scan.frames = static_cast<int>(frames.size());
      const auto [first, last] =
          std::minmax_element(frames.begin(), frames.end(), [](const auto* a, const auto* b) {
            return a->request.stage_position_m < b->request.stage_position_m;
          });
      if (frames.size() > 1) {
        scan.travel_m = (*last)->request.stage_position_m - (*first)->request.stage_position_m;
      }
      const int glances = std::min(scan.frames, kMostGlances);
      for (int i = 0; i < glances; ++i) {
        if (IsCancelled(hooks_.limits)) return absl::CancelledError("cancelled");
        Say(0.05 * (static_cast<double>(n) + static_cast<double>(i) / glances) /
                static_cast<double>(numbers.size()),
            "looking at the frames");
        SeenFrame seen;
        seen.frame = frames[static_cast<size_t>((i + 0.5) * scan.frames / glances)];
        SIGHTLINE_ASSIGN_OR_RETURN(seen.glance, GlanceAtFrame(scene_, seen.frame->request, effects_,
                                                              kRoiMargin_px, hooks_.limits));
        scan.lit_samples += seen.glance.lit_samples;
        scan.seen.push_back(seen);
      }
      scan.lit_samples *= static_cast<double>(scan.frames) / glances;
      if (scan.lit()) {
        scans_.push_back(std::move(scan));
      } else {
        plan->add_warnings(absl::StrCat("scan ", scan.number,
                                        ": the laser lights nothing that the camera sees; the "
                                        "choice leaves the scan out"));
      }
    }
    if (!scans_.empty()) return absl::OkStatus();
    return WithErrorInfo(absl::FailedPreconditionError(
                             task_.frames.size() == 1
                                 ? "the laser lights nothing that the camera sees in this frame"
                                 : "the laser lights nothing that the camera sees, in any frame"),
                         kNoLine);
  }

  int FramesPerScanTogether() const {
    return std::clamp(kCommonFrames / static_cast<int>(scans_.size()), 1,
                      planning_.frames_per_scan);
  }

  std::vector<const Scan*> All() const {
    std::vector<const Scan*> all;
    for (const Scan& scan : scans_) all.push_back(&scan);
    return all;
  }

  FrameGroup GroupOf(const std::vector<const Scan*>& scans, int frames_per_scan) const {
    FrameGroup group;
    group.scan = scans.size() == 1 ? scans[0]->number : 0;
    double represented = 0, lit = 0;
    for (const Scan* scan : scans) {
      std::vector<FrameGlance> glances;
      for (const SeenFrame& seen : scan->seen) glances.push_back(seen.glance);
      const Representatives chosen = ChooseRepresentatives(glances, frames_per_scan);
      for (const Representatives::Frame& frame : chosen.frames) {
        group.frames.push_back({&scan->seen[static_cast<size_t>(frame.index)], scan->number,
                                frame.weight, frame.weight * scan->lit_samples});
      }
      if (scans.size() == 1 && chosen.farthest >= 0) {
        group.check = &scan->seen[static_cast<size_t>(chosen.farthest)];
      }
      represented += scan->lit_samples * chosen.represented_fraction;
      lit += scan->lit_samples;
      group.setting.travel_m += scan->travel_m;
    }
    group.represented_fraction = represented / lit;
    return group;
  }

  // Margin that all settings of the search need.
  int Margin(const FrameGroup& group) const {
    std::vector<double> depths;
    for (const ChosenFrame& chosen : group.frames) {
      depths.push_back(chosen.seen->glance.nearest_m);
      depths.push_back(chosen.seen->glance.farthest_m);
    }
    FrameSetup frame = PartFrameSetup(inspection_, group.frames[0].seen->frame->request);
    std::vector<double> focus = {*frame.lens.focus_distance_m};
    if (planning_.focus_distance_m) {
      focus = planning_.focus_distance_m->values;
      if (planning_.focus_distance_m->is_range()) {
        focus = {planning_.focus_distance_m->min, planning_.focus_distance_m->max};
      }
    }
    int margin = 0;
    for (const double f_number : {planning_.f_numbers.front(), planning_.f_numbers.back()}) {
      for (const double distance : focus) {
        frame.lens.f_number = f_number;
        frame.lens.focus_distance_m = distance;
        margin =
            std::max(margin, LensMarginPx(ApplyFrameEffects(frame, effects_), effects_, depths));
      }
    }
    return margin;
  }

  // Traces the light of the group's frames, weighted so that sums over them represent the whole.
  // Frames whose coarse evaluation mistook something else for a line leave the group; NO_LINE if
  // all do. Progress runs from `begin` over `share`, as fractions of the group's work.
  absl::StatusOr<std::vector<WeightedFrame>> Trace(FrameGroup& group, double begin, double share) {
    FrameLightOptions options;
    options.margin_px = Margin(group);
    options.limits = hooks_.limits;
    // A single small frame is evaluated as a whole, others about their line.
    const int64_t pixels =
        int64_t{inspection_.rig.camera.columns_px} * inspection_.rig.camera.rows_px;
    const bool whole = task_.frames.size() == 1 && pixels <= kWholeFramePixels;
    std::vector<ChosenFrame> kept;
    std::vector<WeightedFrame> traced;
    absl::Status none;
    for (size_t f = 0; f < group.frames.size(); ++f) {
      const ChosenFrame& chosen = group.frames[f];
      const std::string what =
          absl::StrFormat("light of scan %d, frame %d", chosen.scan, chosen.seen->frame->frame);
      options.limits.progress = [&, f](double fraction) {
        Say(done_ + share_ * (begin + share * (static_cast<double>(f) + fraction) /
                                          static_cast<double>(group.frames.size())),
            what);
      };
      options.limits.progress(0);
      if (!whole) options.roi = chosen.seen->glance.roi;
      auto light = TraceFrameLight(scene_, chosen.seen->frame->request, effects_, options);
      if (ErrorReason(light.status()) == kNoLine) {
        none = light.status();
        continue;
      }
      if (!light.ok()) return light.status();
      const double weight =
          chosen.lit_samples / std::max<double>(1, chosen.seen->glance.lit_samples);
      traced.push_back({std::make_shared<const FrameLight>(*std::move(light)), weight});
      kept.push_back(chosen);
    }
    if (traced.empty()) return none;
    group.frames = std::move(kept);
    // Relative weights count; those of a single frame are 1.
    double sum = 0;
    for (const WeightedFrame& frame : traced) sum += frame.weight;
    for (WeightedFrame& frame : traced) {
      frame.weight *= static_cast<double>(traced.size()) / sum;
    }
    return traced;
  }

  // Motion of the image per travel of the stage, the fastest of the group's scans.
  double ImageSpeed_px_per_m(const FrameGroup& group) const {
    double fastest = 0;
    for (const ChosenFrame& chosen : group.frames) {
      const FrameSetup nominal = PartFrameSetup(inspection_, chosen.seen->frame->request);
      const FrameSetup frame = ApplyFrameEffects(nominal, effects_);
      const TrueGeometry truth = WithGeometryErrors(
          inspection_.rig, chosen.seen->frame->request.measurement, nominal, frame);
      fastest = std::max(fastest, ImageMotion(truth, frame, 1).norm() / frame.sensor.pixel_pitch_m);
    }
    return fastest;
  }

  // Default focus distance: the inspection's; else, for a single scan, its camera distance,
  // and for several scans the distance with the least defocus of their lines (mean of
  // 1/depth).
  double StatedFocus_m(const FrameGroup& group, const std::vector<WeightedFrame>& traced) const {
    const std::optional<double>& stated = inspection_.rig.lens->focus_distance_m;
    if (stated) return *stated;
    if (group.scan != 0) {
      return group.frames[0].seen->frame->request.measurement.camera_distance_m;
    }
    double weights = 0, inverse = 0;
    for (const WeightedFrame& frame : traced) {
      const double weight = frame.weight * static_cast<double>(frame.light->line.size());
      weights += weight;
      inverse += weight / frame.light->median_line_depth_m;
    }
    return RoundTo4Digits(weights / inverse);
  }

  // Height of a pixel of u_px, mean over the line of the group's frames.
  double MeanHeightPerPixel(const FrameGroup& group,
                            const std::vector<WeightedFrame>& traced) const {
    double weights = 0, sum = 0;
    for (size_t f = 0; f < traced.size(); ++f) {
      const FrameLight& light = *traced[f].light;
      const double weight = traced[f].weight * static_cast<double>(light.line.size());
      weights += weight;
      sum +=
          weight * HeightPerPixel(PartFrameSetup(inspection_, group.frames[f].seen->frame->request),
                                  light.median_line_depth_m);
    }
    return sum / weights;
  }

  // All at first; for single scans those that are not out of the question for all scans together.
  std::vector<double> FNumbers(const v1::OpticsPlan& plan) const {
    if (!plan.has_common()) return planning_.f_numbers;
    std::vector<double> f_numbers;
    for (const v1::OpticsPoint& point : plan.common().curve()) {
      if (point.cost() <= kWorthTrying * plan.common().best().cost()) {
        f_numbers.push_back(point.f_number());
      }
    }
    return f_numbers;
  }

  absl::StatusOr<v1::OpticsChoice> Choose(FrameGroup& group, v1::OpticsPlan* plan) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto traced, Trace(group, 0, kShareOfTracing));
    group.setting.image_speed_px_per_m = ImageSpeed_px_per_m(group);
    group.setting.stated_focus_m = StatedFocus_m(group, traced);
    group.setting.f_numbers = FNumbers(*plan);
    const double height_per_px = MeanHeightPerPixel(group, traced);
    SettingJudge judge(inspection_, effects_, std::move(traced), task_.seed, hooks_.limits);
    const ExposureLimit limit = LimitExposure(inspection_.stated_costs, inspection_.rig.scan_step_m,
                                              planning_, group.setting.image_speed_px_per_m);
    const ExposureGrid grid = MakeExposureGrid(judge, inspection_, limit);
    const std::string name =
        group.scan == 0 ? "one setting for all scans" : absl::StrCat("scan ", group.scan);
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto choice, ChooseSetting(judge, inspection_, group.setting, grid, [&](double fraction) {
          Say(done_ + share_ * (kShareOfTracing + kShareOfChoice * fraction), name);
        }));
    v1::OpticsChoice answer = ChoiceToProto(choice, inspection_, group.setting, height_per_px);
    answer.set_scan(group.scan);
    answer.set_represented_fraction(group.represented_fraction);
    judge.ReportTo([&](double fraction) {
      Say(done_ + share_ * (kShareOfTracing + kShareOfChoice + kShareOfFrames * fraction), name);
    });
    SIGHTLINE_RETURN_IF_ERROR(AddFrames(group, judge, choice.chosen(), &answer));
    judge.ReportTo({});
    SIGHTLINE_RETURN_IF_ERROR(AddDetection(judge, choice.chosen(), &answer));
    SIGHTLINE_RETURN_IF_ERROR(AddCheck(group, choice.chosen(), &answer));
    evaluated_images_ += judge.judged_images();
    if (group.represented_fraction < kPoorlyRepresented) poorly_represented_.push_back(name);
    for (const FNumberChoice& here : choice.curve) {
      if (here.refused.empty()) continue;
      plan->add_warnings(
          absl::StrFormat("%s: f/%.3g is left out: %s", name, here.f_number, here.refused));
    }
    return answer;
  }

  // The group's frames with the setting chosen, with a picture of each.
  absl::Status AddFrames(const FrameGroup& group, SettingJudge& judge, const JudgedSetting& best,
                         v1::OpticsChoice* answer) {
    SIGHTLINE_RETURN_IF_ERROR(judge.LookThrough(best.setting.lens));
    const LineCost cost{planning_.prior_uncertainty_px, planning_.false_line_weight,
                        planning_.max_clipped_fraction};
    for (size_t f = 0; f < group.frames.size(); ++f) {
      const ChosenFrame& chosen = group.frames[f];
      const FrameLight& light = *judge.frames()[f].light;
      const LineQuality quality = QualityOf(best.frames[f], cost);
      const FrameSetup setup = judge.Setup(f, best.setting, 0);
      v1::RepresentativeFrame* entry = answer->add_frames();
      entry->set_scan(chosen.scan);
      entry->set_frame(chosen.seen->frame->frame);
      entry->set_stage_position_m(chosen.seen->frame->request.stage_position_m);
      entry->set_weight(chosen.share);
      entry->set_line_points(static_cast<int64_t>(light.line.size()));
      entry->set_u_px(quality.u_px);
      entry->set_profile_coverage(quality.profile_coverage);
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto picture,
          Picture(ReadOut(judge.light(f), setup, effects_, nullptr).raw_dn, setup, light));
      entry->set_picture_png(std::move(picture));
    }
    return absl::OkStatus();
  }

  // Adds the detection table that planning of the geometry reads. The judge looks through the
  // chosen lens.
  static absl::Status AddDetection(SettingJudge& judge, const JudgedSetting& best,
                                   v1::OpticsChoice* answer) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto blocks, judge.DetectedBlocks(best.setting));
    const std::optional<DetectionNoise> noise = LearnDetectionNoise(blocks);
    if (!noise) return absl::OkStatus();
    *answer->mutable_detection() =
        DetectionToProto(*noise, blocks, static_cast<int>(judge.frames().size()));
    return absl::OkStatus();
  }

  // The frame least like those that were evaluated, with the chosen setting.
  absl::Status AddCheck(const FrameGroup& group, const JudgedSetting& best,
                        v1::OpticsChoice* answer) {
    if (group.check == nullptr) return absl::OkStatus();
    FrameGroup one;
    one.scan = group.scan;
    one.frames.push_back(
        {group.check, group.scan, 0, static_cast<double>(group.check->glance.lit_samples)});
    constexpr double kBefore = kShareOfTracing + kShareOfChoice + kShareOfFrames;
    auto traced = Trace(one, kBefore, 1 - kBefore);
    if (ErrorReason(traced.status()) == kNoLine) return absl::OkStatus();
    if (!traced.ok()) return traced.status();
    SettingJudge judge(inspection_, effects_, *std::move(traced), task_.seed, hooks_.limits);
    SIGHTLINE_RETURN_IF_ERROR(judge.LookThrough(best.setting.lens));
    const std::vector<std::pair<double, double>> exposures = {
        {best.setting.exposure_time_s, best.setting.second_exposure_time_s}};
    SIGHTLINE_ASSIGN_OR_RETURN(auto judged,
                               judge.JudgePairs(exposures, best.setting.laser_power_w));
    v1::OpticsChoice alone;
    SIGHTLINE_RETURN_IF_ERROR(AddFrames(one, judge, judged.front(), &alone));
    *answer->mutable_check() = alone.frames(0);
    evaluated_images_ += judge.judged_images();
    return absl::OkStatus();
  }

  // The part of an image with most of the line, from black level to the brightest tenth of a per
  // cent, in square-root steps as the eye sees it. Of Bayer sensors the detected channel alone.
  absl::StatusOr<std::string> Picture(const Image<uint16_t>& raw_dn, const FrameSetup& frame,
                                      const FrameLight& light) const {
    const DetectionPlan plan = PlanDetection(frame, planning_.detector);
    const PixelPlane& plane = plan.planes[0];
    const Image<float> values = PlaneValues(raw_dn, plane);
    const int columns = std::min(kPictureColumns_px, values.columns_px);
    const int rows = std::min(kPictureRows_px, values.rows_px);
    // About the median crossing.
    std::vector<LineCrossing> line = light.line;
    std::nth_element(
        line.begin(), line.begin() + static_cast<std::ptrdiff_t>(line.size() / 2), line.end(),
        [](const LineCrossing& a, const LineCrossing& b) { return a.column_px < b.column_px; });
    const LineCrossing& middle = line[line.size() / 2];
    const int left =
        std::clamp(middle.column_px / plane.step - columns / 2, 0, values.columns_px - columns);
    const int top = std::clamp(static_cast<int>(middle.row_px) / plane.step - rows / 2, 0,
                               values.rows_px - rows);
    std::vector<float> sorted(values.values.begin(), values.values.end());
    const auto bright = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() * 999 / 1000);
    std::nth_element(sorted.begin(), bright, sorted.end());
    const double black = DarkMeanDn(frame.sensor);
    const double range = std::max<double>(*bright - black, 1);
    Image<uint8_t> grey(columns, rows);
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        const double part = std::clamp((values.At(top + i, left + j) - black) / range, 0.0, 1.0);
        grey.At(i, j) = static_cast<uint8_t>(std::lround(255 * std::sqrt(part)));
      }
    }
    return EncodeGreyPng(grey);
  }

  PartScene& scene_;
  const Inspection& inspection_;
  const OpticsPlanning& planning_;
  std::span<const ActiveEffect> effects_;
  const OpticsTask& task_;
  const OpticsHooks& hooks_;
  std::vector<Scan> scans_;
  double done_ = 0, share_ = 1;  // of the whole, before and for the group at work
  int64_t evaluated_images_ = 0;
  std::vector<std::string> poorly_represented_;
};

}  // namespace

absl::StatusOr<v1::OpticsPlan> PlanOptics(PartScene& scene, std::span<const ActiveEffect> effects,
                                          const OpticsTask& task, const OpticsHooks& hooks) {
  return OpticsPlanner(scene, effects, task, hooks).Run();
}

}  // namespace sightline
