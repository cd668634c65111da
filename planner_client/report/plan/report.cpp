#include "planner_client/report/plan/report.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "planner_client/report/charts/coverage_curve.h"
#include "planner_client/report/page/assets.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/plan/as_measured_html.h"
#include "planner_client/report/plan/display_mesh.h"
#include "planner_client/report/plan/pareto_section.h"
#include "planner_client/report/plan/quality_section.h"
#include "planner_client/report/plan/reasons_html.h"
#include "planner_client/report/plan/robot_section.h"
#include "planner_client/report/plan/setups_section.h"
#include "planner_client/report/plan/uncovered_regions.h"
#include "planner_client/report/plan/viewer_data.h"
#include "planner_client/report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

constexpr size_t kMaxDisplayTriangles = 300000;
constexpr size_t kMaxRegions = 20;

std::string Percent(double fraction, int decimals = 1) {
  return absl::StrFormat("%.*f\u202f%%", decimals, 100 * fraction);
}

// As it was stated: "95 %", "97.5 %".
std::string Goal(double fraction) { return absl::StrFormat("%.6g\u202f%%", 100 * fraction); }

std::string Fixed(double value, int decimals) {
  const std::string text = absl::StrFormat("%.*f", decimals, value);
  // No "-0.0" in tables; a true minus sign elsewhere.
  if (std::strtod(text.c_str(), nullptr) == 0) return absl::StrFormat("%.*f", decimals, 0.0);
  return text[0] == '-' ? absl::StrCat("\u2212", text.substr(1)) : text;
}

std::string Millimetres(double length_m, int decimals = 1) {
  return Fixed(1e3 * length_m, decimals);
}

std::string Seconds(double seconds) {
  if (seconds >= 120) {
    const auto whole = static_cast<int64_t>(std::llround(seconds));
    return absl::StrFormat("%d min %02d s", whole / 60, whole % 60);
  }
  return absl::StrCat(Fixed(seconds, seconds < 10 ? 2 : 1), " s");
}

std::string Count(int64_t count, absl::string_view noun) {
  return absl::StrCat(GroupedInteger(count), " ", noun, count == 1 ? "" : "s");
}

std::string Section(absl::string_view id, absl::string_view title, absl::string_view body,
                    absl::string_view css_class = "") {
  return absl::StrCat("<section id=\"", id, "\" class=\"", css_class, "\">\n<h2>", title, "</h2>\n",
                      body, "</section>\n");
}

// Two columns: what it is, its value. Values are HTML.
std::string Facts(const std::vector<std::pair<std::string, std::string>>& facts,
                  absl::string_view value_class = "") {
  std::string html = "<table class=\"facts\"><tbody>\n";
  for (const auto& [name, value] : facts) {
    absl::StrAppend(&html, "<tr><th scope=\"row\">", EscapeHtml(name), "</th><td class=\"",
                    value_class, "\">", value, "</td></tr>\n");
  }
  return html + "</tbody></table>\n";
}

std::string Figure(const std::string& png, absl::string_view caption) {
  if (png.empty()) return "";
  return absl::StrCat("<figure><img alt=\"", EscapeHtml(caption), "\" src=\"", PngDataUri(png),
                      "\"><figcaption>", EscapeHtml(caption), "</figcaption></figure>\n");
}

bool GoalReached(const v1::PlanCoverage& coverage) {
  return coverage.goal() > 0 && coverage.coverage() >= coverage.goal() - 1e-12;
}

std::string StopWords(v1::Plan::StopReason reason) {
  switch (reason) {
    case v1::Plan::STOP_REASON_GOAL_REACHED:
      return "the goal was reached";
    case v1::Plan::STOP_REASON_MAX_SCANS:
      return "the largest number of scans was reached";
    case v1::Plan::STOP_REASON_MAX_TIME:
      return "the time was up";
    case v1::Plan::STOP_REASON_STALLED:
      return "further scans would have added too little, although the rig can measure more";
    case v1::Plan::STOP_REASON_INTERRUPTED:
      return "it was interrupted";
    case v1::Plan::STOP_REASON_EVALUATED:
      return "the plan was given; only its coverage was computed";
    default:
      return "not recorded";
  }
}

