// SPDX-License-Identifier: Apache-2.0
#include "report/sensor/sensor_charts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "report/document/report_parts.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

using Point = v1::PhotonTransferPoint;
using PointValue = std::function<double(const Point&)>;
using Mark = v1::ReportSeries;

constexpr char kTwoErrors[] = "\u00b1 2 standard errors";

std::string StepNote(const Point& point) {
  std::string note = SettingText("exposure_time_s", point.exposure_time_s());
  if (point.has_photons()) absl::StrAppend(&note, ", ", Number(point.photons(), 4), " photons");
  absl::StrAppend(
      &note, "; mean ",
      QuantityWithError("mean_dn", point.mean_dn(), point.mean_standard_error_dn()), "; variance ",
      QuantityWithError("variance_dn2", point.variance_dn2(), point.variance_standard_error_dn2()));
  return note;
}

v1::ReportSeries SeriesOfSteps(const std::string& name, v1::ReportColour colour, Mark::Mark mark,
                               const std::vector<const Point*>& points, const PointValue& x,
                               const PointValue& y) {
  v1::ReportSeries series = EmptySeries(name, colour, mark);
  for (const Point* point : points) {
    if (mark == Mark::DOTS || mark == Mark::HOLLOW_DOTS) {
      AddPoint(x(*point), y(*point), StepNote(*point), &series);
    } else {
      AddPoint(x(*point), y(*point), &series);
    }
  }
  return series;
}

v1::ReportChart ChartOfSteps(const std::string& title, const std::string& explanation) {
  v1::ReportChart chart;
  chart.set_title(title);
  chart.set_explanation(explanation);
  *chart.mutable_x() = AxisOf("mean signal", "DN");
  return chart;
}

v1::ReportBlock VarianceChart(const SensorView& view) {
  v1::ReportChart chart = ChartOfSteps(
      "Photon transfer", "Noise of light grows with the signal: the slope is the system gain.");
  *chart.mutable_y() = AxisOf("variance in time", "DN\u00b2");
  const PointValue mean = &Point::mean_dn, variance = &Point::variance_dn2;
  *chart.add_series() = SeriesOfSteps("measured", v1::REPORT_COLOUR_OBSERVED, Mark::DOTS,
                                      view.points, mean, variance);
  if (!view.saturated.empty()) {
    *chart.add_series() = SeriesOfSteps("measured, saturated: not used", v1::REPORT_COLOUR_OBSERVED,
                                        Mark::HOLLOW_DOTS, view.saturated, mean, variance);
  }
  *chart.add_series() =
      SeriesOfSteps("linear model", v1::REPORT_COLOUR_REFERENCE, Mark::DASHED_LINE, view.points,
                    &Point::linear_mean_dn, &Point::linear_variance_dn2);
  if (view.has_model) {
    *chart.add_series() =
        SeriesOfSteps("with the departures found", v1::REPORT_COLOUR_MODEL, Mark::LINE, view.points,
                      &Point::model_mean_dn, &Point::model_variance_dn2);
  }
  return ChartBlock(std::move(chart));
}

// Residuals of both models against the signal.
void AddResiduals(const SensorView& view, const PointValue& linear, const PointValue& model,
                  v1::ReportChart* chart) {
  *chart->add_series() =
      SeriesOfSteps("measured against the linear model", v1::REPORT_COLOUR_REFERENCE,
                    Mark::HOLLOW_DOTS, view.points, &Point::mean_dn, linear);
  if (!view.has_model) return;
  *chart->add_series() =
      SeriesOfSteps("measured against the departures found", v1::REPORT_COLOUR_MODEL, Mark::DOTS,
                    view.points, &Point::mean_dn, model);
}

// Close to zero signal, a fraction of a DN is many per cent and must not dominate the axis. The
// ordinate covers the signals of at least 5 % of the largest (EMVA 1288 evaluates linearity above
// that). True if other points lie outside.
bool KeepAxis(const SensorView& view, const PointValue& linear, const PointValue& model,
              v1::ReportAxis* axis) {
  if (view.points.empty()) return false;
  const double least = 0.05 * view.points.back()->mean_dn();
  double kept = 0, all = 0;
  for (const Point* point : view.points) {
    for (const PointValue* value : {&linear, &model}) {
      if (value == &model && !view.has_model) continue;
      const double size = std::abs((*value)(*point));
      if (!std::isfinite(size)) continue;
      all = std::max(all, size);
      if (point->mean_dn() >= least) kept = std::max(kept, size);
    }
  }
  const double end = 1.25 * kept;
  if (!(kept > 0) || !std::isfinite(end)) return false;
  axis->set_low(-end);
  axis->set_high(end);
  return all > end;
}

