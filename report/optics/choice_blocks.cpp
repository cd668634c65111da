// SPDX-License-Identifier: Apache-2.0
#include "report/optics/choice_blocks.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/optics/optics_text.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

using Choice = v1::OpticsChoice;
using Combination = v1::DeviceCombination;
using v1::OpticsPoint;

constexpr char kUPx[] = "u\u209a\u2093";
// Limit for the table, since the combinations of a catalogue multiply.
constexpr size_t kMaxCombinations = 200;

std::string IntervalText(const std::string& name, bool known, const v1::OpticsInterval& interval) {
  return known ? QuantityInterval(name, interval.lower(), interval.upper()) : "";
}

// A value of 0 that is unknown or was not computed is shown as a dash.
v1::ReportCell KnownCell(const std::string& name, double value) {
  return value == 0 ? TextCell(kNoValue) : QuantityCell(name, value);
}

v1::ReportCell KnownSettingCell(const std::string& name, double value,
                                const std::string& detail = "") {
  return value == 0 ? TextCell(kNoValue, detail) : SettingCell(name, value, detail);
}

v1::ReportCell UPxCell(const OpticsPoint& p) {
  return QuantityCell("u_px", UPx(p), 3, UPxInterval(p));
}

v1::ReportCell CoverageCell(const OpticsPoint& p) {
  v1::ReportCell cell = ShareOfLineCell(p.profile_coverage());
  cell.set_detail(CoverageInterval(p));
  return cell;
}

v1::ReportCell CostCell(const OpticsPoint& p) {
  return QuantityCell("cost_px", p.cost(), 3, CostInterval(p));
}

v1::ReportCell RateCell(double per_column) { return NumberCell(per_column, Number(per_column, 2)); }

std::string ChoiceName(const Choice& choice) {
  return choice.scan() == 0 ? "all scans" : absl::StrCat("scan ", choice.scan());
}

// Properties of one f-number's setting that others may lack: two exposures, a tilt, and the laser's
// power if it varies.
std::string FurtherSettings(const OpticsCurve& curve, const OpticsPoint& point) {
  const v1::OpticalSetting setting = SettingOf(point);
  std::vector<std::string> words;
  if (setting.second_exposure_time_s() != 0) {
    words.push_back(
        absl::StrCat("second exposure ", SettingText("time_s", setting.second_exposure_time_s())));
  }
  const bool same_power =
      std::all_of(curve.points.begin(), curve.points.end(), [&](const OpticsPoint* other) {
        return SettingOf(*other).laser_power_w() == setting.laser_power_w();
      });
  if (!same_power) {
    const double power_w = setting.laser_power_w();
    words.push_back(
        absl::StrCat("laser ", power_w == 0 ? kNoValue : SettingText("power_w", power_w)));
  }
  if (const std::string tilt = TiltWords(setting); !tilt.empty()) words.push_back(tilt);
  return absl::StrJoin(words, ", ");
}

ReportCells CurveRow(const OpticsCurve& curve, const OpticsPoint& p, bool has_real,
                     bool has_further) {
  const bool is_best = curve.best != nullptr && p.f_number() == curve.best->f_number();
  v1::ReportCell f_number = NumberCell(p.f_number(), FNumberText(p.f_number()));
  f_number.set_strong(true);
  ReportCells row = {
      std::move(f_number),
      KnownSettingCell(
          "exposure_time_s", p.exposure_time_s(),
          IntervalText("time_s", p.has_exposure_time_s_interval(), p.exposure_time_s_interval())),
      KnownSettingCell("focus_distance_m", p.focus_distance_m(),
                       IntervalText("focus_distance_m", p.has_focus_distance_m_interval(),
                                    p.focus_distance_m_interval())),
      UPxCell(p),
      CoverageCell(p),
      QuantityCell("bias_px", p.bias_px(), 2),
      RateCell(p.false_lines_per_column()),
      ShareOfLineCell(p.clipped_fraction()),
      KnownCell("u_height_m", p.u_height_m()),
      CostCell(p),
      is_best ? StrongCell("best") : TextCell(AsGoodAsBest(curve, p) ? "yes" : "no")};
  if (has_real) {
    row.insert(row.begin() + 4, QuantityCell("u_px", ExpectedRealUPx(p), 3, RealUPxInterval(p)));
  }
  if (has_further) row.push_back(TextCell(FurtherSettings(curve, p)));
  return row;
}