std::string MeasurableShare(const v1::PlanCoverage& coverage) {
  if (coverage.targets() <= 0) return "";
  return absl::StrCat(
      " ",
      Percent(static_cast<double>(coverage.measurable_targets()) /
                  static_cast<double>(coverage.targets()),
              0),
      " of the whole surface is measurable with this rig",
      coverage.measurable_in_free_space_targets() > coverage.measurable_targets()
          ? absl::StrCat(" (table, rests, domain and limits leave that of the ",
                         Percent(static_cast<double>(coverage.measurable_in_free_space_targets()) /
                                     static_cast<double>(coverage.targets()),
                                 0),
                         " that sensors anywhere would measure)")
          : "",
      ".");
}

// The answer in a sentence or two.
std::string Finding(const v1::Plan& plan) {
  const v1::PlanCoverage& coverage = plan.coverage();
  const int scans = plan.scans_size();
  if (plan.has_uncertainty()) {
    return absl::StrCat(UncertaintyFinding(plan, StopWords(plan.stop_reason())),
                        scans == 1 ? " It measures " : " The scans measure ",
                        Percent(coverage.coverage()), " of the measurable surface.",
                        MeasurableShare(coverage));
  }
  std::string html =
      absl::StrCat("<strong>", Count(scans, "scan"), scans == 1 ? " measures " : " measure ",
                   Percent(coverage.coverage()), "</strong> of the measurable surface");
  if (coverage.goal() > 0 && !GoalReached(coverage)) {
    absl::StrAppend(&html, ", short of the goal of ", Goal(coverage.goal()), ": ",
                    StopWords(plan.stop_reason()));
  }
  html += ".";
  if (coverage.has_fresh_coverage()) {
    absl::StrAppend(&html, " On ", GroupedInteger(coverage.fresh_measurable_targets()),
                    " targets that the search has not seen it is ",
                    Percent(coverage.fresh_coverage()), ".");
  }
  const v1::ScanCountBound& bound = plan.bound();
  if (bound.scans() > 0 && bound.converged()) {
    // Tolerance of the LP solver: 9.0000000001 still means 9.
    const int fewest = static_cast<int>(std::ceil(bound.scans() - 1e-6));
    absl::StrAppend(&html, " As far as the search for the lower bound (", Fixed(bound.scans(), 1),
                    ") found, a plan for ", Goal(coverage.goal()), " needs at least ",
                    Count(fewest, "scan"),
                    GoalReached(coverage) && scans <= fewest ? ": no fewer than this one." : ".");
  } else if (bound.scans() > 0) {
    absl::StrAppend(&html, " The relaxation stands at ", Fixed(bound.scans(), 1),
                    " scans; it is not proven to be a bound.");
  }
  return html + MeasurableShare(coverage);
}

std::string Figures(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  std::vector<std::pair<std::string, std::string>> figures;
  if (plan.has_uncertainty()) {
    figures = UncertaintyFigures(plan);
  } else {
    figures.push_back({"scans", absl::StrCat(plan.scans_size())});
  }
  // A plan for uncertainty has the goal of its own.
  const bool coverage_goal = plan.coverage().goal() > 0 && !plan.has_uncertainty();
  figures.push_back(
      {"measured",
       absl::StrCat(Percent(plan.coverage().coverage()),
                    coverage_goal
                        ? absl::StrCat(" <small>goal ", Goal(plan.coverage().goal()), "</small>")
                        : "")});
  if (plan.coverage().has_fresh_coverage()) {
    figures.push_back({"measured, fresh targets", Percent(plan.coverage().fresh_coverage())});
  }
  if (plan.bound().scans() > 0 && !plan.has_uncertainty()) {
    figures.push_back({plan.bound().converged() ? "lower bound" : "relaxation (not a bound)",
                       absl::StrCat(Fixed(plan.bound().scans(), 1), " <small>scans</small>")});
  }
  figures.push_back(
      {"targets", absl::StrCat(GroupedInteger(plan.coverage().measurable_targets()), " <small>of ",
                               GroupedInteger(plan.coverage().targets()), " measurable</small>")});
  if (!plan.cost().unit_costs() && plan.cost().total() > 0) {
    figures.push_back(
        {"time to execute", Seconds(plan.cost().scan_time_s() + plan.cost().reposition_time_s() +
                                    plan.robot_move_time_s())});
  }
  double planning_s = 0;
  for (const NamedTiming& timing : data.timings) planning_s += timing.seconds;
  if (planning_s > 0) figures.push_back({"computed in", Seconds(planning_s)});
  std::string html;
  for (const auto& [name, value] : figures) {
    absl::StrAppend(&html, "<div><dt>", EscapeHtml(name), "</dt><dd>", value, "</dd></div>");
  }
  return html;
}

