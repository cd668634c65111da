// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/uncertainty_correction.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr double kCoverage = 0.95;
constexpr size_t kMostNamedRecordings = 10;

struct ErrorOfScatter {
  double mean;
  std::optional<double> half_width;  // of the prediction interval; unset: not known
};

// Degrees of freedom of the pooled standard deviation.
int PooledFreedom(const v1::UncertaintyCorrection& errors) {
  int freedom = 0;
  for (const auto& known : errors.by_f_number()) freedom += std::max(0, known.recordings() - 1);
  return freedom;
}

ErrorOfScatter ErrorOf(const v1::UncertaintyCorrection::FNumberError& known, int pooled_freedom) {
  const int freedom = known.recordings() > 1 ? known.recordings() - 1 : pooled_freedom;
  if (freedom < 1) return {known.mean_e_u(), std::nullopt};
  const boost::math::students_t_distribution<double> student(freedom);
  const double t = boost::math::quantile(student, 0.5 * (1 + kCoverage));
  return {known.mean_e_u(),
          t * known.standard_deviation() * std::sqrt(1 + 1.0 / std::max(1, known.recordings()))};
}

std::optional<ErrorOfScatter> ErrorAt(const v1::UncertaintyCorrection& errors, double f_number) {
  const auto& known = errors.by_f_number();
  const int freedom = PooledFreedom(errors);
  for (int i = 0; i < known.size(); ++i) {
    // f-numbers are engraved to two digits.
    if (std::abs(f_number / known[i].f_number() - 1) < 0.01) return ErrorOf(known[i], freedom);
  }
  for (int i = 0; i + 1 < known.size(); ++i) {
    if (known[i].f_number() > f_number || known[i + 1].f_number() < f_number) continue;
    const double part = std::log(f_number / known[i].f_number()) /
                        std::log(known[i + 1].f_number() / known[i].f_number());
    const ErrorOfScatter below = ErrorOf(known[i], freedom), above = ErrorOf(known[i + 1], freedom);
    ErrorOfScatter between{below.mean + part * (above.mean - below.mean), std::nullopt};
    if (below.half_width && above.half_width) {
      between.half_width = *below.half_width + part * (*above.half_width - *below.half_width);
    }
    return between;
  }
  return std::nullopt;
}

enum class Corrected { kWithInterval, kWithoutInterval, kNot };

Corrected Apply(const v1::UncertaintyCorrection& errors, v1::OpticsPoint* point) {
  const std::optional<ErrorOfScatter> error = ErrorAt(errors, point->f_number());
  if (!error || !(error->mean < 1)) return Corrected::kNot;
  point->set_expected_real_u_px(point->u_px() / (1 - error->mean));
  if (!error->half_width || !(error->mean + *error->half_width < 1)) {
    return Corrected::kWithoutInterval;
  }
  v1::OpticsInterval* interval = point->mutable_expected_real_u_px_interval();
  interval->set_lower(point->u_px_interval().lower() / (1 - (error->mean - *error->half_width)));
  interval->set_upper(point->u_px_interval().upper() / (1 - (error->mean + *error->half_width)));
  return Corrected::kWithInterval;
}

std::string FNumbersText(const std::set<double>& f_numbers) {
  return absl::StrJoin(f_numbers, ", ", [](std::string* out, double f_number) {
    absl::StrAppendFormat(out, "f/%.3g", f_number);
  });
}

// Numbers of recordings for a message: "3, 4, 7 and 12 more".
std::string RecordingsText(const std::vector<int>& recordings) {
  const size_t named = std::min(recordings.size(), kMostNamedRecordings);
  const size_t more = recordings.size() - named;
  return absl::StrCat(absl::StrJoin(recordings.begin(),
                                    recordings.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                      more > 0 ? absl::StrCat(" and ", more, " more") : "");
}

// e_u that belongs to `channel`, by f-number; recordings without it are left out by name.
absl::StatusOr<std::map<double, std::vector<double>>> ErrorsOfChannel(
    const v1::Verification& verification, const std::string& channel, const std::string& source,
    std::vector<std::string>* remarks) {
  std::set<std::string> channels;
  std::vector<int> left_out;
  std::map<double, std::vector<double>> by_f_number;
  bool has_any = false;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    bool taken = false;
    for (const v1::ChannelVerification& c : recording.channels()) {
      channels.insert(c.channel());
      has_any = has_any || c.has_e_u();
      if (c.channel() != channel || !c.has_e_u()) continue;
      if (!(c.e_u() < 1) || !(recording.f_number() > 0)) {
        return absl::InvalidArgumentError(absl::StrCat(
            source, ": recording ", recording.recording(), ": e_u is ", c.e_u(), " at f/",
            recording.f_number(), ", must be below 1 at an f-number above 0"));
      }
      by_f_number[recording.f_number()].push_back(c.e_u());
      taken = true;
    }
    if (!taken) left_out.push_back(recording.recording());
  }
  if (channels.count("mono") > 0 && channels.size() > 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        source, ": has the channels ", absl::StrJoin(channels, ", "),
        ", which are those of a monochrome and of a colour camera: verify each camera by itself"));
  }
  if (!channels.empty() && channels.count(channel) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        source, ": has e_u of channel ", absl::StrJoin(channels, ", "),
        ", but this inspection detects the line in channel ", channel,
        ": verify recordings of this camera and choose the channel by optics.detector.channel"));
  }
  if (!has_any || by_f_number.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(source, ": no recording has e_u; the line was not detected in them"));
  }
  if (!left_out.empty()) {
    remarks->push_back(absl::StrCat(source, ": left out, since they have no e_u of channel ",
                                    channel, ": recordings ", RecordingsText(left_out)));
  }
  return by_f_number;
}

}  // namespace

