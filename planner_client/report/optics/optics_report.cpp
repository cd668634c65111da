// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/optics/optics_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "planner_client/report/optics/detection_section.h"
#include "planner_client/report/optics/optics_charts.h"
#include "planner_client/report/optics/optics_text.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

using Choice = v1::OpticsChoice;
using Combination = v1::DeviceCombination;
using Interval = v1::OpticsInterval;
using v1::OpticsPoint;

constexpr char kUPx[] = "u<sub>px</sub>";
// A catalogue's combinations multiply; nobody reads more of them than these.
constexpr size_t kMaxCombinations = 200;

std::string Detail(const std::string& html) {
  return html.empty() ? "" : absl::StrCat("<span class=\"detail\">", html, "</span>");
}

std::string QuantityHtml(const std::string& name, double value) {
  return EscapeHtml(QuantityText(name, value));
}

// What is 0 because it is not known, or was not computed, is a dash.
std::string Known(const std::string& name, double value) {
  return value == 0 ? "\u2013" : QuantityHtml(name, value);
}

std::string Setting(const std::string& name, double value) {
  return value == 0 ? "\u2013" : EscapeHtml(SettingText(name, value));
}

std::string Share(double share) { return EscapeHtml(ShareText(share)); }

std::string IntervalText(const std::string& name, bool known, const Interval& interval) {
  return known ? EscapeHtml(QuantityInterval(name, interval.lower(), interval.upper())) : "";
}

std::string UPxInterval(const OpticsPoint& p) {
  return IntervalText("u_px", p.has_u_px_interval() && std::isfinite(UPx(p)), p.u_px_interval());
}

std::string CoverageInterval(const OpticsPoint& p) {
  return IntervalText("coverage_fraction", p.has_profile_coverage_interval(),
                      p.profile_coverage_interval());
}

std::string CostInterval(const OpticsPoint& p) {
  return IntervalText("cost_px", p.has_cost_interval(), p.cost_interval());
}

std::string Count(double per_column) { return Number(per_column, 2); }

std::string FrameName(const v1::RepresentativeFrame& frame) {
  return absl::StrCat("Scan ", frame.scan(), ", frame ", frame.frame());
}

std::string ChoiceName(const Choice& choice) {
  return choice.scan() == 0 ? "all scans" : absl::StrCat("scan ", choice.scan());
}

class Report {
 public:
  Report(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices)
      : optics_(optics), devices_(devices) {
    if (optics.has_best() || optics.common().has_best()) {
      curve_.best = optics.has_best() ? &optics.best() : &optics.common().best();
    }
    for (const OpticsPoint& point :
         optics.curve().empty() ? optics.common().curve() : optics.curve()) {
      curve_.points.push_back(&point);
    }
    std::stable_sort(
        curve_.points.begin(), curve_.points.end(),
        [](const OpticsPoint* a, const OpticsPoint* b) { return a->f_number() < b->f_number(); });
    curve_.longest_exposure_time_s = optics.common().longest_exposure_time_s();
  }

  std::string Html() const {
    const std::string& name = optics_.inspection_name();
    StaticPage page;
    page.title = absl::StrCat(name.empty() ? "Inspection" : name, " \u2013 optics");
    page.kicker = absl::StrCat("Sightline \u00b7 optics", name.empty() ? "" : " \u00b7 ", name);
    if (curve_.best != nullptr) page.heading = SettingWords(*curve_.best);
    if (page.heading.empty()) page.heading = "No setting was found";
    page.finding_html = EscapeHtml(optics_.common().statement());
    page.figures = Figures();
    page.warnings.assign(optics_.warnings().begin(), optics_.warnings().end());
    page.sections_html =
        PageSection("f-number", "What every f-number can do", FNumbers()) +
        PageSection("exposure", "Cost against exposure time", ExposureChart(curve_)) +
        PageSection("curve", "Every f-number in numbers", CurveTable()) +
        PageSection("alternatives", "What a freedom is worth", Alternatives()) +
        PageSection("scans", "A setting for every scan", Scans()) +
        PageSection("rounds", "Geometry and optics in turn", RoundsSection(optics_)) +
        PageSection("detection", "What planning of the geometry needs",
                    DetectionSection(optics_.common())) +
        PageSection("frames", "Frames it was judged by", Frames()) +
        PageSection("devices", "Cameras, lenses and lasers", Devices()) +
        PageSection("method", "How this was computed", Method());
    return StaticPageHtml(page);
  }

