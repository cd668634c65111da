// SPDX-License-Identifier: Apache-2.0
#include "report/calibration/calibration_report.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/scanner_calibration/calibration_verdict.h"
#include "report/document/report_parts.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

std::string RatioText(const ScatterRatio& ratio) {
  return absl::StrCat(FixedNumber(ratio.value, 2), " (", FixedNumber(ratio.low, 2), " to ",
                      FixedNumber(ratio.high, 2), ")");
}

v1::ReportCell FixedCell(double number, int decimals) {
  return NumberCell(number, FixedNumber(number, decimals));
}

ReportBlocks FrameBlocks(const CalibrationResult& result) {
  std::vector<ReportCells> rows;
  for (const CalibrationFrameResult& frame : result.frames) {
    ReportCells row = {TextCell(frame.name)};
    if (frame.used) {
      const LeftOutFrame& left_out = frame.left_out;
      row.push_back(FixedCell(1e3 * left_out.rms_m, 3));
      row.push_back(FixedCell(1e3 * left_out.predicted_rms_m, 3));
      row.push_back(FixedCell(left_out.rms_m / left_out.predicted_rms_m, 2));
      row.push_back(FixedCell(frame.corner_rms_px, 2));
      row.push_back(frame.hand_eye_position_m ? FixedCell(1e3 * *frame.hand_eye_position_m, 2)
                                              : TextCell(kNoValue));
      row.push_back(TextCell(FarOffRemark(left_out)));
    } else {
      row.resize(6, TextCell(kNoValue));
      row.push_back(TextCell("not used: " + frame.because));
    }
    rows.push_back(std::move(row));
  }
  return {TableBlock(
      "Frames, predicted against real",
      {WordsColumn("frame"), NumberColumn("real rms", "mm"), NumberColumn("predicted rms", "mm"),
       NumberColumn("real / predicted"), NumberColumn("corners", "px"),
       NumberColumn("hand-eye", "mm"), WordsColumn("remark")},
      rows)};
}

v1::ReportChart FrameChart(const CalibrationFrameResult& frame) {
  const LeftOutFrame& left_out = frame.left_out;
  v1::ReportChart chart;
  chart.set_title(frame.name);
  *chart.mutable_x() = AxisOf("along the line", "px");
  *chart.mutable_y() = AxisOf("distance from the target", "mm");
  v1::ReportSeries predicted = EmptySeries("", v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE);
  v1::ReportSeries real =
      EmptySeries("triangulated points", v1::REPORT_COLOUR_OBSERVED, v1::ReportSeries::DOTS);
  std::vector<double> half_widths;
  for (size_t i = 0; i < left_out.along_px.size(); ++i) {
    AddPoint(left_out.along_px[i], 1e3 * left_out.distance_m[i], &real);
    AddPoint(left_out.along_px[i], 0, &predicted);
    half_widths.push_back(2e3 * left_out.predicted_sd_m[i]);
  }
  AddBand("predicted, two standard deviations", half_widths, &predicted);
  *chart.add_series() = std::move(predicted);
  *chart.add_series() = std::move(real);
  AddLineAtY(0, &chart);
  return chart;
}

ReportBlocks LineBlocks(const CalibrationResult& result) {
  ReportBlocks charts;
  for (const CalibrationFrameResult& frame : result.frames) {
    if (frame.used) charts.push_back(ChartBlock(FrameChart(frame)));
  }
  if (charts.empty()) return {};
  return {GroupBlock(v1::ReportGroup::TWO_COLUMNS, std::move(charts))};
}

// Targets that were tried; empty if only a flat one was.
ReportBlocks ShapeBlocks(const CalibrationResult& result) {
  if (result.shape_trials.size() < 2) return {};
  std::vector<ReportCells> rows;
  for (const ShapeTrial& trial : result.shape_trials) {
    std::string name = "flat";
    if (trial.shape == TargetShape::kBentBoard) name = "bent board, line on a flat plate";
    if (trial.shape == TargetShape::kBent) name = "bent board and plate";
    rows.push_back({trial.shape == result.shape ? StrongCell(name) : TextCell(name),
                    FixedCell(1e3 * trial.left_out_rms_m, 3), FixedCell(trial.corner_sd_px, 2)});
  }
  return {
      RemarkBlock("The target seems to be bent. The shape in bold best predicts frames that are "
                  "left out, and is used."),
      TableBlock("Shapes of the target",
                 {WordsColumn("target"), NumberColumn("line of left-out frames, rms", "mm"),
                  NumberColumn("corners", "px")},
                 rows)};
}

