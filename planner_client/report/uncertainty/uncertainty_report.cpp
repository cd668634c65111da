// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/uncertainty/uncertainty_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/charts/coverage_curve.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/uncertainty/inadmissible.h"

namespace sightline {
namespace {

constexpr char kUnknown[] = "\u2013";
// Bars drawn; of longer plans every second, third, ... scan is shown.
constexpr int kMostBars = 24;

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

std::string MicrometreColumn(double length_m) { return InColumn(1e6 * length_m); }
std::string MillimetreColumn(double length_m) { return InColumn(1e3 * length_m); }

bool GoalReached(const v1::PlanUncertainty& uncertainty) {
  return uncertainty.goal() > 0 && uncertainty.admissible_fraction() >= uncertainty.goal() - 1e-12;
}

std::vector<double> CumulativeFractions(const v1::Plan& plan, bool relaxed) {
  const double judged =
      std::max<double>(1, static_cast<double>(plan.uncertainty().judged_targets()));
  std::vector<double> fractions;
  for (const v1::PlannedScan& scan : plan.scans()) {
    fractions.push_back(static_cast<double>(relaxed ? scan.cumulative_relaxed_targets()
                                                    : scan.cumulative_admissible_targets()) /
                        judged);
  }
  return fractions;
}

// Thesis Fig. 6.5: after each scan, one bar on the other, under the points of the curve above.
std::string BarsSvg(const CoverageCurve& curve) {
  constexpr double kWidth = 760, kHeight = 190, kLeft = 52, kRight = 24, kTop = 8, kBottom = 42;
  const int scans = static_cast<int>(curve.coverage.size());
  const double x_max = CoverageCurveLastScan(curve) + 0.4;
  const double pitch = (kWidth - kLeft - kRight) / x_max;
  const int step = (scans + kMostBars - 1) / kMostBars;
  const auto y = [&](double fraction) {
    return kHeight - kBottom - (kHeight - kTop - kBottom) * std::clamp(fraction, 0.0, 1.0);
  };
  std::string svg = absl::StrFormat(
      "<svg class=\"curve\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
      "aria-label=\"Admissible and relaxed part of the judged surface after each scan\">\n",
      kWidth, kHeight);
  for (int percent = 0; percent <= 100; percent += 50) {
    absl::StrAppendFormat(
        &svg,
        "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%d</text>\n",
        kLeft, kWidth - kRight, y(percent / 100.0), y(percent / 100.0), kLeft - 8,
        y(percent / 100.0) + 4, percent);
  }
  // The last scan is always among those shown.
  for (int scan = (scans - 1) % step; scan < scans; scan += step) {
    const double width = std::min(42.0, 0.6 * step * pitch);
    const double x = kLeft + (scan + 1) * pitch - 0.5 * width;
    const double low = curve.coverage[scan], high = std::max(low, curve.upper[scan]);
    absl::StrAppendFormat(
        &svg,
        "<g><title>after scan %d: %.2f %% admissible, %.2f %% only relaxed</title>"
        "<rect class=\"admissible\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>"
        "<rect class=\"relaxed\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/></g>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>\n",
        scan + 1, 100 * low, 100 * (high - low), x, y(low), width, y(0) - y(low), x, y(high), width,
        y(low) - y(high), x + 0.5 * width, kHeight - kBottom + 18, scan + 1);
  }
  return svg + "</svg>\n";
}

std::string Key(double relaxed_m, bool fresh) {
  return absl::StrCat(
      "<p class=\"soft key-line\"><span><span class=\"key\" "
      "style=\"background:var(--admissible)\"></span> uncertainty admissible</span> <span><span "
      "class=\"key\" style=\"background:var(--relaxed)\"></span> not admissible, but at most ",
      SettingText("relaxed_m", relaxed_m), " (relaxed)</span>",
      fresh ? " <span>\u25c7 admissible on targets that the search has not seen</span>" : "",
      "</p>\n");
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

std::string Verdict(const v1::FeatureVerdict& feature) {
  const char* state = "<span class=\"verdict no\">\u2717 cannot be proven</span>";
  if (feature.can_be_proven()) state = "<span class=\"verdict yes\">\u2713 can be proven</span>";
  if (feature.verdict() == v1::FeatureVerdict::NOT_EVALUATED)
    state = "<span class=\"verdict\">not evaluated</span>";
  // The state is not said twice.
  std::string because = feature.because();
  for (const char* prefix : {"can be proven: ", "cannot be proven: ", "not evaluated: "}) {
    if (because.starts_with(prefix)) because.erase(0, std::char_traits<char>::length(prefix));
  }
  return absl::StrCat(state, because.empty() ? ""
                                             : absl::StrCat("<br><span class=\"soft\">",
                                                            EscapeHtml(because), "</span>"));
}

// Not evaluated, then what cannot be proven, then what can; each by falling excess of u.
int OrderOfVerdict(const v1::FeatureVerdict& feature) {
  if (feature.verdict() == v1::FeatureVerdict::NOT_EVALUATED) return 0;
  return feature.can_be_proven() ? 2 : 1;
}

std::string LengthOrUnknown(bool known, double length_m) {
  return known ? MicrometreColumn(length_m) : kUnknown;
}

std::string ProbabilityOrUnknown(bool known, double probability) {
  return known ? EscapeHtml(ProbabilityText(probability)) : kUnknown;
}

std::string AcceptanceZoneText(const v1::FeatureVerdict& feature) {
  if (!feature.has_acceptance_zone_m()) return kUnknown;
  return feature.acceptance_zone_m() > 0 ? MillimetreColumn(feature.acceptance_zone_m()) : "empty";
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

std::string UncertaintyFinding(const v1::Plan& plan, const std::string& why_stopped) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  const int scans = plan.scans_size();
  std::string html =
      absl::StrCat("<strong>", scans, scans == 1 ? " scan makes " : " scans make ",
                   KnownPercent(uncertainty.admissible_fraction()),
                   "</strong> of the toleranced surface known well enough to prove its tolerances");
  if (uncertainty.goal() > 0 && !GoalReached(uncertainty))
    absl::StrAppend(&html, ", short of the goal of ", Goal(uncertainty.goal()), ": ",
                    EscapeHtml(why_stopped));
  html += ".";
  if (uncertainty.has_fresh_admissible_fraction()) {
    absl::StrAppend(&html, " On ", GroupedInteger(uncertainty.fresh_judged_targets()),
                    " targets that the search has not seen it is ",
                    KnownPercent(uncertainty.fresh_admissible_fraction()), ".");
  }
  if (uncertainty.features_size() > 0) {
    absl::StrAppend(&html, " ", ToleranceCountText(uncertainty));
  }
  const v1::ScanCountBound& bound = uncertainty.bound();
  if (bound.scans() > 0 && bound.converged()) {
    // Tolerance of the LP solver: 9.0000000001 still means 9.
    const int fewest = static_cast<int>(std::ceil(bound.scans() - 1e-6));
    absl::StrAppend(
        &html, " As far as the search for the lower bound (", FixedNumber(bound.scans(), 1),
        ") found, a plan for ", Goal(uncertainty.goal()), " needs at least ", fewest,
        fewest == 1 ? " scan" : " scans",
        GoalReached(uncertainty) && scans <= fewest ? ": no fewer than this one." : ".");
  } else if (bound.scans() > 0) {
    absl::StrAppend(&html, " The relaxation stands at ", FixedNumber(bound.scans(), 1),
                    " scans; it is not proven to be a bound.");
  }
  return html;
}

std::vector<std::pair<std::string, std::string>> UncertaintyFigures(const v1::Plan& plan) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  const auto small = [](const std::string& text) {
    return absl::StrCat(" <small>", text, "</small>");
  };
  std::vector<std::pair<std::string, std::string>> figures = {
      {"scans", absl::StrCat(plan.scans_size())},
      {"admissible",
       absl::StrCat(KnownPercent(uncertainty.admissible_fraction()),
                    uncertainty.goal() > 0 ? small("goal " + Goal(uncertainty.goal())) : "")}};
  if (uncertainty.has_fresh_admissible_fraction()) {
    figures.push_back(
        {"admissible, validation targets", KnownPercent(uncertainty.fresh_admissible_fraction())});
  }
  figures.push_back(
      {absl::StrCat("within ", SettingText("relaxed_m", uncertainty.relaxed_uncertainty_m())),
       absl::StrCat(KnownPercent(uncertainty.relaxed_fraction()),
                    uncertainty.has_fresh_relaxed_fraction()
                        ? small("fresh " + KnownPercent(uncertainty.fresh_relaxed_fraction()))
                        : "")});
  figures.push_back({"median uncertainty", LengthText(uncertainty.median_uncertainty_m())});
  if (uncertainty.bound().scans() > 0) {
    figures.push_back({uncertainty.bound().converged() ? "lower bound" : "relaxation (not a bound)",
                       absl::StrCat(FixedNumber(uncertainty.bound().scans(), 1), small("scans"))});
  }
  figures.push_back({"toleranced targets", GroupedInteger(uncertainty.judged_targets())});
  return figures;
}

std::string UncertaintyCurveSection(const v1::Plan& plan) {
  const v1::PlanUncertainty& uncertainty = plan.uncertainty();
  CoverageCurve curve;
  curve.coverage = CumulativeFractions(plan, /*relaxed=*/false);
  curve.upper = CumulativeFractions(plan, /*relaxed=*/true);
  curve.goal = uncertainty.goal();
  curve.bound_scans = uncertainty.bound().scans();
  curve.bound_converged = uncertainty.bound().converged();
  curve.title = "Part of the judged surface that is admissible, and relaxed, after each scan";
  curve.axis = "known well enough, % of the judged surface";
  curve.coverage_name = "admissible";
  curve.upper_name = "relaxed";
  if (uncertainty.has_fresh_admissible_fraction())
    curve.fresh = uncertainty.fresh_admissible_fraction();
  std::string body = CoverageCurveSvg(curve);
  if (plan.scans_size() > 0)
    absl::StrAppend(&body, BarsSvg(curve),
                    Key(uncertainty.relaxed_uncertainty_m(), curve.fresh.has_value()));
  if (!uncertainty.bound().statement().empty()) {
    absl::StrAppend(&body, "<p class=\"soft\">", EscapeHtml(uncertainty.bound().statement()),
                    "</p>\n");
  }
  if (uncertainty.second_order_points() > 0) {
    absl::StrAppend(&body, "<p class=\"notice\">At ",
                    GroupedInteger(uncertainty.second_order_points()), " of ",
                    GroupedInteger(uncertainty.examined_points()),
                    " points examined linear propagation is not to be relied on: the second order "
                    "changes a standard deviation by more than 4\u202f%.</p>\n");
  }
  return PageSection("uncertainty", "The surface becomes known scan by scan", body);
}

std::string FeatureSection(const v1::Plan& plan, bool selectable) {
  const auto& features = plan.uncertainty().features();
  if (features.empty()) return "";
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
  std::string body =
      "<p class=\"soft\">A tolerance can be proven if the guard bands leave a zone to accept in "
      "(ISO 14253-1) and a part without deviations is accepted as often as not. u is the standard "
      "uncertainty of what the tolerance is "
      "about; its parts add up as squares. Probabilities of deciding wrongly are those of a part "
      "taken from production (JCGM 106). What is not evaluated has no figures: "
      "its reason says what is missing.";
  if (selectable) body += " Select a row to see the feature in the part above.";
  absl::StrAppend(
      &body, "</p>\n", ScrollingTable("Toleranced features", "id=\"feature-table\""),
      "\n<thead>\n<tr class=\"groups\">"
      "<td></td><td></td><th scope=\"colgroup\" colspan=\"2\">Zone, mm</th>"
      "<th scope=\"colgroup\" colspan=\"5\">Standard uncertainty, \u00b5m</th>"
      "<th scope=\"colgroup\" colspan=\"2\">Wrong decisions</th><th scope=\"colgroup\" "
      "colspan=\"2\">Targets</th></tr>\n<tr>"
      "<th scope=\"col\" class=\"words\">feature</th><th scope=\"col\" class=\"words\">verdict</th>"
      "<th scope=\"col\" class=\"first\">tolerance</th><th scope=\"col\">acceptance</th>"
      "<th scope=\"col\" class=\"first\">u</th><th scope=\"col\">noise</th>"
      "<th scope=\"col\">sampling</th><th scope=\"col\">calibration</th>"
      "<th scope=\"col\">admissible</th>"
      "<th scope=\"col\" class=\"first\">acceptance</th><th scope=\"col\">rejection</th>"
      "<th scope=\"col\" class=\"first\">measured</th><th scope=\"col\">admissible</th>"
      "</tr>\n</thead>\n<tbody>\n");
  const auto share = [](int64_t part, int64_t all) {
    return all > 0 ? KnownPercent(static_cast<double>(part) / static_cast<double>(all), 0)
                   : std::string(kUnknown);
  };
  for (const int i : order) {
    const v1::FeatureVerdict& feature = features[i];
    const std::string name = feature.name().empty() ? feature.id() : feature.name();
    absl::StrAppend(
        &body,
        selectable ? absl::StrCat("<tr class=\"selectable\" data-feature=\"", i, "\">") : "<tr>",
        "<td class=\"words\"><strong>", EscapeHtml(name), "</strong><br><span class=\"soft\">",
        EscapeHtml(feature.text().empty() ? feature.kind() : feature.text()),
        "</span></td><td class=\"words verdict-cell\">", Verdict(feature),
        "</td><td class=\"first\">",
        feature.zone_width_m() > 0 ? ShortNumber(1e3 * feature.zone_width_m()) : kUnknown,
        "</td><td>", AcceptanceZoneText(feature), "</td><td class=\"first strong\">",
        LengthOrUnknown(feature.has_uncertainty_m(), feature.uncertainty_m()), "</td><td>",
        LengthOrUnknown(feature.has_noise_m(), feature.noise_m()), "</td><td>",
        LengthOrUnknown(feature.has_sampling_m(), feature.sampling_m()), "</td><td>",
        LengthOrUnknown(feature.has_calibration_m(), feature.calibration_m()), "</td><td>",
        LengthOrUnknown(feature.has_admissible_uncertainty_m(), feature.admissible_uncertainty_m()),
        "</td><td class=\"first\">",
        ProbabilityOrUnknown(feature.has_probability_wrong_acceptance(),
                             feature.probability_wrong_acceptance()),
        "</td><td>",
        ProbabilityOrUnknown(feature.has_probability_wrong_rejection(),
                             feature.probability_wrong_rejection()),
        "</td><td class=\"first\">", share(feature.measured_targets(), feature.targets()),
        "</td><td>",
        feature.has_admissible_targets() ? share(feature.admissible_targets(), feature.targets())
                                         : kUnknown,
        "</td></tr>\n");
  }
  return PageSection("features", "Which tolerances can be proven",
                     body + "</tbody></table></div>\n");
}

std::string InadmissibleSection(const TargetUncertainties& uncertainties,
                                const TargetBits& measurable) {
  int64_t judged = 0, inadmissible = 0;
  std::map<v1::UncertaintyLimit, int64_t> relaxed;
  for (size_t i = 0; i < uncertainties.total_m.size(); ++i) {
    const UncertaintyClass kind = ClassOfTarget(uncertainties, measurable, i);
    if (kind == UncertaintyClass::kNotJudged || kind == UncertaintyClass::kNotMeasurable) continue;
    ++judged;
    if (kind == UncertaintyClass::kAdmissible) continue;
    ++inadmissible;
    if (i < uncertainties.limits.size() && kind == UncertaintyClass::kRelaxed) {
      ++relaxed[uncertainties.limits[i]];
    }
  }
  if (judged == 0) {
    return PageSection("inadmissible", "Why targets are not admissible",
                       "<p>No tolerance binds a measurable target.</p>\n");
  }
  if (inadmissible == 0) {
    return PageSection("inadmissible", "Why targets are not admissible",
                       "<p>None: every toleranced target is admissible.</p>\n");
  }
  std::string body = absl::StrCat(
      "<p class=\"soft\">", GroupedInteger(inadmissible), " of ", GroupedInteger(judged),
      " toleranced targets, by the largest part of their uncertainty after "
      "all scans; of noise, by what "
      "differs most from the places that are known well enough.</p>\n");
  std::vector<std::vector<std::string>> rows;
  for (const v1::InadmissibleCount& count : CountInadmissible(uncertainties)) {
    const int64_t only_relaxed = relaxed[count.limit()];
    rows.push_back(
        {LimitWords(count.limit()), GroupedInteger(count.targets()),
         KnownPercent(static_cast<double>(count.targets()) / static_cast<double>(judged)),
         GroupedInteger(only_relaxed), GroupedInteger(count.targets() - only_relaxed),
         FixedNumber(count.median_uncertainty_over_admissible(), 2), WhatHelps(count.limit())});
  }
  body += PageTable({"what limits it", "targets", "of the judged", "only relaxed", "not reached",
                     "u over admissible", "what helps"},
                    rows, {0, 6});
  return PageSection("inadmissible", "Why targets are not admissible", body);
}

}  // namespace sightline
