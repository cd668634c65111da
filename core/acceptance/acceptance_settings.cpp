// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/acceptance_settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/field_limits/field_checks.h"
#include "core/spelling/nearest_name.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kSize{0, 10, " m", true};
constexpr Limits kPermitted{0, 1, " m", true};
constexpr Limits kRuns{20, 10000, ""};
constexpr Limits kExposureTime{0, 1000, " s", true};

// Default sizes, relative to the width of the field.
constexpr double kSphereOfField = 0.2, kBarOfField = 0.6, kPlateOfField = 0.7, kRingOfField = 0.25;
// Default side of the hole pattern relative to the field, and its least side in bore diameters.
constexpr double kPatternOfField = 0.6, kLeastPitch = 1.1;
// Most reductions by a tenth of an artefact whose default size does not fit.
constexpr int kShrinks = 30;

absl::StatusOr<PermittedError> ParseLimit(const v1::AcceptanceLimit& message, const Checker& check,
                                          const std::string& field) {
  std::vector<std::string> names;
  for (const AcceptanceQuantityInfo& info : AcceptanceQuantities()) {
    names.emplace_back(info.name);
    if (message.quantity() != info.name) continue;
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(field + ".permitted_m", message.permitted_m(), kPermitted));
    return PermittedError{info.kind, message.permitted_m()};
  }
  if (message.quantity().empty()) return check.Error(field + ".quantity", "is missing");
  const std::string nearest = LikelyName(message.quantity(), names);
  std::string known;
  for (const std::string& name : names) absl::StrAppend(&known, known.empty() ? "" : ", ", name);
  return check.Error(field + ".quantity",
                     absl::StrCat("is \"", message.quantity(), "\", must be one of ", known,
                                  nearest.empty() ? "" : ": did you mean " + nearest + "?"));
}

double NearestIn(const ParameterDomain& domain, double wanted) {
  if (domain.Contains(wanted)) return wanted;
  double best = std::numeric_limits<double>::quiet_NaN();
  double least = std::numeric_limits<double>::infinity();
  const auto offer = [&](double value) {
    double off = std::abs(value - wanted);
    if (domain.periodic) off = std::min(off, std::abs(2 * std::numbers::pi - off));
    if (off < least) best = value, least = off;
  };
  for (const double value : domain.values) offer(value);
  for (const ParameterDomain::Range& range : domain.ranges) {
    offer(range.min);
    offer(range.max);
  }
  return best;
}

using MakeArtefacts = std::function<std::vector<Artefact>(double size_m)>;

struct SizedArtefact {
  const char* field;
  const char* what;
  std::optional<double> stated_m;
  double default_m;
  MakeArtefacts make;
};

// OK if all of them fit; ball bars that cannot be inclined are left out of `fitting`.
absl::Status FittingOf(const std::vector<Artefact>& made, const Rig& rig,
                       const ScanGeometry& geometry, const SightLimits& limits,
                       std::vector<Artefact>* fitting, std::vector<std::string>* left_out) {
  fitting->clear();
  left_out->clear();
  for (size_t i = 0; i < made.size(); ++i) {
    const absl::Status fits = FitsIntoField(rig, geometry, made[i], limits);
    if (fits.ok()) {
      fitting->push_back(made[i]);
    } else if (made[i].kind == ArtefactKind::kBallBar && i + 1 == made.size()) {
      left_out->push_back(absl::StrCat(made[i].name, " is left out: ", fits.message()));
    } else {
      return absl::Status(fits.code(), absl::StrCat(made[i].name, ": ", fits.message()));
    }
  }
  return absl::OkStatus();
}

std::string MillimetreText(double length_m) { return absl::StrFormat("%.4g mm", 1e3 * length_m); }

