// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/optics/device_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/inspection/optics_planning.h"
#include "core/status/status_macros.h"
#include "planner_client/optics_client/optics_client.h"

namespace sightline {
namespace {

constexpr size_t kMostCombinations = 100000;
constexpr double kShareOfOwnView = 0.9;
// Height costs that differ by less than this fraction count as equal.
constexpr double kEqualCosts = 0.05;
// Number of frames and speckle realisations per combination, and the smallest aperture.
constexpr int kFrames = 3, kRealisations = 2;
constexpr double kLargestFNumber = 11;

// The devices as an inspection has them.
v1::Inspection InspectionOf(const DeviceCamera& camera, const DeviceLens& lens,
                            const DeviceLaser& laser, const v1::Inspection& inspection) {
  v1::Inspection devices;
  *devices.mutable_camera()->mutable_sensor() = camera.message;
  v1::Lens* to = devices.mutable_lens();
  const v1::CatalogueLens& from = lens.message;
  to->set_focal_length_m(from.focal_length_m());
  to->set_f_number(lens.lens.f_number);
  if (inspection.lens().has_focus_distance_m()) {
    to->set_focus_distance_m(inspection.lens().focus_distance_m());
  }
  if (from.has_transmission()) to->set_transmission(from.transmission());
  if (from.has_aperture_blades()) to->set_aperture_blades(from.aperture_blades());
  if (from.has_distortion()) *to->mutable_distortion() = from.distortion();
  to->set_min_f_number(lens.min_f_number);
  to->set_max_f_number(lens.max_f_number);
  if (lens.min_focus_distance_m) to->set_min_focus_distance_m(*lens.min_focus_distance_m);
  // If the stage has a scanning speed, the camera limits it too.
  const v1::CostModel& costs = inspection.costs();
  *devices.mutable_costs() = costs;
  if (camera.max_frame_rate_hz && (costs.has_frame_rate_hz() || costs.has_stage_speed_m_per_s())) {
    const double rate_hz = *camera.max_frame_rate_hz;
    devices.mutable_costs()->set_frame_rate_hz(
        costs.has_frame_rate_hz() ? std::min(rate_hz, costs.frame_rate_hz()) : rate_hz);
  }
  *devices.mutable_laser() = laser.message.laser();
  if (inspection.laser().has_distance_m()) {
    devices.mutable_laser()->set_distance_m(inspection.laser().distance_m());
  }
  return devices;
}

// The request's inspection with other devices. It keeps those stated f-numbers that the lens has,
// or else takes the lens's own.
v1::Inspection WithDevices(v1::Inspection inspection, const v1::Inspection& devices) {
  *inspection.mutable_camera() = devices.camera();
  *inspection.mutable_lens() = devices.lens();
  *inspection.mutable_laser() = devices.laser();
  *inspection.mutable_costs() = devices.costs();
  auto* f_numbers = inspection.mutable_optics()->mutable_f_numbers();
  f_numbers->erase(std::remove_if(f_numbers->begin(), f_numbers->end(),
                                  [&](double f_number) {
                                    return f_number < devices.lens().min_f_number() ||
                                           f_number > devices.lens().max_f_number();
                                  }),
                   f_numbers->end());
  return inspection;
}

// Up to kFrames evenly spaced frames of the request, as separate scans so that all are rendered.
void TakeSomeFrames(const v1::CreateOpticsRequest& all, v1::CreateOpticsRequest* some) {
  some->clear_frames();
  const int count = std::min(all.frames_size(), kFrames);
  for (int i = 0; i < count; ++i) {
    v1::PartFrame* frame = some->add_frames();
    *frame = all.frames(static_cast<int>((i + 0.5) * all.frames_size() / count));
    frame->set_scan(i + 1);
  }
  some->set_per_scan(false);
}

std::string NameOf(const v1::DeviceCombination& c) {
  return absl::StrCat(c.camera(), ", ", c.lens(), ", ", c.laser());
}

}  // namespace

void AddDeviceOptions(CLI::App& app, DeviceRequirements* requirements) {
  app.add_option("--max-footprint", requirements->max_footprint_mm,
                 "with --catalogue: largest pixel on the part [mm]");
  app.add_option("--min-view", requirements->min_view_mm,
                 "with --catalogue: least field of view along the line [mm]");
  app.add_option("--min-depth", requirements->min_depth_mm,
                 "with --catalogue: least depth of field [mm]");
  app.add_option("--max-price", requirements->max_price_eur,
                 "with --catalogue: most that the devices may cost together [EUR]");
  app.add_option("--rendered", requirements->rendered,
                 "with --catalogue: number of combinations to evaluate with rendered images")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
}

absl::StatusOr<DeviceCandidates> FindDevices(const std::string& folder,
                                             const Inspection& inspection,
                                             const v1::CreateOpticsRequest& request,
                                             const DeviceRequirements& requirements) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto catalogue, ReadCatalogue(folder));
  const size_t combinations =
      catalogue.cameras.size() * catalogue.lenses.size() * catalogue.lasers.size();
  if (combinations > kMostCombinations) {
    return absl::InvalidArgumentError(absl::StrCat(
        folder, ": has ", combinations, " combinations of devices, at most ", kMostCombinations));
  }
  const double z_m = request.frames(0).measurement().camera_distance_m();
  FitRequirements required;
  required.max_pixel_footprint_m = inspection.targets.max_pixel_footprint_m;
  if (requirements.max_footprint_mm) {
    required.max_pixel_footprint_m = 1e-3 * *requirements.max_footprint_mm;
  }
  const Camera& own = inspection.rig.camera;
  required.min_field_of_view_m = requirements.min_view_mm
                                     ? 1e-3 * *requirements.min_view_mm
                                     : kShareOfOwnView * z_m * own.columns_px / own.FocalLengthPx();
  if (requirements.min_depth_mm) required.min_depth_of_field_m = 1e-3 * *requirements.min_depth_mm;

  DeviceCandidates candidates;
  std::map<std::string, int> failed_by;
  for (const DeviceCamera& camera : catalogue.cameras) {
    for (const DeviceLens& lens : catalogue.lenses) {
      for (const DeviceLaser& laser : catalogue.lasers) {
        DeviceCandidates::Candidate candidate;
        v1::DeviceCombination& c = candidate.combination;
        c.set_camera(camera.sensor.name);
        c.set_lens(lens.name);
        c.set_laser(laser.name);
        double price = 0;
        bool priced = true;
        for (const std::optional<double>& one :
             {camera.price_eur, lens.price_eur, laser.price_eur}) {
          priced = priced && one.has_value();
          price += one.value_or(0);
        }
        if (priced) c.set_price_eur(price);
        std::vector<std::string> why = WhyUnfit(camera, lens, laser, z_m, required);
        if (priced && requirements.max_price_eur && price > *requirements.max_price_eur) {
          why.push_back(
              absl::StrFormat("costs %.0f EUR, at most %.0f", price, *requirements.max_price_eur));
        }
        if (z_m > lens.lens.focal_length_m) {
          const FieldOfView view = FieldOfViewAt(camera.sensor, lens.lens, z_m);
          c.set_field_of_view_width_m(view.width_m);
          c.set_field_of_view_height_m(view.height_m);
          c.set_pixel_footprint_m(PixelFootprint(camera.sensor, lens.lens, z_m));
        }
        if (!why.empty()) {
          c.set_lost_because(absl::StrJoin(why, "; "));
          candidates.lost.push_back(c);
          continue;
        }
        candidate.devices = InspectionOf(camera, lens, laser, request.inspection());
        candidates.rendered.push_back(std::move(candidate));
      }
    }
  }
  if (candidates.rendered.empty()) {
    std::string example;
    // The best of the unsuitable ones: the one with the fewest reasons.
    size_t fewest = std::numeric_limits<size_t>::max();
    for (const v1::DeviceCombination& c : candidates.lost) {
      const auto reasons =
          static_cast<size_t>(std::count(c.lost_because().begin(), c.lost_because().end(), ';'));
      if (reasons >= fewest) continue;
      fewest = reasons;
      example = absl::StrCat(NameOf(c), ": ", c.lost_because());
    }
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: none of its %d combinations is suitable at %.4g mm; the nearest, %s",
                        folder, static_cast<int>(candidates.lost.size()), 1e3 * z_m, example));
  }
  // Small pixels first, then cheap ones; the rest is not examined.
  std::stable_sort(
      candidates.rendered.begin(), candidates.rendered.end(), [](const auto& a, const auto& b) {
        const auto key = [](const v1::DeviceCombination& c) {
          return std::tuple(c.pixel_footprint_m(), c.price_eur() > 0 ? c.price_eur() : 1e9);
        };
        return key(a.combination) < key(b.combination);
      });
  const auto keep = static_cast<size_t>(requirements.rendered);
  for (size_t i = keep; i < candidates.rendered.size(); ++i) {
    v1::DeviceCombination lost = candidates.rendered[i].combination;
    lost.set_lost_because(absl::StrFormat(
        "fits, but %d combinations with smaller pixels on the part were rendered before it "
        "(--rendered)",
        requirements.rendered));
    candidates.lost.push_back(std::move(lost));
  }
  if (candidates.rendered.size() > keep) candidates.rendered.resize(keep);
  return candidates;
}