void AppendAlternatives(const Choice& choice, const OpticsPoint* best, bool names_scan,
                        std::vector<ReportCells>* rows) {
  for (const Choice::Alternative& alternative : choice.alternatives()) {
    const OpticsPoint& p = alternative.point();
    ReportCells row = {
        StrongCell(alternative.name()),
        TextCell(SettingWords(p)),
        UPxCell(p),
        ShareOfLineCell(p.profile_coverage()),
        CostCell(p),
        best == nullptr ? TextCell(kNoValue) : QuantityCell("cost_px", p.cost() - best->cost()),
        TextCell(p.as_good_as_best() ? "yes" : "no")};
    if (names_scan) row.insert(row.begin() + 1, TextCell(ChoiceName(choice)));
    rows->push_back(std::move(row));
  }
}

ReportCells SettingRow(const Choice& choice, const OpticsPoint* best) {
  const OpticsPoint none;
  const OpticsPoint& p = best == nullptr ? none : *best;
  const double scan_time_s = choice.scan_time_s() != 0 ? choice.scan_time_s() : p.scan_time_s();
  const auto of_best = [&](const v1::ReportCell& cell) {
    return best == nullptr ? TextCell(kNoValue) : cell;
  };
  return {
      StrongCell(ChoiceName(choice)),
      TextCell(best == nullptr ? "none was found" : SettingWords(p), choice.statement()),
      of_best(UPxCell(p)),
      of_best(CoverageCell(p)),
      of_best(CostCell(p)),
      KnownCell("scan_time_s", scan_time_s),
      CountCell(choice.frames_size()),
      choice.frames().empty() ? TextCell(kNoValue) : ShareOfLineCell(choice.represented_fraction()),
      choice.longest_exposure_time_s() == 0
          ? TextCell("no limit")
          : SettingCell("time_s", choice.longest_exposure_time_s(), choice.longest_because())};
}

v1::ReportBlock FrameCard(const v1::RepresentativeFrame& frame) {
  const double u_px = frame.profile_coverage() > 0 ? frame.u_px() : kNoNumber;
  const std::string name = absl::StrCat("Scan ", frame.scan(), ", frame ", frame.frame());
  ReportBlocks blocks;
  if (!frame.picture_png().empty()) {
    blocks.push_back(PictureBlock(frame.picture_png(), "", name));
  }
  blocks.push_back(
      TableBlock(name,
                 {NumberColumn("stage"), NumberColumn("stands for"),
                  NumberColumn("points of the line"), NumberColumn(kUPx), NumberColumn("detected")},
                 {{SettingCell("stage_position_m", frame.stage_position_m()),
                   ShareOfLineCell(frame.weight()), CountCell(frame.line_points()),
                   QuantityCell("u_px", u_px), ShareOfLineCell(frame.profile_coverage())}}));
  return CardBlock(name, "", std::move(blocks));
}

void AppendFrameCards(const Choice& choice, ReportBlocks* blocks) {
  if (choice.frames().empty()) return;
  ReportBlocks cards;
  for (const v1::RepresentativeFrame& frame : choice.frames()) cards.push_back(FrameCard(frame));
  blocks->push_back(GroupBlock(v1::ReportGroup::ROW, std::move(cards)));
  if (!choice.has_check()) return;
  blocks->push_back(
      RemarkBlock("The frame of the scan that is least like those it was judged by, with the same "
                  "setting:"));
  blocks->push_back(GroupBlock(v1::ReportGroup::ROW, {FrameCard(choice.check())}));
}

std::string FieldText(const Combination& c) {
  if (c.field_of_view_width_m() == 0 && c.field_of_view_height_m() == 0) return kNoValue;
  const ShownUnit unit =
      ShownUnitOf("field_m", std::max(c.field_of_view_width_m(), c.field_of_view_height_m()));
  return absl::StrCat(Number(unit.per_named * c.field_of_view_width_m()), "\u202f\u00d7\u202f",
                      Number(unit.per_named * c.field_of_view_height_m()), "\u202f", unit.name);
}