absl::Status AddFitting(const SizedArtefact& sized, const Rig& rig, const ScanGeometry& geometry,
                        const SightLimits& limits, const std::string& context, double field_width_m,
                        ArtefactChoice* choice) {
  double size_m = sized.stated_m.value_or(sized.default_m);
  std::vector<Artefact> fitting;
  std::vector<std::string> left_out;
  absl::Status fits;
  for (int i = 0; i <= kShrinks; ++i) {
    fits = FittingOf(sized.make(size_m), rig, geometry, limits, &fitting, &left_out);
    // A bar of default length is shortened until its inclined position fits too.
    if ((fits.ok() && (left_out.empty() || sized.stated_m)) || sized.stated_m || i == kShrinks) {
      break;
    }
    size_m *= 0.9;
  }
  const Checker check(context);
  if (!fits.ok()) {
    return check.Error(
        absl::StrCat("acceptance.", sized.field),
        absl::StrCat(sized.stated_m ? absl::StrCat("is ", NumberText(size_m), " m: the ")
                                    : absl::StrCat("has no default: even ", MillimetreText(size_m),
                                                   " are too large: the "),
                     sized.what, " does not fit into the field, ", MillimetreText(field_width_m),
                     " wide along the laser line (", fits.message(), ")"));
  }
  choice->artefacts.insert(choice->artefacts.end(), fitting.begin(), fitting.end());
  choice->warnings.insert(choice->warnings.end(), left_out.begin(), left_out.end());
  return absl::OkStatus();
}

// The pattern has bores like the ring and the largest side of the field that fits.
void AddHolePattern(const Rig& rig, const ScanGeometry& geometry, const SightLimits& limits,
                    double field_width_m, ArtefactChoice* choice) {
  const double diameter_m = 2 * choice->artefacts.back().surfaces.front().nominal.radius_m;
  const double least_m = kLeastPitch * diameter_m;
  absl::Status fits = absl::OutOfRangeError("the field is too narrow for two bores");
  for (double side_m = kPatternOfField * field_width_m; side_m >= least_m; side_m *= 0.9) {
    const Artefact pattern = MakeHolePattern(geometry, side_m, diameter_m);
    fits = FitsIntoField(rig, geometry, pattern, limits);
    if (!fits.ok()) continue;
    choice->artefacts.push_back(pattern);
    return;
  }
  choice->warnings.push_back(
      absl::StrCat("hole pattern in two set-ups is left out: no pattern with bores of ",
                   MillimetreText(diameter_m), " fits (", fits.message(),
                   "); acceptance.ring_diameter_m sets ", "their diameter"));
}

}  // namespace

absl::StatusOr<AcceptanceSettings> ParseAcceptance(const v1::Acceptance& message,
                                                   const std::string& context) {
  const Checker check(context);
  AcceptanceSettings settings;
  const auto size = [&](bool given, double value_m, const char* field,
                        std::optional<double>* target) -> absl::Status {
    if (!given) return absl::OkStatus();
    *target = value_m;
    return check.Range(absl::StrCat("acceptance.", field), value_m, kSize);
  };
  SIGHTLINE_RETURN_IF_ERROR(size(message.has_sphere_diameter_m(), message.sphere_diameter_m(),
                                 "sphere_diameter_m", &settings.sphere_diameter_m));
  SIGHTLINE_RETURN_IF_ERROR(size(message.has_ball_bar_length_m(), message.ball_bar_length_m(),
                                 "ball_bar_length_m", &settings.ball_bar_length_m));
  SIGHTLINE_RETURN_IF_ERROR(size(message.has_plate_side_m(), message.plate_side_m(), "plate_side_m",
                                 &settings.plate_side_m));
  SIGHTLINE_RETURN_IF_ERROR(size(message.has_ring_diameter_m(), message.ring_diameter_m(),
                                 "ring_diameter_m", &settings.ring_diameter_m));
  for (int i = 0; i < message.limits_size(); ++i) {
    const std::string field = absl::StrCat("acceptance.limits[", i, "]");
    SIGHTLINE_ASSIGN_OR_RETURN(const auto limit, ParseLimit(message.limits(i), check, field));
    for (const PermittedError& other : settings.limits) {
      if (other.kind == limit.kind) {
        return check.Error(field + ".quantity", absl::StrCat("is \"", message.limits(i).quantity(),
                                                             "\", which has a limit already"));
      }
    }
    settings.limits.push_back(limit);
  }
  if (message.has_runs()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("acceptance.runs", message.runs(), kRuns));
    settings.runs = message.runs();
  }
  if (message.has_seed()) settings.seed = static_cast<uint64_t>(message.seed());
  if (message.has_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("acceptance.exposure_time_s", message.exposure_time_s(), kExposureTime));
    settings.exposure_time_s = message.exposure_time_s();
  }
  if (message.has_place()) {
    settings.place = MeasurementFromProto(message.place());
    const MeasurementDomain domain = ThesisDomain();
    const auto values = ToArray(*settings.place);
    for (const int i : {kCameraDistance, kTriangulationAngle, kCameraAzimuth, kCameraPolar}) {
      if (!domain.parameters[i].Contains(values[i])) {
        return check.Error(
            absl::StrCat("acceptance.place.", kMeasurementParameterNames[i]),
            absl::StrCat("is ", NumberText(i == kCameraDistance ? values[i] : Degrees(values[i])),
                         ", which is outside what a rig can be set to (thesis "
                         "Table 2.1)"));
      }
    }
  }
  return settings;
}