std::string CurveSection(const v1::Plan& plan) {
  CoverageCurve curve;
  const double measurable =
      std::max<double>(1, static_cast<double>(plan.coverage().measurable_targets()));
  for (const v1::PlannedScan& scan : plan.scans()) {
    curve.coverage.push_back(static_cast<double>(scan.cumulative_targets()) / measurable);
  }
  if (!plan.has_uncertainty()) {
    curve.goal = plan.coverage().goal();
    curve.bound_scans = plan.bound().scans();
    curve.bound_converged = plan.bound().converged();
  }
  if (plan.coverage().has_fresh_coverage()) curve.fresh = plan.coverage().fresh_coverage();
  std::string body = CoverageCurveSvg(curve);
  if (curve.fresh.has_value()) {
    body +=
        "<p class=\"soft key-line\">\u25c7 the same after the last scan, on targets that the "
        "search "
        "has not seen</p>\n";
  }
  if (!plan.bound().statement().empty() && !plan.has_uncertainty()) {
    absl::StrAppend(&body, "<p class=\"soft\">", EscapeHtml(plan.bound().statement()), "</p>\n");
  }
  return Section("curve", "Coverage grows scan by scan", body);
}

// `judged`: targets that a tolerance binds; 0: the plan is not for uncertainty.
std::string ScanRow(const v1::PlannedScan& scan, const ReportScan& extra, int number,
                    double measurable, double judged, const std::string& setup) {
  const v1::Measurement& m = scan.measurement();
  std::string row = absl::StrCat("<tr class=\"selectable\" data-scan=\"", number,
                                 "\"><td class=\"strong\">", scan.index());
  if (scan.locked()) row += "<span class=\"badge\">locked</span>";
  if (!setup.empty()) absl::StrAppend(&row, "<br><small>", EscapeHtml(setup), "</small>");
  row += "</td><td>";
  if (!extra.rendered_view_png.empty()) {
    absl::StrAppend(&row, "<img class=\"thumb\" alt=\"Scan ", scan.index(),
                    ": part, camera and laser\" src=\"", PngDataUri(extra.rendered_view_png),
                    "\">");
  }
  const auto cell = [&row](const std::string& text, absl::string_view css_class = "") {
    if (css_class.empty()) {
      absl::StrAppend(&row, "</td><td>", text);
    } else {
      absl::StrAppend(&row, "</td><td class=\"", css_class, "\">", text);
    }
  };
  cell(Millimetres(m.camera_distance_m()), "first");
  cell(Fixed(m.triangulation_angle_deg(), 2));
  cell(Fixed(m.camera_azimuth_deg(), 2));
  cell(Fixed(m.camera_polar_deg(), 2));
  cell(Fixed(m.part_alpha_deg(), 2), "first");
  cell(Fixed(m.part_beta_deg(), 2));
  cell(Fixed(m.part_gamma_deg(), 2));
  cell(Millimetres(m.offset_y_m()));
  cell(Millimetres(m.offset_z_m()));
  cell(Millimetres(scan.stage_start_m(), 0), "first");
  cell(Millimetres(scan.stage_end_m(), 0));
  cell(GroupedInteger(scan.trigger_positions_m_size()));
  cell(scan.scan_time_s() > 0 ? Fixed(scan.scan_time_s(), 1) : "\u2013");
  cell(GroupedInteger(scan.covered_targets()), "first");
  cell(GroupedInteger(scan.new_targets()));
  cell(Percent(static_cast<double>(scan.cumulative_targets()) / measurable), "strong");
  if (judged > 0) {
    cell(Percent(static_cast<double>(scan.cumulative_admissible_targets()) / judged),
         "first strong");
    cell(Percent(static_cast<double>(scan.cumulative_relaxed_targets()) / judged));
  }
  return row + "</td></tr>\n";
}

