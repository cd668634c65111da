// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/predictive_check.h"

#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

// P-value below which a prediction counts as failed; the diagnosis uses the same limit.
constexpr double kRejected = 0.01;

v1::ReportCell GroupCell(const v1::PredictedGroup& group) {
  if (group.degrees_of_freedom() <= 0) return TextCell(kNoValue);
  const double per_number = group.chi_squared() / group.degrees_of_freedom();
  return NumberCell(per_number, Number(per_number), "", PValueText(group.p_value()));
}

// Result of a check as a whole: "the prediction holds (p = 0.43)".
std::string Outcome(const v1::PredictiveCheck& check) {
  return absl::StrCat(check.p_value() < kRejected ? "the prediction fails" : "the prediction holds",
                      " (", PValueText(check.p_value()), ")");
}

v1::ReportBlock GroupTable(const v1::PredictiveCheck& null, const v1::PredictiveCheck* named,
                           const std::string& named_model) {
  std::map<std::string, const v1::PredictedGroup*> with_name;
  std::vector<v1::ReportColumn> columns = {WordsColumn("recordings or kind of number"),
                                           NumberColumn("\u03c7\u00b2 per number, nominal")};
  if (named != nullptr) {
    for (const v1::PredictedGroup& group : named->groups()) with_name[group.name()] = &group;
    columns.push_back(NumberColumn(absl::StrCat("with ", named_model)));
  }
  std::vector<ReportCells> rows;
  for (const v1::PredictedGroup& group : null.groups()) {
    ReportCells row = {TextCell(group.name()), GroupCell(group)};
    if (named != nullptr) {
      const auto it = with_name.find(group.name());
      row.push_back(it == with_name.end() ? TextCell(kNoValue) : GroupCell(*it->second));
    }
    rows.push_back(std::move(row));
  }
  return TableBlock("Predictions group by group", columns, rows);
}

}  // namespace

ReportBlocks PredictiveCheckBlocks(const v1::Diagnosis& diagnosis, const std::string& named_model) {
  const v1::PredictiveCheck &null = diagnosis.null_check(), &named = diagnosis.named_check();
  if (null.groups().empty() && named.groups().empty()) return {};
  const bool with_model = !named_model.empty() && !named.groups().empty();
  std::string text = absl::StrCat(
      "A name is given only if its model predicts recordings that it was not fitted to: each from "
      "a fit to three quarters of the others. Nominal description, fitted again: ",
      Outcome(null));
  if (with_model) {
    absl::StrAppend(&text, "; ", named_model, ": ", Outcome(named),
                    ", log density of the recordings ", named.log_score_gain() < 0 ? "" : "+",
                    FixedNumber(named.log_score_gain(), 1), " nats");
  }
  text += ". p is the probability of the worst group, times their number.";
  ReportBlocks blocks = {RemarkBlock(text)};
  if (!diagnosis.part_of_it().empty()) {
    std::vector<std::string> parts;
    for (const v1::FittedEffect& effect : diagnosis.part_of_it()) {
      parts.push_back(EffectTitle(effect.effect()));
    }
    blocks.push_back(
        TextBlock(absl::StrCat("A part of what is missing: ", absl::StrJoin(parts, ", "),
                               ". It makes predictions better, but they fail all the "
                               "same.")));
  }
  blocks.push_back(FoldedBlock("Group by group",
                               {GroupTable(null, with_model ? &named : nullptr, named_model)}));
  return blocks;
}

}  // namespace sightline