Measurement PlaceOfSensors(const AcceptanceSettings& settings, const MeasurementDomain& domain) {
  Measurement place;
  if (settings.place) {
    place = *settings.place;
  } else {
    place.camera_distance_m = NearestIn(domain.parameters[kCameraDistance], 0.4);
    place.triangulation_angle_rad = NearestIn(domain.parameters[kTriangulationAngle], Radians(30));
    place.camera_azimuth_rad = NearestIn(domain.parameters[kCameraAzimuth], 0);
    place.camera_polar_rad =
        NearestIn(domain.parameters[kCameraPolar], 0.5 * place.triangulation_angle_rad);
  }
  place.part_alpha_rad = place.part_beta_rad = place.part_gamma_rad = 0;
  place.offset_y_m = place.offset_z_m = 0;
  return place;
}

double FieldWidth(const Rig& rig, const Measurement& place) {
  return place.camera_distance_m * rig.camera.columns_px / rig.camera.FocalLengthPx();
}

absl::StatusOr<ArtefactChoice> ChooseArtefacts(const AcceptanceSettings& settings, const Rig& rig,
                                               const ScanGeometry& geometry,
                                               const SightLimits& limits,
                                               const std::string& context) {
  if (std::abs(geometry.sheet_normal.x()) <= 1e-6) {
    return Checker(context).Error("acceptance.place.camera_azimuth_deg",
                                  "puts the laser sheet along the direction of the stage: such a "
                                  "scan measures nothing");
  }
  const double width_m =
      geometry.camera.origin_m.norm() * rig.camera.columns_px / rig.camera.FocalLengthPx();
  double sphere_m = settings.sphere_diameter_m.value_or(kSphereOfField * width_m);
  ArtefactChoice choice;
  const auto add = [&](const SizedArtefact& sized) {
    return AddFitting(sized, rig, geometry, limits, context, width_m, &choice);
  };
  SIGHTLINE_RETURN_IF_ERROR(
      add({"sphere_diameter_m", "sphere", settings.sphere_diameter_m, sphere_m,
           [&](double size_m) { return std::vector{MakeSphere(geometry, size_m)}; }}));
  sphere_m = 2 * choice.artefacts.back().surfaces.front().nominal.radius_m;
  SIGHTLINE_RETURN_IF_ERROR(
      add({"ball_bar_length_m", "ball bar", settings.ball_bar_length_m, kBarOfField * width_m,
           [&](double size_m) { return MakeBallBars(geometry, size_m, sphere_m); }}));
  SIGHTLINE_RETURN_IF_ERROR(
      add({"plate_side_m", "flat plate", settings.plate_side_m, kPlateOfField * width_m,
           [&](double size_m) { return std::vector{MakePlate(size_m)}; }}));
  SIGHTLINE_RETURN_IF_ERROR(
      add({"ring_diameter_m", "ring gauge", settings.ring_diameter_m, kRingOfField * width_m,
           [&](double size_m) { return std::vector{MakeRing(geometry, size_m)}; }}));
  AddHolePattern(rig, geometry, limits, width_m, &choice);
  return choice;
}

}  // namespace sightline