std::string ScansSection(const ReportData& data) {
  if (data.scans.empty()) return Section("scans", "Scans", "<p>The plan has no scans.</p>\n");
  std::string body =
      "<p class=\"soft\">Select a row to see the scan in the part above; click a picture to "
      "enlarge it. "
      "Camera distance, triangulation angle \u03c4, azimuth \u03c6 and polar angle \u03b8 place "
      "camera and "
      "laser; \u03b1, \u03b2, \u03b3 turn the part about x, y, z; y and z shift it.</p>\n"
      "<div class=\"table-wrap\"><table id=\"scan-table\">\n<thead>\n<tr "
      "class=\"groups\"><th></th><th></th>"
      "<th colspan=\"4\">Camera and laser</th><th colspan=\"5\">Part</th><th "
      "colspan=\"4\">Stage</th>"
      "<th colspan=\"3\">Targets</th>{{GROUP}}</tr>\n"
      "<tr><th>scan</th><th></th><th class=\"first\">distance<br>mm</th><th>\u03c4<br>\u00b0</th>"
      "<th>\u03c6<br>\u00b0</th><th>\u03b8<br>\u00b0</th><th class=\"first\">\u03b1<br>\u00b0</th>"
      "<th>\u03b2<br>\u00b0</th><th>\u03b3<br>\u00b0</th><th>y<br>mm</th><th>z<br>mm</th>"
      "<th class=\"first\">start<br>mm</th><th>end<br>mm</th><th>frames</th><th>time<br>s</th>"
      "<th class=\"first\">measured</th><th>new</th><th>sum</th>{{HEAD}}</tr>\n</thead>\n<tbody>\n";
  const bool uncertain = data.plan.has_uncertainty();
  body = absl::StrReplaceAll(
      body, {{"{{GROUP}}", uncertain ? "<th colspan=\"2\">Known well enough</th>" : ""},
             {"{{HEAD}}", uncertain ? "<th class=\"first\">admissible</th><th>relaxed</th>" : ""}});
  const double judged =
      uncertain ? std::max<double>(1, static_cast<double>(data.plan.uncertainty().judged_targets()))
                : 0;
  const double measurable =
      std::max<double>(1, static_cast<double>(data.plan.coverage().measurable_targets()));
  for (size_t i = 0; i < data.scans.size(); ++i) {
    body += ScanRow(data.plan.scans(static_cast<int>(i)), data.scans[i], static_cast<int>(i) + 1,
                    measurable, judged, SetupText(data.plan, data.plan.scans(static_cast<int>(i))));
  }
  body += "</tbody></table></div>\n";
  if (!data.set_up_sheet.empty()) {
    absl::StrAppend(&body, "<p>To set them up: <a href=\"", EscapeHtml(data.set_up_sheet),
                    "\">set-up sheet</a>, a page to print for every scan.</p>\n");
  }
  return Section("scans", "Scans", body, "long");
}

std::string SetupsSection(const ReportData& data) {
  std::vector<std::string> pictures;
  for (const ReportScan& scan : data.scans) pictures.push_back(scan.rendered_view_png);
  const std::string body = SetupsHtml(data.plan, pictures);
  return body.empty() ? "" : Section("setups", "How the part lies", body, "long");
}

std::string RegionsSection(const ReportData& data, const std::vector<UncoveredRegion>& regions,
                           size_t region_count, int64_t uncovered) {
  if (regions.empty()) {
    return Section("uncovered", "What stays unmeasured",
                   "<p>Nothing: every measurable target is measured.</p>\n");
  }
  const Eigen::AlignedBox3d bounds = data.mesh.BoundingBox();
  std::string body = absl::StrCat(
      "<p class=\"soft\">", Count(uncovered, "measurable target"), " in ",
      Count(static_cast<int64_t>(region_count), "connected region"),
      " are not measured by any scan",
      region_count > regions.size() ? absl::StrCat("; the ", regions.size(), " largest") : "",
      ". Select a row to look at it above.</p>\n"
      "<div class=\"table-wrap\"><table "
      "id=\"region-table\">\n<thead><tr><th>region</th><th>targets</th>"
      "<th>of the surface</th><th>area<br>mm\u00b2</th><th>extent<br>mm</th><th>centre x, y, "
      "z<br>mm</th>"
      "<th class=\"words\">where</th>",
      data.reasons.empty() ? "" : "<th class=\"words\">why</th>", "</tr></thead>\n<tbody>\n");
  for (size_t i = 0; i < regions.size(); ++i) {
    const UncoveredRegion& region = regions[i];
    const Eigen::Vector3d size = region.bounds_m.sizes();
    absl::StrAppend(
        &body, "<tr class=\"selectable\" data-region=\"", i, "\"><td class=\"strong\">", i + 1,
        "</td><td>", GroupedInteger(static_cast<int64_t>(region.targets.size())), "</td><td>",
        Percent(region.area_share, 2), "</td><td>",
        GroupedInteger(std::llround(1e6 * region.area_share * data.health.area_m2())), "</td><td>",
        Millimetres(size.x(), 0), " \u00d7 ", Millimetres(size.y(), 0), " \u00d7 ",
        Millimetres(size.z(), 0), "</td><td>", Millimetres(region.centroid_m.x(), 0), ", ",
        Millimetres(region.centroid_m.y(), 0), ", ", Millimetres(region.centroid_m.z(), 0),
        "</td><td class=\"words\">", DescribePlace(region, bounds),
        data.reasons.empty()
            ? ""
            : absl::StrCat("</td><td class=\"words\">", ReasonsOf(data, region.targets)),
        "</td></tr>\n");
  }
  body += "</tbody></table></div>\n";
  return Section("uncovered", "What stays unmeasured", body, "long");
}

