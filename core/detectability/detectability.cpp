// SPDX-License-Identifier: Apache-2.0
#include "core/detectability/detectability.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kDetectedFraction{0, 1, "", true};
constexpr Limits kTableDistance{0, 100, " m", true};
constexpr Limits kTableIncidence{0, 90, " deg"};
constexpr Limits kTableAzimuth{0, 180, " deg"};
// A time that shows the line; infinity is allowed: no such time.
constexpr Limits kTableTime{0, std::numeric_limits<double>::infinity(), " s", true};
constexpr int64_t kMostEntries = 1 << 16;
constexpr int kMostMaterials = 64;
// Sines of both incidences below which the azimuth has no meaning.
constexpr double kLeastSine = 1e-9;

template <typename Values>
absl::Status CheckTableAxis(const Checker& check, const std::string& path, const Values& values,
                            const Limits& limits) {
  if (values.empty()) return check.Error(path, "is missing");
  for (int i = 0; i < values.size(); ++i) {
    const std::string field = absl::StrCat(path, "[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(check.Range(field, values[i], limits));
    if (i > 0 && values[i] <= values[i - 1]) {
      return check.Error(field, absl::StrCat("is ", NumberText(values[i]), ", must be above ",
                                             NumberText(values[i - 1]), " before it"));
    }
  }
  return absl::OkStatus();
}

template <typename Values>
std::vector<double> TableRadians(const Values& degrees) {
  std::vector<double> radians;
  for (const double angle : degrees) radians.push_back(Radians(angle));
  return radians;
}

absl::StatusOr<MaterialExposures> ParseMaterialExposures(const v1::DetectabilityOfMaterial& message,
                                                         const std::string& path,
                                                         const Checker& check) {
  SIGHTLINE_RETURN_IF_ERROR(CheckTableAxis(check, path + ".camera_distances_m",
                                           message.camera_distances_m(), kTableDistance));
  SIGHTLINE_RETURN_IF_ERROR(CheckTableAxis(check, path + ".camera_incidence_deg",
                                           message.camera_incidence_deg(), kTableIncidence));
  SIGHTLINE_RETURN_IF_ERROR(CheckTableAxis(check, path + ".laser_incidence_deg",
                                           message.laser_incidence_deg(), kTableIncidence));
  SIGHTLINE_RETURN_IF_ERROR(
      CheckTableAxis(check, path + ".azimuth_deg", message.azimuth_deg(), kTableAzimuth));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range(path + ".laser_distance_m", message.laser_distance_m(), kTableDistance));
  // Four sizes of at most 2^31 each: compared step by step, so that nothing overflows.
  int64_t entries = 1;
  for (const int64_t size : {message.camera_distances_m_size(), message.camera_incidence_deg_size(),
                             message.laser_incidence_deg_size(), message.azimuth_deg_size()}) {
    entries *= size;
    if (entries > kMostEntries) {
      return check.Error(path, absl::StrCat("has more than ", kMostEntries, " entries"));
    }
  }
  for (const auto& [name, size] :
       {std::pair("shortest_exposure_time_s", message.shortest_exposure_time_s_size()),
        std::pair("longest_exposure_time_s", message.longest_exposure_time_s_size())}) {
    if (size == entries) continue;
    return check.Error(absl::StrCat(path, ".", name),
                       absl::StrCat("has ", size, " entries, must have ", entries,
                                    " (distances x camera angles x laser angles x azimuths)"));
  }
  for (int i = 0; i < entries; ++i) {
    const double shortest_s = message.shortest_exposure_time_s(i),
                 longest_s = message.longest_exposure_time_s(i);
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat(path, ".shortest_exposure_time_s[", i, "]"),
                                          shortest_s, kTableTime));
    const std::string longest = absl::StrCat(path, ".longest_exposure_time_s[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(check.Range(longest, longest_s, kTableTime));
    if (std::isfinite(shortest_s) && longest_s < shortest_s) {
      return check.Error(
          longest, absl::StrCat("is ", NumberText(longest_s),
                                ", must be at least the shortest time, ", NumberText(shortest_s)));
    }
  }
  MaterialExposures exposures;
  exposures.part_material = message.part_material();
  exposures.camera_distances_m.assign(message.camera_distances_m().begin(),
                                      message.camera_distances_m().end());
  exposures.camera_incidence_rad = TableRadians(message.camera_incidence_deg());
  exposures.laser_incidence_rad = TableRadians(message.laser_incidence_deg());
  exposures.azimuth_rad = TableRadians(message.azimuth_deg());
  exposures.laser_distance_m = message.laser_distance_m();
  exposures.shortest_s.assign(message.shortest_exposure_time_s().begin(),
                              message.shortest_exposure_time_s().end());
  exposures.longest_s.assign(message.longest_exposure_time_s().begin(),
                             message.longest_exposure_time_s().end());
  return exposures;
}

std::vector<double> Logarithms(const std::vector<double>& times_s) {
  std::vector<double> logarithms;
  logarithms.reserve(times_s.size());
  for (const double time_s : times_s) logarithms.push_back(std::log(time_s));
  return logarithms;
}

}  // namespace

