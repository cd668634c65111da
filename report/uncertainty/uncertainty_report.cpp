// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/uncertainty_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "report/coverage/coverage_chart.h"
#include "report/page/html.h"
#include "report/page/number_text.h"
#include "report/uncertainty/inadmissible.h"

namespace sightline {
namespace {

constexpr char kUnknown[] = "\u2013";

std::string KnownPercent(double fraction, int decimals = 1) {
  if (!std::isfinite(fraction)) return kUnknown;
  return absl::StrCat(FixedNumber(100 * fraction, decimals), "\u202f%");
}

// As it was stated: "80 %", "97.5 %".
std::string Goal(double fraction) { return absl::StrFormat("%.6g\u202f%%", 100 * fraction); }

// Three digits without a unit, for columns of one unit; thousands in groups.
std::string InColumn(double value) {
  if (!std::isfinite(value)) return kUnknown;
  return std::abs(value) >= 1000 ? GroupedInteger(std::llround(std::min(value, 1e15)))
                                 : Number(value);
}

bool GoalReached(const v1::PlanUncertainty& uncertainty) {
  return uncertainty.goal() > 0 && uncertainty.admissible_fraction() >= uncertainty.goal() - 1e-12;
}

std::vector<double> CumulativeFractions(const v1::Plan& plan, bool relaxed) {
  const double toleranced =
      std::max<double>(1, static_cast<double>(plan.uncertainty().judged_targets()));
  std::vector<double> fractions;
  for (const v1::PlannedScan& scan : plan.scans()) {
    fractions.push_back(static_cast<double>(relaxed ? scan.cumulative_relaxed_targets()
                                                    : scan.cumulative_admissible_targets()) /
                        toleranced);
  }
  return fractions;
}

// "3 of 5 tolerances can be proven; 1 is not evaluated."
std::string ToleranceCountText(const v1::PlanUncertainty& uncertainty) {
  int proven = 0, evaluated = 0;
  for (const v1::FeatureVerdict& feature : uncertainty.features()) {
    proven += feature.can_be_proven();
    evaluated += feature.verdict() != v1::FeatureVerdict::NOT_EVALUATED;
  }
  const int left = uncertainty.features_size() - evaluated;
  return absl::StrCat(proven, " of ", uncertainty.features_size(),
                      uncertainty.features_size() == 1 ? " tolerance" : " tolerances",
                      " can be proven", left == 0 ? "" : absl::StrCat("; ", left, " not evaluated"),
                      ".");
}

v1::ReportCell VerdictCell(const v1::FeatureVerdict& feature) {
  v1::ReportCell cell = StrongCell("\u2717 cannot be proven");
  cell.set_state(v1::REPORT_STATE_BAD);
  if (feature.can_be_proven()) {
    cell.set_text("\u2713 can be proven");
    cell.set_state(v1::REPORT_STATE_GOOD);
  }
  if (feature.verdict() == v1::FeatureVerdict::NOT_EVALUATED) {
    cell.set_text("not evaluated");
    cell.clear_state();
  }
  // Removes the state, which the table already shows.
  std::string because = feature.because();
  for (const char* prefix : {"can be proven: ", "cannot be proven: ", "not evaluated: "}) {
    if (because.starts_with(prefix)) because.erase(0, std::char_traits<char>::length(prefix));
  }
  cell.set_detail(because);
  return cell;
}

// Order: not evaluated, then unprovable, then provable; each by falling ratio of u.
int OrderOfVerdict(const v1::FeatureVerdict& feature) {
  if (feature.verdict() == v1::FeatureVerdict::NOT_EVALUATED) return 0;
  return feature.can_be_proven() ? 2 : 1;
}

v1::ReportCell MicrometreCell(bool known, double length_m) {
  return known ? NumberCell(1e6 * length_m, InColumn(1e6 * length_m)) : TextCell(kUnknown);
}

v1::ReportCell ProbabilityCell(bool known, double probability) {
  return known ? NumberCell(100 * probability, ProbabilityText(probability), "%")
               : TextCell(kUnknown);
}

v1::ReportCell AcceptanceCell(const v1::FeatureVerdict& feature) {
  if (!feature.has_acceptance_zone_m()) return TextCell(kUnknown);
  const double zone_mm = 1e3 * feature.acceptance_zone_m();
  return NumberCell(zone_mm, zone_mm > 0 ? InColumn(zone_mm) : "empty");
}

v1::ReportCell FractionCell(int64_t part, int64_t all, int decimals) {
  if (all <= 0) return TextCell(kUnknown);
  const double fraction = static_cast<double>(part) / static_cast<double>(all);
  return NumberCell(100 * fraction, KnownPercent(fraction, decimals), "%");
}

v1::ReportColumn InGroup(const std::string& group, v1::ReportColumn column) {
  column.set_group(group);
  return column;
}

std::vector<v1::ReportColumn> FeatureColumns() {
  constexpr char kZone[] = "Zone", kU[] = "Standard uncertainty", kWrong[] = "Wrong decisions",
                 kTargets[] = "Targets";
  return {WordsColumn("feature"),
          WordsColumn("verdict"),
          InGroup(kZone, NumberColumn("tolerance", "mm")),
          InGroup(kZone, NumberColumn("acceptance", "mm")),
          InGroup(kU, NumberColumn("u", "\u00b5m")),
          InGroup(kU, NumberColumn("noise", "\u00b5m")),
          InGroup(kU, NumberColumn("sampling", "\u00b5m")),
          InGroup(kU, NumberColumn("calibration", "\u00b5m")),
          InGroup(kU, NumberColumn("registration", "\u00b5m")),
          InGroup(kU, NumberColumn("admissible", "\u00b5m")),
          InGroup(kWrong, NumberColumn("acceptance")),
          InGroup(kWrong, NumberColumn("rejection")),
          InGroup(kTargets, NumberColumn("measured")),
          InGroup(kTargets, NumberColumn("admissible"))};
}

ReportCells RowOf(const v1::FeatureVerdict& feature) {
  const double zone_mm = 1e3 * feature.zone_width_m();
  v1::ReportCell u = MicrometreCell(feature.has_uncertainty_m(), feature.uncertainty_m());
  u.set_strong(true);
  return {
      StrongCell(feature.name().empty() ? feature.id() : feature.name(),
                 feature.text().empty() ? feature.kind() : feature.text()),
      VerdictCell(feature),
      zone_mm > 0 ? NumberCell(zone_mm, ShortNumber(zone_mm)) : TextCell(kUnknown),
      AcceptanceCell(feature),
      u,
      MicrometreCell(feature.has_noise_m(), feature.noise_m()),
      MicrometreCell(feature.has_sampling_m(), feature.sampling_m()),
      MicrometreCell(feature.has_calibration_m(), feature.calibration_m()),
      MicrometreCell(feature.has_registration_m(), feature.registration_m()),
      MicrometreCell(feature.has_admissible_uncertainty_m(), feature.admissible_uncertainty_m()),
      ProbabilityCell(feature.has_probability_wrong_acceptance(),
                      feature.probability_wrong_acceptance()),
      ProbabilityCell(feature.has_probability_wrong_rejection(),
                      feature.probability_wrong_rejection()),
      FractionCell(feature.measured_targets(), feature.targets(), 0),
      feature.has_admissible_targets()
          ? FractionCell(feature.admissible_targets(), feature.targets(), 0)
          : TextCell(kUnknown)};
}

}  // namespace

std::string LengthText(double length_m) {
  if (!std::isfinite(length_m)) return kUnknown;
  if (length_m != 0 && std::abs(length_m) < 0.9995e-3)
    return absl::StrCat(Number(1e6 * length_m), "\u202f\u00b5m");
  return absl::StrCat(Number(1e3 * length_m), "\u202fmm");
}

std::string SummariseVerdicts(const v1::PlanUncertainty& uncertainty) {
  constexpr int kMostLines = 100;
  if (uncertainty.features().empty()) return "";
  std::string text = absl::StrCat("tolerances: ", ToleranceCountText(uncertainty), "\n");
  int lines = 0;
  for (const v1::FeatureVerdict& feature : uncertainty.features()) {
    if (++lines > kMostLines) {
      absl::StrAppend(&text, "  and ", uncertainty.features_size() - kMostLines,
                      " more in the report.\n");
      break;
    }
    const std::string drawn =
        !feature.text().empty()
            ? feature.text()
            : absl::StrFormat("%s %.6g mm", feature.kind(), 1e3 * feature.zone_width_m());
    absl::StrAppend(&text, "  ", feature.name(), " (", drawn, ") ", feature.because(), ".\n");
  }
  return text;
}

std::vector<v1::ReportRun> UncertaintyFinding(const v1::Plan& plan,
                                              const std::string& why_stopped) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  const int scans = plan.scans_size();
  std::string text = " of the toleranced surface known well enough to prove its tolerances";
  if (uncertainty.goal() > 0 && !GoalReached(uncertainty)) {
    // The search knows no errors that scans share (requirements/joined_scans.h).
    absl::StrAppend(&text, ", short of the goal of ", Goal(uncertainty.goal()), ": ",
                    plan.stop_reason() == v1::Plan::STOP_REASON_GOAL_REACHED
                        ? "the search reached it without the errors of joining set-ups"
                        : why_stopped);
  }
  text += ".";
  if (uncertainty.has_fresh_admissible_fraction()) {
    absl::StrAppend(&text, " On ", GroupedInteger(uncertainty.fresh_judged_targets()),
                    " targets that the search has not seen it is ",
                    KnownPercent(uncertainty.fresh_admissible_fraction()), ".");
  }
  if (uncertainty.features_size() > 0) {
    absl::StrAppend(&text, " ", ToleranceCountText(uncertainty));
  }
  for (const std::string& statement : {uncertainty.registration(), uncertainty.calibration()}) {
    if (statement.empty()) continue;
    absl::StrAppend(&text, " ", absl::StrReplaceAll(statement, {{" um ", " \u00b5m "}}));
  }
  const v1::ScanCountBound& bound = uncertainty.bound();
  if (bound.scans() > 0 && bound.converged()) {
    // Tolerance of the LP solver: 9.0000000001 still means 9.
    const int fewest = static_cast<int>(std::ceil(bound.scans() - 1e-6));
    absl::StrAppend(
        &text, " As far as the search for the lower bound (", FixedNumber(bound.scans(), 1),
        ") found, a plan for ", Goal(uncertainty.goal()), " needs at least ", fewest,
        fewest == 1 ? " scan" : " scans",
        GoalReached(uncertainty) && scans <= fewest ? ": no fewer than this one." : ".");
  } else if (bound.scans() > 0) {
    absl::StrAppend(&text, " The relaxation stands at ", FixedNumber(bound.scans(), 1),
                    " scans; it is not proven to be a bound.");
  }
  return {StrongRun(absl::StrCat(scans, scans == 1 ? " scan makes " : " scans make ",
                                 KnownPercent(uncertainty.admissible_fraction()))),
          PlainRun(text)};
}