 private:
  std::vector<std::pair<std::string, std::string>> Figures() const {
    if (curve_.best == nullptr) return {};
    const OpticsPoint& best = *curve_.best;
    const auto with = [](const std::string& value, const std::string& interval) {
      return interval.empty() ? value : absl::StrCat(value, " <small>", interval, "</small>");
    };
    std::vector<std::pair<std::string, std::string>> figures = {
        {"scatter of the line, u\u209a\u2093",
         with(QuantityHtml("u_px", UPx(best)), UPxInterval(best))},
        {"detected part of the line", with(Share(best.profile_coverage()), CoverageInterval(best))},
        {"cost", with(QuantityHtml("cost_px", best.cost()), CostInterval(best))},
        {"false lines per column", Count(best.false_lines_per_column())}};
    if (best.u_height_m() != 0) {
      figures.insert(figures.begin() + 1,
                     {"scatter as height", QuantityHtml("u_height_m", best.u_height_m())});
    }
    if (std::isfinite(ExpectedRealUPx(best))) {
      figures.insert(figures.begin() + 1,
                     {"u\u209a\u2093 expected of the real camera",
                      with(QuantityHtml("u_px", ExpectedRealUPx(best)), RealUPxInterval(best))});
    }
    const double scan_time_s =
        best.scan_time_s() != 0 ? best.scan_time_s() : optics_.common().scan_time_s();
    if (scan_time_s > 0) {
      figures.push_back({optics_.scans_size() > 1 ? "time of all scans" : "time of the scan",
                         QuantityHtml("time_s", scan_time_s)});
    }
    return figures;
  }

  static std::string RealUPxInterval(const OpticsPoint& p) {
    return IntervalText("u_px", p.has_expected_real_u_px_interval(),
                        p.expected_real_u_px_interval());
  }

  std::string FNumbers() const {
    const std::string charts = FNumberCharts(curve_);
    return charts.empty() ? "" : charts + Limit(optics_.common());
  }

  // Without a reason in words the charts' key says enough.
  static std::string Limit(const Choice& choice) {
    if (choice.longest_exposure_time_s() == 0 || choice.longest_because().empty()) return "";
    const std::string& reason = choice.longest_because();
    return SoftParagraph(absl::StrCat("Longest exposure time possible, ",
                                      Setting("time_s", choice.longest_exposure_time_s()), ": ",
                                      EscapeHtml(reason), reason.back() == '.' ? "" : "."));
  }

  // What one f-number's setting has that others may not have: two exposures, a tilt; the laser's
  // power only if it is not the same everywhere.
  std::string FurtherSettings(const OpticsPoint& point) const {
    const v1::OpticalSetting setting = SettingOf(point);
    std::vector<std::string> words;
    if (setting.second_exposure_time_s() != 0) {
      words.push_back(
          absl::StrCat("second exposure ", Setting("time_s", setting.second_exposure_time_s())));
    }
    const bool same_power =
        std::all_of(curve_.points.begin(), curve_.points.end(), [&](const OpticsPoint* other) {
          return SettingOf(*other).laser_power_w() == setting.laser_power_w();
        });
    if (!same_power) {
      words.push_back(absl::StrCat("laser ", Setting("power_w", setting.laser_power_w())));
    }
    if (const std::string tilt = TiltWords(setting); !tilt.empty()) {
      words.push_back(EscapeHtml(tilt));
    }
    return absl::StrJoin(words, ", ");
  }