// What the targets that are not measurable are, if there are any.
std::string UnmeasurableWords(const ReportData& data) {
  const int64_t others = data.plan.coverage().targets() - data.plan.coverage().measurable_targets();
  if (others == 0) return "";
  const std::string reasons = ReasonsOfUnmeasurable(data);
  return absl::StrCat(" The other ", GroupedInteger(others), others == 1 ? " counts" : " count",
                      " neither for a scan nor against it",
                      reasons.empty() ? "." : absl::StrCat(": ", reasons, "."));
}

std::string MeasurabilitySection(const ReportData& data) {
  const int64_t targets = data.plan.coverage().targets();
  const int64_t measurable = data.plan.coverage().measurable_targets();
  const int64_t anywhere = data.plan.coverage().measurable_in_free_space_targets();
  const auto share = [&](int64_t part) {
    return Percent(targets > 0 ? static_cast<double>(part) / static_cast<double>(targets) : 0);
  };
  const std::string directions =
      " can be seen and lit from some pair of directions 10\u00b0 to 80\u00b0 apart";
  std::string body = absl::StrCat(
      "<p>", GroupedInteger(measurable), " of ", Count(targets, "target"), " (", share(measurable),
      ")",
      anywhere > 0
          ? absl::StrCat(" can be measured with this rig: as the part may lie, past table and "
                         "obstacles, within domain and limits. ",
                         GroupedInteger(anywhere), " (", share(anywhere), ")", directions,
                         " if the sensors may stand anywhere.")
          : absl::StrCat(directions, "."),
      UnmeasurableWords(data), "</p>\n<div class=\"pictures\">",
      Figure(data.measurability_png, "Measurable surface"), "</div>\n");
  return Section("measurability", "What can be measured at all", body);
}

std::string PartSection(const ReportData& data) {
  const v1::PartHealth& health = data.health;
  const Eigen::Vector3d size = data.mesh.BoundingBox().sizes();
  std::string body;
  if (health.findings().empty()) {
    body += "<p>The mesh is sound.</p>\n";
  } else {
    body += "<ul>";
    for (const std::string& finding : health.findings()) {
      absl::StrAppend(&body, "<li>", EscapeHtml(finding), "</li>");
    }
    body += "</ul>\n";
  }
  body += Facts(
      {{"Size", absl::StrCat(Millimetres(size.x()), " \u00d7 ", Millimetres(size.y()), " \u00d7 ",
                             Millimetres(size.z()), " mm")},
       {"Surface", absl::StrCat(GroupedInteger(std::llround(1e4 * health.area_m2())), " cm\u00b2")},
       {"Triangles", GroupedInteger(health.triangle_count())},
       {"Components", GroupedInteger(health.component_count())},
       {"Open edges", GroupedInteger(health.open_edge_count())},
       {"Non-manifold edges", GroupedInteger(health.non_manifold_edge_count())},
       {"Degenerate triangles", GroupedInteger(health.degenerate_triangle_count())},
       {"Duplicate triangles", GroupedInteger(health.duplicate_triangle_count())},
       {"Flipped components", GroupedInteger(health.flipped_component_count())}});
  return Section("part", "Part", body);
}