absl::StatusOr<VerifiedCorrection> MakeCorrection(const v1::Verification& verification,
                                                  const std::string& channel,
                                                  const std::string& source) {
  VerifiedCorrection verified;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto by_f_number,
                             ErrorsOfChannel(verification, channel, source, &verified.remarks));
  v1::UncertaintyCorrection& correction = verified.errors;
  correction.set_source(source);
  double squares = 0;
  int freedom = 0;
  for (const auto& [f_number, errors] : by_f_number) {
    v1::UncertaintyCorrection::FNumberError* entry = correction.add_by_f_number();
    double sum = 0, own = 0;
    for (const double e : errors) sum += e;
    const double mean = sum / static_cast<double>(errors.size());
    for (const double e : errors) own += (e - mean) * (e - mean);
    entry->set_f_number(f_number);
    entry->set_mean_e_u(mean);
    entry->set_recordings(static_cast<int>(errors.size()));
    if (errors.size() > 1) {
      entry->set_standard_deviation(std::sqrt(own / static_cast<double>(errors.size() - 1)));
    }
    squares += own;
    freedom += static_cast<int>(errors.size()) - 1;
  }
  for (v1::UncertaintyCorrection::FNumberError& entry : *correction.mutable_by_f_number()) {
    if (entry.recordings() == 1 && freedom > 0) {
      entry.set_standard_deviation(std::sqrt(squares / freedom));
    }
  }
  return verified;
}

void ApplyCorrection(const VerifiedCorrection& correction, v1::OpticsPlan* plan) {
  const v1::UncertaintyCorrection& errors = correction.errors;
  *plan->mutable_correction() = errors;
  for (const std::string& remark : correction.remarks) plan->add_warnings(remark);
  std::set<double> without_correction, without_interval;
  const auto apply = [&](v1::OpticsPoint* point) {
    const Corrected corrected = Apply(errors, point);
    if (corrected == Corrected::kNot) without_correction.insert(point->f_number());
    if (corrected == Corrected::kWithoutInterval) without_interval.insert(point->f_number());
  };
  const auto apply_all = [&](v1::OpticsChoice* choice) {
    if (choice->has_best()) apply(choice->mutable_best());
    for (v1::OpticsPoint& point : *choice->mutable_curve()) apply(&point);
    for (v1::OpticsChoice::Alternative& alternative : *choice->mutable_alternatives()) {
      if (alternative.has_point()) apply(alternative.mutable_point());
    }
  };
  if (plan->has_best()) apply(plan->mutable_best());
  for (v1::OpticsPoint& point : *plan->mutable_curve()) apply(&point);
  if (plan->has_common()) apply_all(plan->mutable_common());
  for (v1::OpticsChoice& choice : *plan->mutable_scans()) apply_all(&choice);
  if (!without_correction.empty()) {
    plan->add_warnings(absl::StrCat(
        errors.source(), ": no correction of u_px (thesis eq. 6.8) for ",
        FNumbersText(without_correction), ": outside the f-numbers that were verified"));
  }
  if (without_interval.empty()) return;
  plan->add_warnings(absl::StrCat(
      errors.source(), ": the corrected u_px has no interval for ", FNumbersText(without_interval),
      PooledFreedom(errors) < 1
          ? ": one recording at each f-number does not show how much e_u differs between "
            "recordings; verify at least two with the same f-number"
          : ": too few recordings differ too much there"));
}

}  // namespace sightline