  std::string CurveTable() const {
    if (curve_.points.empty()) return "";
    bool has_further = false, has_real = false;
    for (const OpticsPoint* p : curve_.points) {
      has_further |= !FurtherSettings(*p).empty();
      has_real |= std::isfinite(ExpectedRealUPx(*p));
    }
    std::vector<std::string> head = {"f-number",
                                     "exposure time",
                                     "focus",
                                     kUPx,
                                     "detected",
                                     "bias",
                                     "false lines<br>per column",
                                     "clipped",
                                     "height",
                                     "cost",
                                     "as good as<br>the best"};
    std::vector<int> words;
    if (has_real) head.insert(head.begin() + 4, {absl::StrCat(kUPx, ", real")});
    if (has_further) {
      words.push_back(static_cast<int>(head.size()));
      head.push_back("further");
    }
    std::vector<std::vector<std::string>> rows;
    for (const OpticsPoint* p : curve_.points) {
      const bool is_best = curve_.best != nullptr && p->f_number() == curve_.best->f_number();
      std::vector<std::string> row = {
          absl::StrCat("<span class=\"effect\">", EscapeHtml(FNumberText(p->f_number())),
                       "</span>"),
          absl::StrCat(Setting("exposure_time_s", p->exposure_time_s()),
                       Detail(IntervalText("time_s", p->has_exposure_time_s_interval(),
                                           p->exposure_time_s_interval()))),
          absl::StrCat(Setting("focus_distance_m", p->focus_distance_m()),
                       Detail(IntervalText("focus_distance_m", p->has_focus_distance_m_interval(),
                                           p->focus_distance_m_interval()))),
          absl::StrCat(QuantityHtml("u_px", UPx(*p)), Detail(UPxInterval(*p))),
          absl::StrCat(Share(p->profile_coverage()), Detail(CoverageInterval(*p))),
          EscapeHtml(QuantityText("bias_px", p->bias_px(), 2)),
          Count(p->false_lines_per_column()),
          Share(p->clipped_fraction()),
          Known("u_height_m", p->u_height_m()),
          absl::StrCat(QuantityHtml("cost_px", p->cost()), Detail(CostInterval(*p))),
          is_best                    ? "<strong>best</strong>"
          : AsGoodAsBest(curve_, *p) ? "yes"
                                     : "no"};
      if (has_real) {
        row.insert(row.begin() + 4, absl::StrCat(QuantityHtml("u_px", ExpectedRealUPx(*p)),
                                                 Detail(RealUPxInterval(*p))));
      }
      if (has_further) row.push_back(FurtherSettings(*p));
      rows.push_back(std::move(row));
    }
    return absl::StrCat("<div class=\"mini\">", PageTable(head, rows, words), "</div>\n") +
           SoftParagraph(absl::StrCat(
               "Below the settings: what is as good as the value above. Below the results: where "
               "a fresh frame's lies in 95 of 100 cases. Bias: mean of detected minus true "
               "position. Clipped: part of the detected points whose profile is clipped. Height: ",
               kUPx, " times the footprint of a pixel over the sine of the triangulation angle."));
  }

  void AppendAlternatives(const Choice& choice, const OpticsPoint* best, bool names_scan,
                          std::vector<std::vector<std::string>>* rows) const {
    for (const Choice::Alternative& alternative : choice.alternatives()) {
      const OpticsPoint& p = alternative.point();
      std::vector<std::string> row = {
          absl::StrCat("<span class=\"effect\">", EscapeHtml(alternative.name()), "</span>"),
          EscapeHtml(SettingWords(p)),
          absl::StrCat(QuantityHtml("u_px", UPx(p)), Detail(UPxInterval(p))),
          Share(p.profile_coverage()),
          absl::StrCat(QuantityHtml("cost_px", p.cost()), Detail(CostInterval(p))),
          best == nullptr ? "\u2013" : QuantityHtml("cost_px", p.cost() - best->cost()),
          p.as_good_as_best() ? "yes" : "no"};
      if (names_scan) row.insert(row.begin() + 1, ChoiceName(choice));
      rows->push_back(std::move(row));
    }
  }