ReportCells DeviceRow(const Combination& c) {
  const bool rendered = c.f_number() != 0;
  const bool priced = c.price_eur() > 0 && c.price_eur() < 1e12;
  std::vector<std::string> parts;
  for (const std::string& part : {c.lens(), c.laser()}) {
    if (!part.empty()) parts.push_back(part);
  }
  const auto of_images = [&](const v1::ReportCell& cell) {
    return rendered ? cell : TextCell(kNoValue);
  };
  return {
      StrongCell(c.camera(), absl::StrJoin(parts, ", ")),
      c.chosen() ? StrongCell("chosen") : TextCell(c.lost_because()),
      TextCell(FieldText(c)),
      KnownCell("pixel_footprint_m", c.pixel_footprint_m()),
      KnownCell("depth_of_field_m", c.depth_of_field_m()),
      of_images(NumberCell(c.f_number(), FNumberText(c.f_number()))),
      of_images(KnownSettingCell("exposure_time_s", c.exposure_time_s())),
      of_images(KnownCell("u_height_m", c.u_height_m())),
      of_images(ShareOfLineCell(c.profile_coverage())),
      of_images(KnownCell("scan_time_s", c.scan_time_s())),
      of_images(QuantityCell("cost_px", c.cost())),
      priced ? NumberCell(c.price_eur(),
                          absl::StrCat(GroupedInteger(std::llround(c.price_eur())), "\u202f\u20ac"),
                          "\u20ac")
             : TextCell(kNoValue)};
}

}  // namespace

std::string UPxInterval(const OpticsPoint& p) {
  return IntervalText("u_px", p.has_u_px_interval() && std::isfinite(UPx(p)), p.u_px_interval());
}

std::string RealUPxInterval(const OpticsPoint& p) {
  return IntervalText("u_px", p.has_expected_real_u_px_interval(), p.expected_real_u_px_interval());
}

std::string CoverageInterval(const OpticsPoint& p) {
  return IntervalText("coverage_fraction", p.has_profile_coverage_interval(),
                      p.profile_coverage_interval());
}

std::string CostInterval(const OpticsPoint& p) {
  return IntervalText("cost_px", p.has_cost_interval(), p.cost_interval());
}

ReportBlocks CurveTableBlocks(const OpticsCurve& curve) {
  if (curve.points.empty()) return {};
  bool has_further = false, has_real = false;
  for (const OpticsPoint* p : curve.points) {
    has_further |= !FurtherSettings(curve, *p).empty();
    has_real |= std::isfinite(ExpectedRealUPx(*p));
  }
  std::vector<v1::ReportColumn> columns;
  for (const char* name : {"f-number", "exposure time", "focus", kUPx, "detected", "bias",
                           "false lines per column", "clipped", "height", "cost"}) {
    columns.push_back(NumberColumn(name));
  }
  columns.push_back(WordsColumn("as good as the best"));
  if (has_real) columns.insert(columns.begin() + 4, NumberColumn(absl::StrCat(kUPx, ", real")));
  if (has_further) columns.push_back(WordsColumn("further"));
  std::vector<ReportCells> rows;
  for (const OpticsPoint* p : curve.points) {
    rows.push_back(CurveRow(curve, *p, has_real, has_further));
  }
  return {TableBlock("Every f-number in numbers", columns, rows),
          RemarkBlock(absl::StrCat(
              "Below the settings: what is as good as the value above. Below the results: where "
              "a fresh frame's lies in 95 of 100 cases. Bias: mean of detected minus true "
              "position. Clipped: part of the detected points whose profile is clipped. Height: ",
              kUPx, " times the footprint of a pixel over the sine of the triangulation angle."))};
}

ReportBlocks AlternativeBlocks(const v1::OpticsPlan& optics, const OpticsPoint* best) {
  const bool names_scan =
      std::any_of(optics.scans().begin(), optics.scans().end(),
                  [](const Choice& choice) { return !choice.alternatives().empty(); });
  std::vector<ReportCells> rows;
  AppendAlternatives(optics.common(), best, names_scan, &rows);
  for (const Choice& choice : optics.scans()) {
    AppendAlternatives(choice, choice.has_best() ? &choice.best() : nullptr, names_scan, &rows);
  }
  if (rows.empty()) return {};
  std::vector<v1::ReportColumn> columns = {WordsColumn("freedom"),
                                           WordsColumn("best setting"),
                                           NumberColumn(kUPx),
                                           NumberColumn("detected"),
                                           NumberColumn("cost"),
                                           NumberColumn("more than the best"),
                                           WordsColumn("as good as the best")};
  if (names_scan) columns.insert(columns.begin() + 1, WordsColumn("for"));
  return {RemarkBlock("The best that is left if a freedom is given up."),
          TableBlock("What a freedom is worth", columns, rows)};
}