std::string AccuracySection(const ReportData& data) {
  const v1::PlanCoverage& coverage = data.plan.coverage();
  const auto of_measurable = [&](int64_t count) {
    return Percent(
        coverage.measurable_targets() > 0
            ? static_cast<double>(count) / static_cast<double>(coverage.measurable_targets())
            : 0,
        2);
  };
  std::string body =
      "<p class=\"soft\">Every number in this report comes from the exact, frame-by-frame "
      "evaluation. The "
      "search used a faster estimate; this is how far it was off for the scans of this plan.</p>\n";
  std::vector<std::pair<std::string, std::string>> fresh;
  if (coverage.has_fresh_coverage()) {
    fresh.push_back({"Measured, on fresh targets", Percent(coverage.fresh_coverage(), 2)});
    fresh.push_back(
        {"Fresh measurable targets", GroupedInteger(coverage.fresh_measurable_targets())});
  }
  if (data.plan.uncertainty().has_fresh_admissible_fraction()) {
    fresh.push_back({"Admissible", Percent(data.plan.uncertainty().admissible_fraction(), 2)});
    fresh.push_back({"Admissible, on fresh targets",
                     Percent(data.plan.uncertainty().fresh_admissible_fraction(), 2)});
  }
  if (!fresh.empty()) {
    body +=
        "<p class=\"soft\">Scans are chosen to suit the plan's targets; fresh targets, sampled "
        "anew, "
        "show how much of that holds for the surface between them.</p>\n";
  }
  body += Facts({{"Fast estimate, mean error",
                  absl::StrCat(Percent(coverage.fast_mean_absolute_error(), 2), " of all targets")},
                 {"Fast estimate, largest error",
                  absl::StrCat(Percent(coverage.fast_max_absolute_error(), 2), " of all targets")},
                 {"Measured, exact", of_measurable(coverage.covered_targets())},
                 {"Measured, without the check of normals",
                  of_measurable(coverage.covered_targets_without_normal_gate())}});
  if (!fresh.empty()) body += Facts(fresh);
  return Section("accuracy", "How sure the numbers are", body);
}

std::string CostSection(const v1::Plan& plan) {
  const v1::PlanCost& cost = plan.cost();
  double travel_m = 0;
  for (const v1::PlannedScan& scan : plan.scans())
    travel_m += scan.stage_end_m() - scan.stage_start_m();
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Scans", absl::StrCat(plan.scans_size())},
      {"Stage travel while scanning", absl::StrCat(Millimetres(travel_m, 0), " mm")}};
  std::string body;
  if (cost.unit_costs()) {
    body =
        "<p class=\"soft\">The inspection states no speeds or times, so each scan costs 1.</p>\n";
    facts.push_back({"Cost", Fixed(cost.total(), 0)});
  } else {
    facts.push_back({"Scanning", Seconds(cost.scan_time_s())});
    facts.push_back({"Repositioning", Seconds(cost.reposition_time_s())});
    if (plan.robot_move_time_s() > 0) {
      facts.push_back({"Moves of the robot", Seconds(plan.robot_move_time_s())});
    }
    facts.push_back({"Total", absl::StrCat("<strong>", Seconds(cost.total()), "</strong>")});
  }
  return Section("cost", "Cost of executing it", body + Facts(facts));
}

std::string TimingSection(const ReportData& data) {
  std::vector<std::pair<std::string, std::string>> facts;
  double total = 0;
  for (const NamedTiming& timing : data.timings) {
    facts.push_back({timing.name, Seconds(timing.seconds)});
    total += timing.seconds;
  }
  if (facts.size() > 1)
    facts.push_back({"Total", absl::StrCat("<strong>", Seconds(total), "</strong>")});
  facts.push_back({"Gain evaluations", GroupedInteger(data.plan.gain_evaluations())});
  return Section("timing", "Computing time", Facts(facts));
}

std::string ComparisonSection(const ComparisonTable& table) {
  std::string body =
      "<p class=\"soft\">Scans needed at equal numbers of gain evaluations: median over the seeds, "
      "with the "
      "range.</p>\n<div class=\"table-wrap\"><table class=\"facts\">\n<thead><tr><th>strategy</th>"
      "<th>seeds</th>";
  for (const double goal : table.goals) absl::StrAppend(&body, "<th>", Goal(goal), "</th>");
  body += "</tr></thead>\n<tbody>\n";
  for (const StrategyComparison& strategy : table.strategies) {
    absl::StrAppend(&body, "<tr><th scope=\"row\">", EscapeHtml(strategy.strategy), "</th><td>",
                    strategy.seeds, "</td>");
    for (const StrategyComparison::Scans& scans : strategy.scans) {
      if (scans.seeds_reached == 0) {
        body += "<td>not reached</td>";
        continue;
      }
      absl::StrAppend(&body, "<td><strong>", absl::StrFormat("%g", scans.median),
                      "</strong> <span class=\"soft\">", scans.min, "\u2013", scans.max, "</span>",
                      scans.seeds_reached < strategy.seeds
                          ? absl::StrCat(" <span class=\"soft\">(", scans.seeds_reached, " of ",
                                         strategy.seeds, ")</span>")
                          : "",
                      "</td>");
    }
    body += "</tr>\n";
  }
  return Section("comparison", "Strategies compared", body + "</tbody></table></div>\n");
}

std::string NotesSection(const std::vector<std::string>& notes) {
  std::string body = "<ul>";
  for (const std::string& note : notes) absl::StrAppend(&body, "<li>", EscapeHtml(note), "</li>");
  return Section("notes", "Notes", body + "</ul>\n");
}