v1::ReportBlock LinearityChart(const SensorView& view) {
  const auto percent = [](double mean, double expected) { return 100 * (mean / expected - 1); };
  const PointValue linear = [&](const Point& p) {
    return percent(p.mean_dn(), p.linear_mean_dn());
  };
  const PointValue model = [&](const Point& p) { return percent(p.mean_dn(), p.model_mean_dn()); };
  v1::ReportChart chart = ChartOfSteps("Linearity", "");
  *chart.mutable_y() = AxisOf("signal over model \u2212 1", "%");
  const bool cut = KeepAxis(view, linear, model, chart.mutable_y());
  chart.set_explanation(absl::StrCat("How far the mean signal is from what each model expects.",
                                     cut ? " Points beyond the axis are drawn at its end." : ""));
  AddLineAtY(0, &chart);
  AddResiduals(view, linear, model, &chart);
  // Both models have the same error; it is shown for the relevant one.
  std::vector<double> half_widths;
  for (const Point* point : view.points) {
    const double expected = view.has_model ? point->model_mean_dn() : point->linear_mean_dn();
    half_widths.push_back(std::abs(200 * point->mean_standard_error_dn() / expected));
  }
  AddBand(kTwoErrors, half_widths, chart.mutable_series(chart.series_size() - 1));
  return ChartBlock(std::move(chart));
}

v1::ReportBlock VarianceResidualChart(const SensorView& view) {
  const auto standardised = [](const Point& p, double expected) {
    return (p.variance_dn2() - expected) / p.variance_standard_error_dn2();
  };
  v1::ReportChart chart = ChartOfSteps(
      "Noise",
      "Variance in time minus what each model expects. About 95 % of points should lie between "
      "\u22122 and 2.");
  *chart.mutable_y() = AxisOf("residual", "standard errors");
  for (const double at : {-2, 0, 2}) AddLineAtY(at, &chart);
  AddResiduals(
      view, [&](const Point& p) { return standardised(p, p.linear_variance_dn2()); },
      [&](const Point& p) { return standardised(p, p.model_variance_dn2()); }, &chart);
  return ChartBlock(std::move(chart));
}

bool SpansDecades(const google::protobuf::RepeatedField<double>& values) {
  double least = INFINITY, most = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  return least > 0 && std::isfinite(least) && most >= 1e3 * least;
}

v1::ReportBlock CurveChart(const v1::SensorCurve& curve) {
  constexpr int kMostDots = 60;
  v1::ReportChart chart;
  chart.set_title(curve.title());
  *chart.mutable_x() = AxisOf(curve.abscissa(), "", SpansDecades(curve.abscissa_values()));
  *chart.mutable_y() = AxisOf(curve.ordinate(), "", SpansDecades(curve.values()));
  v1::ReportSeries series =
      SeriesOf("", v1::REPORT_COLOUR_MODEL,
               curve.values_size() > kMostDots ? Mark::LINE : Mark::LINE_AND_DOTS,
               {curve.abscissa_values().begin(), curve.abscissa_values().end()},
               {curve.values().begin(), curve.values().end()});
  std::vector<double> half_widths;
  for (const double error : curve.standard_errors()) half_widths.push_back(2 * error);
  AddBand(kTwoErrors, half_widths, &series);
  *chart.add_series() = std::move(series);
  return ChartBlock(std::move(chart));
}

}  // namespace

ReportBlocks PhotonTransferBlocks(const SensorView& view) {
  if (view.points.empty()) return {};
  return {RemarkBlock("Every point is one step with light; dark numbers are taken off."),
          GroupBlock(
              v1::ReportGroup::THREE_COLUMNS,
              {CardBlock("", "", {VarianceChart(view)}), CardBlock("", "", {LinearityChart(view)}),
               CardBlock("", "", {VarianceResidualChart(view)})})};
}

ReportBlocks SensorCurveBlocks(const v1::SensorDiagnosis& diagnosis) {
  ReportBlocks cards;
  for (const v1::SensorCurve& curve : diagnosis.curves()) {
    if (!curve.values().empty()) cards.push_back(CardBlock("", "", {CurveChart(curve)}));
  }
  if (cards.empty()) return {};
  return {GroupBlock(v1::ReportGroup::TWO_COLUMNS, std::move(cards))};
}

}  // namespace sightline