ReportBlocks ScanSettingBlocks(const v1::OpticsPlan& optics, const OpticsPoint* best) {
  if (optics.scans().empty()) return {};
  std::vector<ReportCells> rows;
  // The common setting comes first, for comparison with the settings of single scans.
  if (best != nullptr) rows.push_back(SettingRow(optics.common(), best));
  for (const Choice& choice : optics.scans()) {
    rows.push_back(SettingRow(choice, choice.has_best() ? &choice.best() : nullptr));
  }
  return {TableBlock("A setting for every scan",
                     {WordsColumn("for"), WordsColumn("setting"), NumberColumn(kUPx),
                      NumberColumn("detected"), NumberColumn("cost"), NumberColumn("time"),
                      NumberColumn("frames"), NumberColumn("represented"),
                      WordsColumn("longest exposure time")},
                     rows),
          RemarkBlock(
              "Frames: so many stand for the scan. Represented: how much of the variance between "
              "the scan's frames (line length, light, depth) lies between the groups that they "
              "stand for.")};
}

ReportBlocks FrameBlocksOf(const v1::OpticsPlan& optics) {
  ReportBlocks common, blocks;
  AppendFrameCards(optics.common(), &common);
  ReportBlocks scans;
  for (const Choice& choice : optics.scans()) {
    ReportBlocks cards;
    AppendFrameCards(choice, &cards);
    if (cards.empty()) continue;
    scans.push_back(TitledBlock(
        absl::StrCat("Scan ", choice.scan(), " with its own setting",
                     choice.has_best() ? absl::StrCat(", ", SettingWords(choice.best())) : ""),
        std::move(cards)));
  }
  if (common.empty() && scans.empty()) return {};
  blocks.push_back(RemarkBlock("The simulated image about the line, with the setting chosen."));
  if (!common.empty() && optics.common().represented_fraction() > 0) {
    common.insert(common.begin(),
                  RemarkBlock(absl::StrCat("They represent ",
                                           ShareText(optics.common().represented_fraction()),
                                           " of the variance between all frames.")));
  }
  if (!common.empty() && !scans.empty()) {
    common = {TitledBlock("With one setting for all scans", std::move(common))};
  }
  for (ReportBlocks* some : {&common, &scans}) {
    for (v1::ReportBlock& block : *some) blocks.push_back(std::move(block));
  }
  return blocks;
}

ReportBlocks DeviceBlocks(const v1::DeviceChoice* devices) {
  if (devices == nullptr || devices->combinations().empty()) return {};
  std::vector<const Combination*> combinations;
  for (const Combination& combination : devices->combinations()) {
    combinations.push_back(&combination);
  }
  std::stable_partition(combinations.begin(), combinations.end(),
                        [](const Combination* combination) { return combination->chosen(); });
  std::vector<ReportCells> rows;
  for (const Combination* combination : combinations) {
    if (rows.size() == kMaxCombinations) break;
    rows.push_back(DeviceRow(*combination));
  }
  ReportBlocks blocks = {
      RemarkBlock("Field of view, pixel (its footprint on the part) and depth of field follow from "
                  "geometry; the numbers from f-number to cost exist only where images were "
                  "simulated."),
      TableBlock(
          "Cameras, lenses and lasers",
          {WordsColumn("camera, lens, laser"), WordsColumn("result"), NumberColumn("field of view"),
           NumberColumn("pixel"), NumberColumn("depth of field"), NumberColumn("f-number"),
           NumberColumn("exposure time"), NumberColumn("height"), NumberColumn("detected"),
           NumberColumn("time per scan"), NumberColumn("cost"), NumberColumn("price")},
          rows)};
  if (const size_t left_out = combinations.size() - rows.size(); left_out > 0) {
    blocks.push_back(RemarkBlock(absl::StrCat(GroupedInteger(static_cast<int64_t>(left_out)),
                                              " more combinations are in devices.json.")));
  }
  return blocks;
}

}  // namespace sightline