std::string ProvenanceSection(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  const auto text = [](const std::string& value) {
    return value.empty() ? "\u2013" : EscapeHtml(value);
  };
  const auto code = [&](const std::string& value) {
    return absl::StrCat("<code>", text(value), "</code>");
  };
  std::string gain;
  for (const auto& [name, weight] :
       {std::pair{"covered", plan.uncertainty().gain().coverage()},
        std::pair{"admissible", plan.uncertainty().gain().admissible()},
        std::pair{"relaxed", plan.uncertainty().gain().relaxed()},
        std::pair{"information", plan.uncertainty().gain().information()},
        std::pair{"total uncertainty", plan.uncertainty().gain().total_uncertainty()}}) {
    if (weight != 0)
      absl::StrAppendFormat(&gain, "%s%.4g %s", gain.empty() ? "" : " + ", weight, name);
  }
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Inspection", text(plan.inspection_name())},
      {"Part", text(data.part_name)},
      {"Sightline", text(plan.sightline_version())},
      {"Strategy", text(plan.strategy())},
      {"Seed", absl::StrCat(plan.seed())},
      {"Stopped because", StopWords(plan.stop_reason())},
      {"Target spacing",
       absl::StrCat(Millimetres(data.sampling.spacing_m), " mm, seed ", data.sampling.seed)},
      {"Coverage radius", absl::StrCat(Millimetres(data.sampling.coverage_radius_m), " mm")},
      {"Part digest", code(plan.part_digest())},
      {"Scene digest", code(plan.scene_digest())}};
  if (!gain.empty()) facts.push_back({"Gain of a target", gain});
  return Section("provenance", "How to get this plan again", Facts(facts, "left"));
}

absl::Status Check(const ReportData& data) {
  const auto mismatch = [](absl::string_view field, size_t size, size_t expected,
                           absl::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrFormat("report: %s has size %d, must be %d (%s)", field, size, expected, what));
  };
  const size_t targets = data.targets.size();
  if (targets == 0)
    return absl::InvalidArgumentError("report: targets is empty, must hold at least one");
  if (data.mesh.triangles.empty()) {
    return absl::InvalidArgumentError("report: mesh.triangles is empty, must hold at least one");
  }
  if (data.targets.normals.size() != targets) {
    return mismatch("targets.normals", data.targets.normals.size(), targets, "number of targets");
  }
  if (!data.targets.regions.empty() && data.targets.regions.size() != targets) {
    return mismatch("targets.regions", data.targets.regions.size(), targets, "number of targets");
  }
  if (data.measurable.size() != targets) {
    return mismatch("measurable", data.measurable.size(), targets, "number of targets");
  }
  if (!data.reasons.empty() && data.reasons.size() != targets) {
    return mismatch("reasons", data.reasons.size(), targets, "number of targets");
  }
  const auto scans = static_cast<size_t>(data.plan.scans_size());
  if (data.scans.size() != scans)
    return mismatch("scans", data.scans.size(), scans, "number of scans of the plan");
  if (data.robot && data.robot->scans.size() != scans) {
    return mismatch("robot.scans", data.robot->scans.size(), scans, "number of scans of the plan");
  }
  for (size_t i = 0; i < scans; ++i) {
    if (data.scans[i].covered.size() != targets) {
      return mismatch(absl::StrCat("scans[", i, "].covered"), data.scans[i].covered.size(), targets,
                      "number of targets");
    }
    const v1::PlannedScan& scan = data.plan.scans(static_cast<int>(i));
    const std::pair<absl::string_view, const v1::Pose*> poses[] = {
        {"camera_pose", &scan.camera_pose()},
        {"laser_pose", &scan.laser_pose()},
        {"part_pose", &scan.part_pose()}};
    for (const auto& [name, pose] : poses) {
      if (pose->matrix_size() != 16) {
        return mismatch(absl::StrCat("plan.scans[", i, "].", name, ".matrix"), pose->matrix_size(),
                        16, "4 x 4 numbers");
      }
    }
  }
  if (!data.depth_per_pixel_m.empty() && data.depth_per_pixel_m.size() != targets) {
    return mismatch("depth_per_pixel_m", data.depth_per_pixel_m.size(), targets,
                    "number of targets");
  }
  if (data.uncertainty.has_value()) {
    return CheckTargetUncertainties(*data.uncertainty, targets, scans,
                                    static_cast<size_t>(data.plan.uncertainty().features_size()),
                                    "report: uncertainty");
  }
  return absl::OkStatus();
}

