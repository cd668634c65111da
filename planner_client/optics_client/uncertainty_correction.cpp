// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/uncertainty_correction.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace sightline {
namespace {

constexpr double kDeviations = 2;  // thesis 6.4.3: two standard deviations of e_u

struct Error {
  double mean, deviation;
};

std::optional<Error> ErrorAt(const v1::UncertaintyCorrection& correction, double f_number) {
  const auto& known = correction.by_f_number();
  for (int i = 0; i < known.size(); ++i) {
    // f-numbers are engraved to two digits.
    if (std::abs(f_number / known[i].f_number() - 1) < 0.01) {
      return Error{known[i].mean_e_u(), known[i].standard_deviation()};
    }
  }
  for (int i = 0; i + 1 < known.size(); ++i) {
    if (known[i].f_number() > f_number || known[i + 1].f_number() < f_number) continue;
    const double part = std::log(f_number / known[i].f_number()) /
                        std::log(known[i + 1].f_number() / known[i].f_number());
    return Error{known[i].mean_e_u() + part * (known[i + 1].mean_e_u() - known[i].mean_e_u()),
                 known[i].standard_deviation() +
                     part * (known[i + 1].standard_deviation() - known[i].standard_deviation())};
  }
  return std::nullopt;
}

// Applies it to one point; false: there is no error for its f-number.
bool Apply(const v1::UncertaintyCorrection& correction, v1::OpticsPoint* point) {
  const std::optional<Error> error = ErrorAt(correction, point->f_number());
  if (!error || !(error->mean + kDeviations * error->deviation < 1)) return false;
  point->set_expected_real_u_px(point->u_px() / (1 - error->mean));
  v1::OpticsInterval* interval = point->mutable_expected_real_u_px_interval();
  interval->set_lower(point->u_px_interval().lower() /
                      (1 - (error->mean - kDeviations * error->deviation)));
  interval->set_upper(point->u_px_interval().upper() /
                      (1 - (error->mean + kDeviations * error->deviation)));
  return true;
}

}  // namespace

absl::StatusOr<v1::UncertaintyCorrection> MakeCorrection(const v1::Verification& verification,
                                                         const std::string& channel,
                                                         const std::string& source) {
  bool has_channel = false;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    for (const v1::ChannelVerification& c : recording.channels()) {
      has_channel = has_channel || c.channel() == channel;
    }
  }
  std::map<double, std::vector<double>> by_f_number;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    for (const v1::ChannelVerification& c : recording.channels()) {
      if ((has_channel && c.channel() != channel) || !c.has_e_u()) continue;
      if (!(c.e_u() < 1) || !(recording.f_number() > 0)) {
        return absl::InvalidArgumentError(absl::StrCat(
            source, ": recording ", recording.recording(), ": e_u is ", c.e_u(), " at f/",
            recording.f_number(), ", must be below 1 at an f-number above 0"));
      }
      by_f_number[recording.f_number()].push_back(c.e_u());
    }
  }
  if (by_f_number.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(source, ": no recording has e_u; the line was not detected in them"));
  }
  v1::UncertaintyCorrection correction;
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
  return correction;
}

void ApplyCorrection(const v1::UncertaintyCorrection& correction, v1::OpticsPlan* plan) {
  *plan->mutable_correction() = correction;
  std::set<double> without;
  const auto apply = [&](v1::OpticsPoint* point) {
    if (!Apply(correction, point)) without.insert(point->f_number());
  };
  const auto apply_all = [&](v1::OpticsChoice* choice) {
    apply(choice->mutable_best());
    for (v1::OpticsPoint& point : *choice->mutable_curve()) apply(&point);
    for (v1::OpticsChoice::Alternative& alternative : *choice->mutable_alternatives()) {
      apply(alternative.mutable_point());
    }
  };
  apply(plan->mutable_best());
  for (v1::OpticsPoint& point : *plan->mutable_curve()) apply(&point);
  apply_all(plan->mutable_common());
  for (v1::OpticsChoice& choice : *plan->mutable_scans()) apply_all(&choice);
  if (without.empty()) return;
  plan->add_warnings(
      absl::StrCat(correction.source(), ": no correction of u_px (thesis eq. 6.8) for ",
                   absl::StrJoin(without, ", ",
                                 [](std::string* out, double f_number) {
                                   absl::StrAppendFormat(out, "f/%.3g", f_number);
                                 }),
                   ": outside the f-numbers that were verified, or too uncertain there"));
}

}  // namespace sightline