  std::string Alternatives() const {
    const bool names_scan =
        std::any_of(optics_.scans().begin(), optics_.scans().end(),
                    [](const Choice& choice) { return !choice.alternatives().empty(); });
    std::vector<std::vector<std::string>> rows;
    AppendAlternatives(optics_.common(), curve_.best, names_scan, &rows);
    for (const Choice& choice : optics_.scans()) {
      AppendAlternatives(choice, choice.has_best() ? &choice.best() : nullptr, names_scan, &rows);
    }
    if (rows.empty()) return "";
    std::vector<std::string> head = {"",
                                     "best setting",
                                     kUPx,
                                     "detected",
                                     "cost",
                                     "more than the best",
                                     "as good as<br>the best"};
    if (names_scan) head.insert(head.begin() + 1, "for");
    return SoftParagraph("The best that is left if a freedom is given up.") +
           PageTable(head, rows,
                     names_scan ? std::vector<int>{0, 1, 2, 7} : std::vector<int>{0, 1, 6});
  }

  static std::vector<std::string> ScanRow(const Choice& choice, const OpticsPoint* best) {
    const OpticsPoint none;
    const OpticsPoint& p = best == nullptr ? none : *best;
    const double scan_time_s = choice.scan_time_s() != 0 ? choice.scan_time_s() : p.scan_time_s();
    return {
        absl::StrCat("<span class=\"effect\">", ChoiceName(choice), "</span>"),
        absl::StrCat(EscapeHtml(best == nullptr ? "none was found" : SettingWords(p)),
                     Detail(EscapeHtml(choice.statement()))),
        best == nullptr ? "\u2013"
                        : absl::StrCat(QuantityHtml("u_px", UPx(p)), Detail(UPxInterval(p))),
        best == nullptr ? "\u2013"
                        : absl::StrCat(Share(p.profile_coverage()), Detail(CoverageInterval(p))),
        best == nullptr ? "\u2013"
                        : absl::StrCat(QuantityHtml("cost_px", p.cost()), Detail(CostInterval(p))),
        Known("scan_time_s", scan_time_s),
        absl::StrCat(choice.frames_size()),
        choice.frames().empty() ? "\u2013" : Share(choice.represented_fraction()),
        choice.longest_exposure_time_s() == 0
            ? "no limit"
            : absl::StrCat(Setting("time_s", choice.longest_exposure_time_s()),
                           Detail(EscapeHtml(choice.longest_because())))};
  }

