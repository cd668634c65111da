// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/inadmissible.h"

#include <algorithm>
#include <array>
#include <map>

#include "absl/strings/str_format.h"
#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

// Medians over the targets of a region with admissible uncertainty.
struct Usual {
  double points = 0, point_variance_m2 = 0, admissible_m = 0;
};

// Variance of single points whose number gives the noise at a target.
double PointVariance(const TargetUncertainties& u, std::span<const int32_t> points, size_t t) {
  return u.noise_m[t] * u.noise_m[t] * points[t];
}

Usual UsualOf(const TargetUncertainties& u, std::span<const int32_t> points,
              const std::vector<size_t>& known) {
  std::vector<double> counts, variances, admissible;
  for (const size_t t : known) {
    counts.push_back(points[t]);
    variances.push_back(PointVariance(u, points, t));
    admissible.push_back(u.admissible_m[t]);
  }
  return {UpperMedian(std::move(counts)), UpperMedian(std::move(variances)),
          UpperMedian(std::move(admissible))};
}

// The reason for larger noise than usual.
v1::UncertaintyLimit LimitOfNoise(const TargetUncertainties& u, std::span<const int32_t> points,
                                  size_t t, const Usual& usual) {
  const double fewer = usual.points / std::max(1, points[t]);
  const double noisier =
      usual.point_variance_m2 > 0 ? PointVariance(u, points, t) / usual.point_variance_m2 : 1;
  const double narrower = usual.admissible_m / u.admissible_m[t];
  const std::array<std::pair<double, v1::UncertaintyLimit>, 3> factors = {
      {{fewer, v1::UNCERTAINTY_LIMIT_FEW_POINTS},
       {noisier, v1::UNCERTAINTY_LIMIT_POINT_NOISE},
       {narrower * narrower, v1::UNCERTAINTY_LIMIT_TOLERANCE}}};
  return std::max_element(factors.begin(), factors.end(),
                          [](const auto& a, const auto& b) { return a.first < b.first; })
      ->second;
}

}  // namespace

std::vector<v1::UncertaintyLimit> UncertaintyLimits(const TargetUncertainties& u,
                                                    const TargetBits& measurable,
                                                    const TargetBits& covered,
                                                    std::span<const int32_t> points,
                                                    std::span<const int32_t> regions) {
  const size_t count = u.total_m.size();
  const auto toleranced = [&](size_t t) { return measurable.Test(t) && u.admissible_m[t] > 0; };
  const auto admissible = [&](size_t t) { return u.total_m[t] <= u.admissible_m[t]; };
  std::map<int32_t, std::vector<size_t>> known_in;  // by region
  for (size_t t = 0; t < count; ++t) {
    if (toleranced(t) && covered.Test(t) && admissible(t)) known_in[regions[t]].push_back(t);
  }
  std::map<int32_t, Usual> usual_in;
  for (const auto& [region, known] : known_in) usual_in[region] = UsualOf(u, points, known);

  std::vector<v1::UncertaintyLimit> limits(count, v1::UNCERTAINTY_LIMIT_UNSPECIFIED);
  for (size_t t = 0; t < count; ++t) {
    if (!toleranced(t) || admissible(t)) continue;
    if (!covered.Test(t)) {
      limits[t] = v1::UNCERTAINTY_LIMIT_NOT_COVERED;
      continue;
    }
    switch (DominatingPart(u, t)) {
      case UncertaintyPart::kCalibration:
        limits[t] = v1::UNCERTAINTY_LIMIT_CALIBRATION;
        break;
      case UncertaintyPart::kRegistration:
        limits[t] = v1::UNCERTAINTY_LIMIT_REGISTRATION;
        break;
      case UncertaintyPart::kSampling:
        limits[t] = v1::UNCERTAINTY_LIMIT_SAMPLING;
        break;
      case UncertaintyPart::kNoise: {
        const auto usual = usual_in.find(regions[t]);
        limits[t] = usual == usual_in.end() ? v1::UNCERTAINTY_LIMIT_NOISE
                                            : LimitOfNoise(u, points, t, usual->second);
        break;
      }
    }
  }
  return limits;
}