std::vector<v1::ReportFact> UncertaintyFigures(const v1::Plan& plan) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  const auto percent = [](const std::string& name, double fraction, const std::string& detail) {
    return NumberFact(name, 100 * fraction, "%", KnownPercent(fraction), detail);
  };
  std::vector<v1::ReportFact> figures = {
      CountFact("scans", plan.scans_size()),
      percent("admissible", uncertainty.admissible_fraction(),
              uncertainty.goal() > 0 ? "goal " + Goal(uncertainty.goal()) : "")};
  if (uncertainty.has_fresh_admissible_fraction()) {
    figures.push_back(
        percent("admissible, validation targets", uncertainty.fresh_admissible_fraction(), ""));
  }
  figures.push_back(percent(
      absl::StrCat("within ", SettingText("relaxed_m", uncertainty.relaxed_uncertainty_m())),
      uncertainty.relaxed_fraction(),
      uncertainty.has_fresh_relaxed_fraction()
          ? "fresh " + KnownPercent(uncertainty.fresh_relaxed_fraction())
          : ""));
  figures.push_back(NumberFact("median uncertainty", uncertainty.median_uncertainty_m(), "m",
                               LengthText(uncertainty.median_uncertainty_m())));
  if (uncertainty.bound().scans() > 0) {
    figures.push_back(NumberFact(
        uncertainty.bound().converged() ? "lower bound" : "relaxation (not a bound)",
        uncertainty.bound().scans(), "", FixedNumber(uncertainty.bound().scans(), 1), "scans"));
  }
  figures.push_back(CountFact("toleranced targets", uncertainty.judged_targets()));
  return figures;
}