// Replaces {{NAME}} marks in one pass: what is put in is not searched again.
std::string FillTemplate(absl::string_view text,
                         const std::vector<std::pair<absl::string_view, std::string>>& values) {
  std::string result;
  while (true) {
    const size_t begin = text.find("{{");
    const size_t end = begin == absl::string_view::npos ? begin : text.find("}}", begin);
    if (end == absl::string_view::npos) break;
    absl::StrAppend(&result, text.substr(0, begin));
    const absl::string_view name = text.substr(begin + 2, end - begin - 2);
    for (const auto& [key, value] : values) {
      if (key == name) result += value;
    }
    text.remove_prefix(end + 2);
  }
  absl::StrAppend(&result, text);
  return result;
}

}  // namespace

absl::StatusOr<std::string> RenderReport(const ReportData& data) {
  if (absl::Status status = Check(data); !status.ok()) return status;

  TargetBits uncovered = data.measurable, covered(data.targets.size());
  for (const ReportScan& scan : data.scans) covered |= scan.covered;
  uncovered.Subtract(covered);
  const int64_t uncovered_count = uncovered.Count();
  std::vector<UncoveredRegion> regions =
      FindUncoveredRegions(data.targets, data.sampling, uncovered);
  const size_t region_count = regions.size();
  if (regions.size() > kMaxRegions) regions.erase(regions.begin() + kMaxRegions, regions.end());
  const DisplayMesh display =
      MakeDisplayMesh(data.mesh, data.targets, data.sampling.spacing_m, kMaxDisplayTriangles);

  std::string sections;
  if (data.plan.has_uncertainty()) {
    const bool selectable =
        data.uncertainty.has_value() && !data.uncertainty->feature_targets.empty();
    sections += UncertaintyCurveSection(data.plan) + FeatureSection(data.plan, selectable);
  }
  if (data.uncertainty.has_value())
    sections += InadmissibleSection(*data.uncertainty, data.measurable);
  if (data.plan.has_as_measured()) {
    sections += Section("as-measured", "As measured",
                        AsMeasuredHtml(data.plan.as_measured(), data.plan.scans_size(),
                                       data.plan.has_uncertainty(), data.deviations));
  }
  if (data.pareto.has_value()) sections += ParetoSection(*data.pareto);
  sections += CurveSection(data.plan) + SetupsSection(data) + ScansSection(data) +
              QualitySection(data.plan) + (data.robot ? RobotSection(data.plan, *data.robot) : "") +
              RegionsSection(data, regions, region_count, uncovered_count);
  if (const std::string reasons = ReasonsHtml(data); !reasons.empty()) {
    sections += Section("reasons", "Why places are not measured", reasons);
  }
  sections += MeasurabilitySection(data);
  if (data.comparison.has_value()) sections += ComparisonSection(*data.comparison);
  absl::StrAppend(&sections, "<div class=\"columns\">", CostSection(data.plan), TimingSection(data),
                  AccuracySection(data), PartSection(data), "</div>\n");
  std::vector<std::string> notes = data.notes;
  if (display.simplified) {
    notes.push_back(absl::StrCat("The interactive view shows a simplified mesh; planning used all ",
                                 GroupedInteger(static_cast<int64_t>(data.mesh.triangles.size())),
                                 " triangles."));
  }
  if (!notes.empty()) sections += NotesSection(notes);
  sections += ProvenanceSection(data);

  const std::string name =
      data.plan.inspection_name().empty() ? data.part_name : data.plan.inspection_name();
  // Also what is printed in place of the interactive view.
  const std::string fallback = absl::StrCat(
      "<div class=\"pictures\">", Figure(data.coverage_png, "Measured by the plan"), "</div>");
  return FillTemplate(
      ReportTemplate(),
      {{"TITLE", EscapeHtml(absl::StrCat(name, " \u2013 inspection plan"))},
       {"STYLE", absl::StrCat(ReportStyle(), data.pareto ? ChartStyle() : "")},
       {"HEADING", EscapeHtml(name)},
       {"FINDING", Finding(data.plan)},
       {"FIGURES", Figures(data)},
       {"FALLBACK", fallback},
       {"SECTIONS", sections},
       {"FOOTER", absl::StrCat("Sightline ", EscapeHtml(data.plan.sightline_version()),
                               ". One file, nothing is loaded from anywhere.")},
       {"VIEWER_DATA", JsonForScript(ViewerDataJson(data, display, regions))},
       {"VIEWER_SCRIPT", std::string(ViewerScript())}});
}

}  // namespace sightline