v1::ReportChart HaloChart(const FrameLight& light) {
  v1::ReportChart chart;
  chart.set_title("Light beside the line");
  *chart.mutable_x() = AxisOf("distance from the line on the board", "mm", true);
  *chart.mutable_y() = AxisOf("mean raw number", "DN");
  v1::ReportSeries paper =
      EmptySeries("light squares", v1::REPORT_COLOUR_OBSERVED, v1::ReportSeries::LINE_AND_DOTS);
  v1::ReportSeries print =
      EmptySeries("dark squares", v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE_AND_DOTS);
  for (const HaloBin& bin : light.halo) {
    AddPoint(1e3 * bin.from_line_m, bin.paper_dn, &paper);
    AddPoint(1e3 * bin.from_line_m, bin.print_dn, &print);
  }
  *chart.add_series() = std::move(paper);
  *chart.add_series() = std::move(print);
  return chart;
}

v1::ReportChart AlongLineChart(const FrameLight& light) {
  v1::ReportChart chart;
  chart.set_title("The same along the line");
  *chart.mutable_x() = AxisOf("place in the image", "px");
  *chart.mutable_y() = AxisOf("over the frame's median", "");
  v1::ReportSeries series = EmptySeries("2 to 5 mm from the line", v1::REPORT_COLOUR_OBSERVED,
                                        v1::ReportSeries::LINE_AND_DOTS);
  std::vector<double> half_widths;
  for (const AlongLineBin& bin : light.along_line) {
    AddPoint(bin.along_px, bin.relative, &series);
    half_widths.push_back(bin.relative_sd);
  }
  AddBand("one standard deviation of the frames", half_widths, &series);
  *chart.add_series() = std::move(series);
  return chart;
}

ReportBlocks SentenceBlocks(const std::string& title, const std::vector<std::string>& sentences) {
  std::vector<std::vector<v1::ReportRun>> items;
  for (const std::string& sentence : sentences) items.push_back({PlainRun(sentence)});
  if (items.empty()) return {};
  return {TitledBlock(title, {ListBlock(items)})};
}

ReportBlocks LightBlocks(const CalibrationResult& result) {
  const FrameLight& light = result.light;
  if (light.frame_count == 0) return {};
  ReportBlocks blocks = SentenceBlocks("Found", LightFindings(light));
  blocks.push_back(
      TableBlock("Light of frames that are left out",
                 {WordsColumn("model"), NumberColumn("error of tiles, rms", "DN")},
                 {{TextCell("constants of paper and print"), FixedCell(light.even_rms_dn, 2)},
                  {TextCell("halo in lens or sensor"), FixedCell(light.lens_rms_dn, 2)},
                  {TextCell("halo on the board"), FixedCell(light.board_rms_dn, 2)}}));
  blocks.push_back(GroupBlock(v1::ReportGroup::TWO_COLUMNS,
                              {ChartBlock(HaloChart(light)), ChartBlock(AlongLineChart(light))}));
  for (v1::ReportBlock& block :
       SentenceBlocks("Not determined by these frames", NotDetermined(light))) {
    blocks.push_back(std::move(block));
  }
  return blocks;
}