ReportBlocks UncertaintyCurveBlocks(const v1::Plan& plan) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  CoverageCurve curve;
  curve.coverage = CumulativeFractions(plan, /*relaxed=*/false);
  curve.upper = CumulativeFractions(plan, /*relaxed=*/true);
  curve.goal = uncertainty.goal();
  curve.bound_scans = uncertainty.bound().scans();
  curve.bound_converged = uncertainty.bound().converged();
  curve.title = "Part of the toleranced surface that is admissible, and relaxed, after each scan";
  curve.axis = "known well enough, of the toleranced surface";
  curve.coverage_name = "uncertainty admissible";
  curve.upper_name =
      absl::StrCat("admissible, or at most ",
                   SettingText("relaxed_m", uncertainty.relaxed_uncertainty_m()), " (relaxed)");
  if (uncertainty.has_fresh_admissible_fraction()) {
    curve.fresh = uncertainty.fresh_admissible_fraction();
  }
  ReportBlocks blocks = {ChartBlock(CoverageChart(curve))};
  if (!uncertainty.bound().statement().empty()) {
    blocks.push_back(RemarkBlock(uncertainty.bound().statement()));
  }
  if (uncertainty.second_order_points() > 0) {
    v1::ReportNote& note = *blocks.emplace_back().mutable_note();
    note.set_severity(v1::REPORT_STATE_WARNING);
    note.set_text(absl::StrCat(
        "At ", GroupedInteger(uncertainty.second_order_points()), " of ",
        GroupedInteger(uncertainty.examined_points()),
        " points examined linear propagation is not to be relied on: the second order changes a "
        "standard deviation by more than 4\u202f%."));
  }
  return blocks;
}