  std::string Scans() const {
    if (optics_.scans().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    // One setting for all comes first: what a scan's own is compared with.
    if (curve_.best != nullptr) rows.push_back(ScanRow(optics_.common(), curve_.best));
    for (const Choice& choice : optics_.scans()) {
      rows.push_back(ScanRow(choice, choice.has_best() ? &choice.best() : nullptr));
    }
    return PageTable({"", "setting", kUPx, "detected", "cost", "time", "frames", "represented",
                      "longest exposure time"},
                     rows, {0, 1, 8}) +
           SoftParagraph(
               "Frames: so many stand for the scan. Represented: how much of the variance between "
               "the scan's frames (line length, light, depth) lies between the groups that they "
               "stand for.");
  }

  static std::string FrameCard(const v1::RepresentativeFrame& frame) {
    const double u_px =
        frame.profile_coverage() > 0 ? frame.u_px() : std::numeric_limits<double>::quiet_NaN();
    std::string html = absl::StrCat("<div class=\"card\"><h3>", FrameName(frame), "</h3>\n");
    if (!frame.picture_png().empty()) {
      absl::StrAppend(&html, "<figure><img alt=\"", FrameName(frame), "\" src=\"",
                      PngDataUri(frame.picture_png()), "\"></figure>\n");
    }
    return absl::StrCat(
        html, "<div class=\"mini\">",
        PageTable({"stage", "stands for", "points of the line", kUPx, "detected"},
                  {{EscapeHtml(SettingText("stage_position_m", frame.stage_position_m())),
                    Share(frame.weight()), GroupedInteger(frame.line_points()),
                    QuantityHtml("u_px", u_px), Share(frame.profile_coverage())}},
                  {}),
        "</div></div>\n");
  }

  static std::string FrameCards(const Choice& choice) {
    if (choice.frames().empty()) return "";
    std::string html = "<div class=\"frames\">\n";
    for (const v1::RepresentativeFrame& frame : choice.frames()) html += FrameCard(frame);
    html += "</div>\n";
    if (!choice.has_check()) return html;
    return absl::StrCat(
        html,
        SoftParagraph("The frame of the scan that is least like those it was judged by, "
                      "with the same setting:"),
        "<div class=\"frames\">\n", FrameCard(choice.check()), "</div>\n");
  }

  std::string Frames() const {
    std::string html = FrameCards(optics_.common());
    const bool has_common = !html.empty();
    if (has_common && optics_.common().represented_fraction() > 0) {
      html = SoftParagraph(absl::StrCat("They represent ",
                                        Share(optics_.common().represented_fraction()),
                                        " of the variance between all frames.")) +
             html;
    }
    bool of_scans = false;
    for (const Choice& choice : optics_.scans()) {
      const std::string cards = FrameCards(choice);
      if (cards.empty()) continue;
      of_scans = true;
      absl::StrAppend(
          &html, "<h3>Scan ", choice.scan(), " with its own setting",
          choice.has_best() ? absl::StrCat(", ", EscapeHtml(SettingWords(choice.best()))) : "",
          "</h3>\n", cards);
    }
    if (html.empty()) return "";
    if (of_scans && has_common) html = "<h3>With one setting for all scans</h3>\n" + html;
    return SoftParagraph("The simulated image about the line, with the setting chosen.") + html;
  }

  static std::vector<std::string> DeviceRow(const Combination& c) {
    const bool rendered = c.f_number() != 0;
    const ShownUnit unit =
        ShownUnitOf("field_m", std::max(c.field_of_view_width_m(), c.field_of_view_height_m()));
    const std::string field =
        c.field_of_view_width_m() == 0 && c.field_of_view_height_m() == 0
            ? "\u2013"
            : absl::StrCat(Number(unit.per_named * c.field_of_view_width_m()), "\u202f\u00d7\u202f",
                           Number(unit.per_named * c.field_of_view_height_m()), "\u202f",
                           unit.name);
    const bool priced = c.price_eur() > 0 && c.price_eur() < 1e12;
    std::vector<std::string> parts;
    for (const std::string& part : {c.lens(), c.laser()}) {
      if (!part.empty()) parts.push_back(EscapeHtml(part));
    }
    return {absl::StrCat("<span class=\"effect\">", EscapeHtml(c.camera()), "</span>",
                         Detail(absl::StrJoin(parts, "<br>"))),
            absl::StrCat("<span class=\"reason\">",
                         c.chosen() ? "<strong>chosen</strong>" : EscapeHtml(c.lost_because()),
                         "</span>"),
            field,
            Known("pixel_footprint_m", c.pixel_footprint_m()),
            Known("depth_of_field_m", c.depth_of_field_m()),
            rendered ? EscapeHtml(FNumberText(c.f_number())) : "\u2013",
            rendered ? Setting("exposure_time_s", c.exposure_time_s()) : "\u2013",
            rendered ? Known("u_height_m", c.u_height_m()) : "\u2013",
            rendered ? Share(c.profile_coverage()) : "\u2013",
            rendered ? Known("scan_time_s", c.scan_time_s()) : "\u2013",
            rendered ? QuantityHtml("cost_px", c.cost()) : "\u2013",
            priced ? absl::StrCat(GroupedInteger(std::llround(c.price_eur())), "\u202f\u20ac")
                   : "\u2013"};
  }

  std::string Devices() const {
    if (devices_ == nullptr || devices_->combinations().empty()) return "";
    std::vector<const Combination*> combinations;
    for (const Combination& combination : devices_->combinations()) {
      combinations.push_back(&combination);
    }
    std::stable_partition(combinations.begin(), combinations.end(),
                          [](const Combination* combination) { return combination->chosen(); });
    std::vector<std::vector<std::string>> rows;
    for (const Combination* combination : combinations) {
      if (rows.size() == kMaxCombinations) break;
      rows.push_back(DeviceRow(*combination));
    }
    const size_t left_out = combinations.size() - rows.size();
    return SoftParagraph(
               "Field of view, pixel (its footprint on the part) and depth of field follow from "
               "geometry; the numbers from f-number to cost exist only where images were "
               "simulated.") +
           absl::StrCat("<div class=\"mini\">",
                        PageTable({"camera, lens, laser", "", "field of view", "pixel",
                                   "depth<br>of field", "f-number", "exposure<br>time", "height",
                                   "detected", "time<br>per scan", "cost", "price"},
                                  rows, {0, 1}),
                        "</div>\n") +
           (left_out == 0
                ? ""
                : SoftParagraph(absl::StrCat(GroupedInteger(static_cast<int64_t>(left_out)),
                                             " more combinations are in devices.json.")));
  }

  std::string Method() const {
    std::string html = absl::StrCat(
        "<p>The cost is f = a u<sub>px</sub> + (1 \u2212 a) u<sub>pr</sub> (thesis, eq. 6.5): a "
        "is the part of the line that is detected, u<sub>px</sub> the standard deviation of its "
        "detected minus its true position, and u<sub>pr</sub> the prior uncertainty, which a "
        "column without a detected line is left with; false lines and time are added where the "
        "inspection gives them a cost. The true position is where the laser sheet meets the part "
        "in a geometric image, not a curve fitted to what was detected. Every setting is judged "
        "by several realisations of speckle and noise in each of the frames. An interval is where "
        "the number of a fresh frame \u2013 other speckle, other noise \u2013 lies in 95 of 100 "
        "cases. Two settings are compared by the standard error of the difference of their costs: "
        "as good as the best is what costs no more than 1.96 of them above it. ");
    const v1::UncertaintyCorrection& correction = optics_.correction();
    if (!optics_.has_correction()) {
      html +=
          "No verification was given, so u<sub>px</sub> is that of the simulation, without the "
          "correction u<sub>real</sub> = u<sub>sim</sub>/(1 \u2212 e<sub>u</sub>) (eq. 6.8).</p>\n";
    } else {
      absl::StrAppend(
          &html,
          "The real camera is expected to have u<sub>real</sub> = u<sub>sim</sub>/(1 \u2212 "
          "e<sub>u</sub>) (eq. 6.8), e<sub>u</sub> being the error of the simulated scatter in a "
          "verification with recordings",
          correction.source().empty() ? ""
                                      : absl::StrCat(" (", EscapeHtml(correction.source()), ")"),
          ".</p>\n");
      std::vector<std::vector<std::string>> rows;
      for (const v1::UncertaintyCorrection::FNumberError& error : correction.by_f_number()) {
        rows.push_back({EscapeHtml(FNumberText(error.f_number())),
                        EscapeHtml(QuantityText("e_relative", error.mean_e_u(), 2)),
                        error.recordings() > 1 || error.standard_deviation() > 0
                            ? EscapeHtml(QuantityText("e_relative", error.standard_deviation(), 2))
                            : "not known",
                        absl::StrCat(error.recordings())});
      }
      if (!rows.empty()) {
        html += PageTable(
            {"f-number", "mean e<sub>u</sub>", "deviation between recordings", "recordings"}, rows,
            {});
      }
    }
    std::vector<std::string> origin;
    if (!optics_.inspection_name().empty()) {
      origin.push_back(absl::StrCat("inspection ", EscapeHtml(optics_.inspection_name())));
    }
    if (!optics_.sightline_version().empty()) {
      origin.push_back(absl::StrCat("Sightline ", EscapeHtml(optics_.sightline_version())));
    }
    origin.push_back(absl::StrCat("seed ", optics_.seed()));
    origin.push_back(absl::StrCat(GroupedInteger(optics_.evaluated_images()), " images looked at"));
    return html +
           SoftParagraph(absl::StrCat("To get this again: ", absl::StrJoin(origin, ", "), "."));
  }

  const v1::OpticsPlan& optics_;
  const v1::DeviceChoice* devices_;
  OpticsCurve curve_;
};

}  // namespace

std::string RenderOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices) {
  return Report(optics, devices).Html();
}

absl::Status WriteOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices,
                               const std::string& path) {
  return WriteFileAtomically(path, RenderOpticsReport(optics, devices));
}

}  // namespace sightline
