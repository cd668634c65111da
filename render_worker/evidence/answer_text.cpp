// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/answer_text.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

// Probability above which the finding speaks of the remainder. Chosen: more likely than not.
constexpr double kWorthASentence = 0.5;
// Largest probability that a sentence states. Chosen: priors are not known better than that.
constexpr double kMostStated = 0.99;

std::string ShareText(double share) {
  constexpr double kRoundsToZero = 0.005;
  return share < kRoundsToZero ? "less than 1 %" : absl::StrFormat("%.0f %%", 100 * share);
}

// Kind of a group of the predictive check: "f_number 1.4" is a setting, "texture" a statistic.
std::string PlaceOf(const std::string& group) {
  double value = 0;
  const size_t space = group.rfind(' ');
  if (space != std::string::npos && absl::SimpleAtod(group.substr(space + 1), &value)) {
    return absl::StrCat("in recordings at ", group);
  }
  if (absl::StartsWith(group, "independence")) return "in a dependence on the set-up";
  return absl::StrCat("in ", group);
}

std::string RejectedNullText(const v1::Diagnosis& diagnosis) {
  const double p_value = diagnosis.named_check().p_value();
  const std::string& group = diagnosis.remainder().group();
  return absl::StrCat(
      "No effect that is known predicts these recordings better, but the description is rejected: ",
      p_value > 0 ? absl::StrFormat("p = %.1e", p_value) : "p < 1e-300",
      group.empty() ? "" : absl::StrCat("; the largest difference is ", PlaceOf(group)), ".");
}

}  // namespace

bool NullIsRejectedAnswer(const v1::Diagnosis& diagnosis) {
  return !diagnosis.ranked().empty() && diagnosis.ranked(0).effect() == "none" &&
         diagnosis.has_named_check() && diagnosis.named_check().p_value() < kRejectedBelow;
}

std::string RemainderText(const v1::Diagnosis& diagnosis) {
  const v1::Remainder& remainder = diagnosis.remainder();
  if (diagnosis.ranked().empty() || !(remainder.probability() > kWorthASentence)) return "";
  if (NullIsRejectedAnswer(diagnosis)) return RejectedNullText(diagnosis);
  if (diagnosis.ranked(0).effect() == "none") return "";
  return absl::StrCat(
      ShareText(remainder.share()), " of the difference is left",
      remainder.group().empty() ? "" : absl::StrCat(", mostly ", PlaceOf(remainder.group())),
      absl::StrFormat("; no known effect describes it (probability %.2f).",
                      std::min(kMostStated, remainder.probability())));
}

std::string WhyTermDoesNotLead(const TermOverName& term) {
  if (!(term.more_evidence > 0)) {
    return absl::StrFormat("%.3g nats less evidence than the answer", -term.more_evidence);
  }
  const std::string more = absl::StrFormat("%.3g nats more evidence, but ", term.more_evidence);
  if (!(term.share_left > term.share_names_may_leave)) {
    return absl::StrCat(more, "the answer leaves only ", ShareText(term.share_left),
                        " of the difference");
  }
  if (!(term.more_held_out_score > kClearGain_nats)) {
    return absl::StrCat(more,
                        absl::StrFormat("%.3g nats in the prediction of what was not fitted: it "
                                        "must be better by %.0f",
                                        term.more_held_out_score, kClearGain_nats));
  }
  return absl::StrCat(more, "errors of the model itself may cause it");
}

}  // namespace sightline