ReportBlocks FeatureBlocks(const v1::Plan& plan, bool selectable) {
  const auto& features = plan.uncertainty().features();
  if (features.empty()) return {};
  std::vector<int> order(static_cast<size_t>(features.size()));
  std::iota(order.begin(), order.end(), 0);
  const auto excess = [&](int i) {
    const v1::FeatureVerdict& feature = features[i];
    const double ratio = feature.uncertainty_m() / feature.admissible_uncertainty_m();
    return std::isfinite(ratio) ? ratio : 1e300;
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    if (OrderOfVerdict(features[a]) != OrderOfVerdict(features[b]))
      return OrderOfVerdict(features[a]) < OrderOfVerdict(features[b]);
    return excess(a) > excess(b);
  });
  std::vector<ReportCells> rows;
  for (const int i : order) rows.push_back(RowOf(features[i]));
  v1::ReportBlock table = TableBlock("Toleranced features", FeatureColumns(), rows);
  for (int row = 0; selectable && row < table.table().rows_size(); ++row) {
    table.mutable_table()->mutable_rows(row)->mutable_view()->set_feature(
        order[static_cast<size_t>(row)]);
  }
  return {
      RemarkBlock(absl::StrCat(
          "A tolerance can be proven if the guard bands leave a zone to accept in (ISO 14253-1) "
          "and "
          "a part without deviations is accepted as often as not. u is the standard uncertainty of "
          "what the tolerance is about; its parts add up as squares. Probabilities of deciding "
          "wrongly are those of a part taken from production (JCGM 106). What is not evaluated has "
          "no figures: its reason says what is missing.",
          selectable ? " Select a row to see the feature in the part above." : "")),
      table};
}

ReportBlocks InadmissibleBlocks(const TargetUncertainties& uncertainties,
                                const TargetBits& measurable) {
  int64_t toleranced = 0, inadmissible = 0;
  std::map<v1::UncertaintyLimit, int64_t> relaxed;
  for (size_t i = 0; i < uncertainties.total_m.size(); ++i) {
    const UncertaintyClass kind = ClassOfTarget(uncertainties, measurable, i);
    if (kind == UncertaintyClass::kNotToleranced || kind == UncertaintyClass::kNotMeasurable)
      continue;
    ++toleranced;
    if (kind == UncertaintyClass::kAdmissible) continue;
    ++inadmissible;
    if (i < uncertainties.limits.size() && kind == UncertaintyClass::kRelaxed) {
      ++relaxed[uncertainties.limits[i]];
    }
  }
  if (toleranced == 0) return {TextBlock("No tolerance binds a measurable target.")};
  if (inadmissible == 0) return {TextBlock("None: every toleranced target is admissible.")};
  std::vector<ReportCells> rows;
  for (const v1::InadmissibleCount& count : CountInadmissible(uncertainties)) {
    const int64_t only_relaxed = relaxed[count.limit()];
    const double excess = count.median_uncertainty_over_admissible();
    rows.push_back({TextCell(LimitWords(count.limit())), CountCell(count.targets()),
                    FractionCell(count.targets(), toleranced, 1), CountCell(only_relaxed),
                    CountCell(count.targets() - only_relaxed),
                    NumberCell(excess, FixedNumber(excess, 2)),
                    TextCell(WhatHelps(count.limit()))});
  }
  return {RemarkBlock(absl::StrCat(
              GroupedInteger(inadmissible), " of ", GroupedInteger(toleranced),
              " toleranced targets, by the largest part of their uncertainty after all scans; of "
              "noise, by what differs most from the places that are known well enough.")),
          TableBlock("Why targets are not admissible",
                     {WordsColumn("what limits it"), NumberColumn("targets"),
                      NumberColumn("of the toleranced"), NumberColumn("only relaxed"),
                      NumberColumn("not reached"), NumberColumn("u over admissible"),
                      WordsColumn("what helps")},
                     rows)};
}

}  // namespace sightline