absl::StatusOr<ChosenDevices> ChooseDevices(const DeviceCandidates& candidates,
                                            const WorkerClientOptions& client,
                                            const v1::CreateOpticsRequest& request,
                                            const std::vector<AssetFile>& assets) {
  struct Judged {
    v1::DeviceCombination combination;
    const v1::Inspection* devices;
    double height_cost_m;
  };
  std::vector<Judged> judged;
  ChosenDevices result;
  std::vector<v1::DeviceCombination> lost = candidates.lost;
  for (size_t i = 0; i < candidates.rendered.size(); ++i) {
    const DeviceCandidates::Candidate& candidate = candidates.rendered[i];
    v1::CreateOpticsRequest one = request;
    TakeSomeFrames(request, &one);
    *one.mutable_inspection() = WithDevices(request.inspection(), candidate.devices);
    v1::OpticsPlanning* planning = one.mutable_inspection()->mutable_optics();
    planning->set_realisations(kRealisations);
    if (planning->f_numbers().empty()) {
      const v1::Lens& lens = candidate.devices.lens();
      for (const double f_number : UsualFNumbers()) {
        if (f_number >= lens.min_f_number() &&
            f_number <= std::min(lens.max_f_number(), kLargestFNumber)) {
          planning->add_f_numbers(f_number);
        }
      }
    }
    WorkerClientOptions reporting = client;
    reporting.on_progress = [&](double fraction, const std::string& message) {
      if (!client.on_progress) return;
      client.on_progress(
          (static_cast<double>(i) + fraction) / static_cast<double>(candidates.rendered.size()),
          absl::StrCat("devices ", i + 1, " of ", candidates.rendered.size(), ": ", message));
    };
    auto optics = PlanOptics(reporting, std::move(one), assets);
    v1::DeviceCombination combination = candidate.combination;
    if (!optics.ok()) {
      // The error concerns these devices, not the request: other devices may work.
      if (!absl::IsFailedPrecondition(optics.status())) return optics.status();
      combination.set_lost_because(std::string(optics.status().message()));
      lost.push_back(std::move(combination));
      continue;
    }
    const v1::OpticsPoint& best = optics->best();
    const double height_per_px = best.u_px() > 0 ? best.u_height_m() / best.u_px() : 0;
    combination.set_f_number(best.f_number());
    combination.set_exposure_time_s(best.exposure_time_s());
    combination.set_u_height_m(best.u_height_m());
    combination.set_profile_coverage(best.profile_coverage());
    combination.set_scan_time_s(best.scan_time_s());
    combination.set_cost(best.cost());
    Lens thin;
    thin.focal_length_m = candidate.devices.lens().focal_length_m();
    combination.set_depth_of_field_m(
        DepthOfFieldAt(thin, best.focus_distance_m(), best.f_number(),
                       candidate.devices.camera().sensor().pixel_pitch_m())
            .depth_m());
    judged.push_back({std::move(combination), &candidate.devices, best.cost() * height_per_px});
  }
  if (judged.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("no combination of the catalogue can be set so that the line is found; the "
                     "last: ",
                     NameOf(lost.back()), ": ", lost.back().lost_because()));
  }
  double least = std::numeric_limits<double>::infinity();
  for (const Judged& j : judged) least = std::min(least, j.height_cost_m);
  const auto order = [&](const Judged& j) {
    const bool equal = j.height_cost_m <= (1 + kEqualCosts) * least;
    return std::tuple(!equal,
                      equal && j.combination.price_eur() > 0 ? j.combination.price_eur() : 1e9,
                      equal ? j.combination.scan_time_s() : 0, j.height_cost_m);
  };
  std::stable_sort(judged.begin(), judged.end(),
                   [&](const Judged& a, const Judged& b) { return order(a) < order(b); });
  const Judged& best = judged.front();
  for (size_t i = 0; i < judged.size(); ++i) {
    v1::DeviceCombination* c = result.choice.add_combinations();
    *c = judged[i].combination;
    if (i == 0) {
      c->set_chosen(true);
      continue;
    }
    const double ratio = judged[i].height_cost_m / best.height_cost_m;
    if (ratio > 1 + kEqualCosts) {
      c->set_lost_because(absl::StrFormat(
          "its optical cost as height, %.3g um, is %.0f %% above that of the chosen ones",
          1e6 * judged[i].height_cost_m, 100 * (ratio - 1)));
    } else if (c->price_eur() > best.combination.price_eur()) {
      c->set_lost_because(absl::StrFormat("as good, but %.0f EUR dearer",
                                          c->price_eur() - best.combination.price_eur()));
    } else {
      c->set_lost_because(absl::StrFormat(
          "as good (%.3g um against %.3g um as height); prices and times do not differ",
          1e6 * judged[i].height_cost_m, 1e6 * best.height_cost_m));
    }
  }
  for (const v1::DeviceCombination& c : lost) *result.choice.add_combinations() = c;
  result.inspection = WithDevices(request.inspection(), *best.devices);
  return result;
}

}  // namespace sightline