std::vector<v1::InadmissibleCount> CountInadmissible(const TargetUncertainties& u) {
  std::map<v1::UncertaintyLimit, std::vector<double>> ratios;
  for (size_t t = 0; t < u.limits.size(); ++t) {
    if (u.limits[t] == v1::UNCERTAINTY_LIMIT_UNSPECIFIED) continue;
    ratios[u.limits[t]].push_back(u.total_m[t] / u.admissible_m[t]);
  }
  std::vector<v1::InadmissibleCount> counts;
  for (const auto& [limit, of_limit] : ratios) {
    v1::InadmissibleCount& count = counts.emplace_back();
    count.set_limit(limit);
    count.set_targets(static_cast<int64_t>(of_limit.size()));
    count.set_median_uncertainty_over_admissible(UpperMedian(of_limit));
  }
  std::stable_sort(counts.begin(), counts.end(),
                   [](const auto& a, const auto& b) { return a.targets() > b.targets(); });
  return counts;
}

std::string LimitWords(v1::UncertaintyLimit limit) {
  switch (limit) {
    case v1::UNCERTAINTY_LIMIT_NOT_COVERED:
      return "not measured by any scan";
    case v1::UNCERTAINTY_LIMIT_CALIBRATION:
      return "calibration: errors that all points of a scan share";
    case v1::UNCERTAINTY_LIMIT_REGISTRATION:
      return "registration: errors of joining set-ups";
    case v1::UNCERTAINTY_LIMIT_SAMPLING:
      return "sampling: what the surface may do between and beyond the points";
    case v1::UNCERTAINTY_LIMIT_NOISE:
      return "noise of line detection";
    case v1::UNCERTAINTY_LIMIT_FEW_POINTS:
      return "noise: fewer points than where it is known";
    case v1::UNCERTAINTY_LIMIT_POINT_NOISE:
      return "noise: points less certain than where it is known";
    case v1::UNCERTAINTY_LIMIT_TOLERANCE:
      return "noise: the tolerance is narrower than where it is known";
    default:
      return "no limit known";
  }
}

std::string WhatHelps(v1::UncertaintyLimit limit) {
  switch (limit) {
    case v1::UNCERTAINTY_LIMIT_NOT_COVERED:
      return "another scan has to see it";
    case v1::UNCERTAINTY_LIMIT_CALIBRATION:
      return "a better calibration, or scans from other sides; more points do not help";
    case v1::UNCERTAINTY_LIMIT_REGISTRATION:
      return "more surface that set-ups have in common, fewer set-ups, or poses that are known "
             "otherwise (uncertainty.registration)";
    case v1::UNCERTAINTY_LIMIT_SAMPLING:
      return "finer steps, scans from nearer, points all around the target";
    case v1::UNCERTAINTY_LIMIT_NOISE:
      return "scans from nearer or at a larger triangulation angle, or more of them: it averages "
             "out";
    case v1::UNCERTAINTY_LIMIT_FEW_POINTS:
      return "more scans of it, finer steps";
    case v1::UNCERTAINTY_LIMIT_POINT_NOISE:
      return "scans from nearer, at a larger triangulation angle, less grazing";
    case v1::UNCERTAINTY_LIMIT_TOLERANCE:
      return "more scans of it than of the rest";
    default:
      return "";
  }
}

std::string SummariseInadmissible(const v1::PlanUncertainty& uncertainty) {
  if (uncertainty.inadmissible().empty()) return "";
  int64_t total = 0;
  std::string words;
  for (const v1::InadmissibleCount& count : uncertainty.inadmissible()) {
    total += count.targets();
    absl::StrAppendFormat(&words, "%s%s (%d, u %.3g times the admissible)",
                          words.empty() ? "" : ", ", LimitWords(count.limit()), count.targets(),
                          count.median_uncertainty_over_admissible());
  }
  return absl::StrFormat("%d toleranced targets are not known well enough: %s.\n", total, words);
}

}  // namespace sightline