ReportBlocks ScannerBlocks(const CalibrationResult& result) {
  const AdjustedRig& rig = result.rig;
  std::vector<ReportCells> rows;
  const auto adjusted = [&](const std::string& name, int i, int decimals, const char* unit) {
    const double error = std::sqrt(rig.covariance(i, i));
    rows.push_back({TextCell(name), FixedCell(rig.shared[i], decimals), FixedCell(error, decimals),
                    TextCell(unit)});
  };
  const auto computed = [&](const std::string& name, double value, int decimals, const char* unit) {
    rows.push_back(
        {TextCell(name), FixedCell(value, decimals), TextCell(kNoValue), TextCell(unit)});
  };
  adjusted("focal length, x", kFocalX, 1, "px");
  adjusted("focal length, y", kFocalY, 1, "px");
  computed("focal length of inspection.json and recordings/: square root of their product",
           result.planning.focal_length_px, 1, "px");
  adjusted("principal point, x", kCentreX, 1, "px");
  adjusted("principal point, y", kCentreY, 1, "px");
  adjusted("laser plane, normal over distance, x", kPlaneX, 3, "1/m");
  adjusted("laser plane, normal over distance, y", kPlaneY, 3, "1/m");
  adjusted("laser plane, normal over distance, z", kPlaneZ, 3, "1/m");
  const PlanningRig& planning = result.planning;
  rows.push_back({TextCell("camera to laser plane along the axis"),
                  FixedCell(1e3 * planning.camera_distance_m, 1),
                  FixedCell(1e3 * planning.camera_distance_error_m, 2), TextCell("mm")});
  rows.push_back({TextCell("triangulation angle"),
                  FixedCell(kDegreesPerRadian * planning.triangulation_angle_rad, 2),
                  FixedCell(kDegreesPerRadian * planning.triangulation_angle_error_rad, 3),
                  TextCell("\u00b0")});
  if (result.hand_eye) {
    const Eigen::VectorXd& six = result.hand_eye->camera_in_flange;
    computed("camera in the flange, x", 1e3 * six[3], 2, "mm");
    computed("camera in the flange, y", 1e3 * six[4], 2, "mm");
    computed("camera in the flange, z", 1e3 * six[5], 2, "mm");
    computed("hand-eye closure, rms", 1e3 * result.hand_eye->closure_m, 2, "mm");
    computed("hand-eye closure, rms", kDegreesPerRadian * result.hand_eye->closure_rad, 2,
             "\u00b0");
  }
  if (result.robot_scale) {
    rows.push_back({TextCell("squares by the robot's movements, over the stated length"),
                    FixedCell(result.robot_scale->value, 4),
                    FixedCell(result.robot_scale->standard_error, 4), TextCell("")});
  }
  if (result.bend) {
    computed("bend of the target: largest height of a corner", 1e3 * result.bend->largest_m, 3,
             "mm");
  }
  if (result.reference) {
    computed("laser plane against the reference, between the normals",
             kDegreesPerRadian * result.reference->angle_rad, 2, "\u00b0");
    computed("distance of the laser plane from the camera", 1e3 * result.reference->distance_m, 1,
             "mm");
    computed("the same of the reference", 1e3 * result.reference->reference_distance_m, 1, "mm");
    computed("line off the target with the reference plane, rms",
             1e3 * result.reference->line_rms_m, 2, "mm");
  }
  return {TableBlock("The scanner",
                     {WordsColumn("quantity"), NumberColumn("value"),
                      NumberColumn("standard error"), WordsColumn("unit")},
                     rows)};
}

}  // namespace

v1::Report CalibrationReport(const CalibrationResult& result) {
  const int used = result.UsedFrames();
  v1::Report report;
  report.set_title("Calibration: " + result.name);
  report.set_kind("calibration");
  report.set_subject("Sightline \u00b7 calibration");
  report.set_heading(result.name);
  *report.add_finding() = PlainRun(VerdictText(result.ratio, used) + " ");
  if (!result.warnings.empty()) {
    *report.add_finding() = PlainRun("The notes below say what this ratio does not show. ");
  }
  *report.add_finding() = PlainRun(
      "Each frame was left out in turn and predicted from the others. Its points scatter ");
  *report.add_finding() = StrongRun(RatioText(result.ratio));
  *report.add_finding() = PlainRun(" times as much as predicted (95 % interval over frames).");
  *report.add_figures() = NumberFact(
      "real / predicted", result.ratio.value, "", FixedNumber(result.ratio.value, 2),
      absl::StrCat(FixedNumber(result.ratio.low, 2), " to ", FixedNumber(result.ratio.high, 2)));
  *report.add_figures() = NumberFact("frames used", static_cast<double>(used), "",
                                     absl::StrCat(used, " of ", result.frames.size()));
  *report.add_figures() = NumberFact("scatter of the line's centre", result.crossing_sd_px, "px",
                                     FixedNumber(result.crossing_sd_px, 2) + "\u202fpx");
  *report.add_figures() = NumberFact("corners", result.rig.corner_sd_px, "px",
                                     FixedNumber(result.rig.corner_sd_px, 2) + "\u202fpx");
  report.mutable_warnings()->Assign(result.warnings.begin(), result.warnings.end());
  AddSection(&report, "frames", "Predicted against real", FrameBlocks(result));
  AddSection(&report, "rig", "The scanner", ScannerBlocks(result));
  AddSection(&report, "shape", "Shape of the target", ShapeBlocks(result));
  AddSection(&report, "light", "Light beside the line", LightBlocks(result));
  AddSection(&report, "line", "Along the line", LineBlocks(result));
  return report;
}

}  // namespace sightline