ExposureTable::ExposureTable(const MaterialExposures& exposures)
    : axes_{exposures.camera_distances_m, exposures.camera_incidence_rad,
            exposures.laser_incidence_rad, exposures.azimuth_rad},
      laser_distance_m_(exposures.laser_distance_m),
      log_shortest_(Logarithms(exposures.shortest_s)),
      log_longest_(Logarithms(exposures.longest_s)) {}

ExposureRange ExposureTable::At(double camera_distance_m, double laser_distance_m,
                                double cos_camera, double cos_laser, double cos_between) const {
  const double camera = std::clamp(cos_camera, -1.0, 1.0), laser = std::clamp(cos_laser, -1.0, 1.0);
  // Spherical law of cosines: cos between = cos camera cos laser + sin camera sin laser cos
  // azimuth.
  const double sines = std::sqrt((1 - camera * camera) * (1 - laser * laser));
  const double azimuth =
      sines > kLeastSine ? std::acos(std::clamp((cos_between - camera * laser) / sines, -1.0, 1.0))
                         : 0;
  const double at[4] = {camera_distance_m, std::acos(camera), std::acos(laser), azimuth};
  // The two entries about the place along each axis, and their weights.
  size_t below[4];
  double weight[4];  // of the entry above
  for (int k = 0; k < 4; ++k) {
    const std::vector<double>& axis = axes_[k];
    const auto above = std::upper_bound(axis.begin(), axis.end(), at[k]);
    below[k] = above == axis.begin() ? 0 : static_cast<size_t>(above - axis.begin()) - 1;
    weight[k] = above == axis.begin() || above == axis.end()
                    ? 0
                    : (at[k] - axis[below[k]]) / (axis[below[k] + 1] - axis[below[k]]);
  }
  // Sums over the finite entries about the place, and the entry that is nearest to it.
  double shortest = 0, shortest_share = 0, longest = 0, longest_share = 0, nearest_share = -1;
  size_t nearest = 0;
  for (int corner = 0; corner < 16; ++corner) {
    double share = 1;
    size_t index = 0;
    for (int k = 0; k < 4; ++k) {
      const int upper = (corner >> k) & 1;
      share *= upper != 0 ? weight[k] : 1 - weight[k];
      if (share == 0) break;
      index = index * axes_[k].size() + below[k] + static_cast<size_t>(upper);
    }
    if (share == 0) continue;
    if (share > nearest_share) {
      nearest_share = share;
      nearest = index;
    }
    const auto add = [&](double value, double& sum, double& shares) {
      if (std::isinf(value)) return;
      sum += share * value;
      shares += share;
    };
    add(log_shortest_[index], shortest, shortest_share);
    add(log_longest_[index], longest, longest_share);
  }
  const double spread = laser_distance_m / laser_distance_m_;
  const auto time = [&](double at_nearest, double sum, double shares) {
    return std::isinf(at_nearest) ? at_nearest : spread * std::exp(sum / shares);
  };
  return {time(log_shortest_[nearest], shortest, shortest_share),
          time(log_longest_[nearest], longest, longest_share)};
}

absl::StatusOr<Detectability> ParseDetectability(const v1::Detectability& message,
                                                 const std::string& context) {
  const Checker check(context);
  Detectability detectability;
  if (message.has_min_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("detectability.min_exposure_time_s",
                                          message.min_exposure_time_s(), kExposureTime));
    detectability.min_exposure_time_s = message.min_exposure_time_s();
  }
  if (message.has_max_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("detectability.max_exposure_time_s",
                                          message.max_exposure_time_s(), kExposureTime));
    detectability.max_exposure_time_s = message.max_exposure_time_s();
  }
  if (detectability.min_exposure_time_s && detectability.max_exposure_time_s &&
      *detectability.min_exposure_time_s > *detectability.max_exposure_time_s) {
    return check.Error("detectability.min_exposure_time_s",
                       absl::StrCat("is ", NumberText(*detectability.min_exposure_time_s),
                                    " s, must be at most max_exposure_time_s, ",
                                    NumberText(*detectability.max_exposure_time_s), " s"));
  }
  if (message.has_min_detected_fraction()) {
    detectability.min_detected_fraction = message.min_detected_fraction();
  }
  SIGHTLINE_RETURN_IF_ERROR(check.Range("detectability.min_detected_fraction",
                                        detectability.min_detected_fraction, kDetectedFraction));
  if (!message.has_table()) return detectability;
  const v1::DetectabilityTable& table = message.table();
  const std::string materials = "detectability.table.materials";
  if (table.materials().empty()) return check.Error(materials, "is missing");
  if (table.materials_size() > kMostMaterials) {
    return check.Error(materials, absl::StrCat("has ", table.materials_size(), " entries, at most ",
                                               kMostMaterials));
  }
  std::set<std::string> names;
  for (int i = 0; i < table.materials_size(); ++i) {
    const std::string path = absl::StrCat(materials, "[", i, "]");
    if (!names.insert(table.materials(i).part_material()).second) {
      return check.Error(path + ".part_material",
                         absl::StrCat("is \"", table.materials(i).part_material(),
                                      "\" like that of another entry"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(MaterialExposures exposures,
                               ParseMaterialExposures(table.materials(i), path, check));
    detectability.materials.push_back(std::move(exposures));
  }
  return detectability;
}

}  // namespace sightline
