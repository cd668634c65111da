// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/optics/optics_charts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/optics/optics_text.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

using v1::OpticsPoint;
using Exposure = v1::OpticsPoint::ExposurePoint;

constexpr size_t kMaxLines = 12;  // as many as charts.css has colours in order

struct Value {
  double value = kNoNumber, lower = kNoNumber, upper = kNoNumber;
};

Value WithInterval(double value, bool has_interval, const v1::OpticsInterval& interval) {
  if (!has_interval) return {value, kNoNumber, kNoNumber};
  return {value, interval.lower(), interval.upper()};
}

// One of the quantities that are drawn over the f-number.
struct ChartedQuantity {
  const char* css_class;
  double factor;  // from the field to what the axis says
  Value (*of)(const OpticsPoint&);
};

Value Cost(const OpticsPoint& p) {
  return WithInterval(p.cost(), p.has_cost_interval(), p.cost_interval());
}
Value ExposureTime(const OpticsPoint& p) {
  return WithInterval(p.exposure_time_s(), p.has_exposure_time_s_interval(),
                      p.exposure_time_s_interval());
}
Value SimulatedUPx(const OpticsPoint& p) {
  return WithInterval(UPx(p), p.has_u_px_interval() && std::isfinite(UPx(p)), p.u_px_interval());
}
Value RealUPx(const OpticsPoint& p) {
  return WithInterval(ExpectedRealUPx(p), p.has_expected_real_u_px_interval(),
                      p.expected_real_u_px_interval());
}
Value Coverage(const OpticsPoint& p) {
  return WithInterval(p.profile_coverage(), p.has_profile_coverage_interval(),
                      p.profile_coverage_interval());
}

std::string Achieved(double cost, double u_px, double coverage) {
  return absl::StrCat("cost ", QuantityText("cost_px", cost), ", u\u209a\u2093 ",
                      QuantityText("u_px", u_px), ", coverage ", ShareText(coverage));
}

std::string Note(const OpticsPoint& point) {
  return absl::StrCat(SettingWords(point), ": ",
                      Achieved(point.cost(), UPx(point), point.profile_coverage()));
}

// A line through all points and a dot at each: filled where it is as good as the best.
void AddQuantity(XyChart* chart, const OpticsCurve& curve, const ChartedQuantity& quantity) {
  ChartSeries line{quantity.css_class, SeriesMark::kLine, {}, {}, {}, {}};
  ChartSeries good{quantity.css_class, SeriesMark::kDots, {}, {}, {}, {}};
  ChartSeries worse{quantity.css_class, SeriesMark::kHollowDots, {}, {}, {}, {}};
  for (const OpticsPoint* point : curve.points) {
    const Value value = quantity.of(*point);
    line.x.push_back(point->f_number());
    line.y.push_back(quantity.factor * value.value);
    line.lower.push_back(quantity.factor * value.lower);
    line.upper.push_back(quantity.factor * value.upper);
    ChartSeries& dots = AsGoodAsBest(curve, *point) ? good : worse;
    dots.x.push_back(line.x.back());
    dots.y.push_back(line.y.back());
    dots.notes.push_back(Note(*point));
  }
  chart->series.push_back(std::move(line));
  chart->series.push_back(std::move(worse));
  chart->series.push_back(std::move(good));
}

void MarkBest(XyChart* chart, const OpticsCurve& curve, const ChartedQuantity& quantity) {
  if (curve.best == nullptr) return;
  chart->series.push_back({"null",
                           SeriesMark::kRings,
                           {curve.best->f_number()},
                           {quantity.factor * quantity.of(*curve.best).value},
                           {},
                           {Note(*curve.best)}});
}

// Times of one chart share one unit, that of the middle of their logarithmic axis.
ShownUnit TimeUnit(double shortest, double longest) {
  return ShownUnitOf("exposure_time_s", shortest > 0 && std::isfinite(longest)
                                            ? std::sqrt(shortest) * std::sqrt(longest)
                                            : 1e-3);
}

struct Extent {
  double low = std::numeric_limits<double>::infinity(), high = 0;

  void Add(double value) {
    if (!std::isfinite(value) || value <= 0) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // A limit far beside the data would only make the chart small.
  bool IsNear(double value) const { return value >= low / 2 && value <= 2 * high; }
};

KeyEntry LimitKey(double longest_exposure_time_s) {
  return {"mark", KeyShape::kDashedLine,
          absl::StrCat("longest exposure time possible, ",
                       SettingText("exposure_time_s", longest_exposure_time_s))};
}

// So many of `count` things, evenly spread and with `wanted` among them (npos: none).
std::vector<size_t> Spread(size_t count, size_t most, size_t wanted) {
  std::vector<size_t> chosen;
  for (size_t i = 0; i < std::min(count, most); ++i) {
    chosen.push_back(count <= most ? i : i * (count - 1) / (most - 1));
  }
  if (wanted >= count || std::find(chosen.begin(), chosen.end(), wanted) != chosen.end()) {
    return chosen;
  }
  *std::min_element(chosen.begin(), chosen.end(), [&](size_t a, size_t b) {
    const auto distance = [&](size_t i) { return i > wanted ? i - wanted : wanted - i; };
    return distance(a) < distance(b);
  }) = wanted;
  return chosen;
}

}  // namespace

bool AsGoodAsBest(const OpticsCurve& curve, const OpticsPoint& point) {
  return point.as_good_as_best() ||
         (curve.best != nullptr && point.f_number() == curve.best->f_number());
}

std::string FNumberCharts(const OpticsCurve& curve) {
  if (curve.points.empty()) return "";
  XyChart frame;
  frame.x.title = "f-number";
  frame.x.logarithmic = true;
  Extent times;
  bool has_real = false, has_constant_exposure = false;
  for (const OpticsPoint* point : curve.points) {
    frame.x.ticks.push_back(point->f_number());
    times.Add(point->exposure_time_s());
    has_real |= std::isfinite(ExpectedRealUPx(*point));
    has_constant_exposure |= point->constant_exposure_time_s() > 0;
  }
  const bool has_limit = times.IsNear(curve.longest_exposure_time_s);

  XyChart cost = frame;
  cost.title = "Cost";
  cost.y.title = "cost [px]";
  const ChartedQuantity cost_px = {"model", 1, Cost};
  AddQuantity(&cost, curve, cost_px);
  MarkBest(&cost, curve, cost_px);

  XyChart exposure = frame;
  const ShownUnit unit = TimeUnit(times.low, times.high);
  exposure.title = "Exposure time";
  exposure.y.title = absl::StrCat("exposure time [", unit.name, "]");
  exposure.y.logarithmic = true;
  if (has_constant_exposure) {
    ChartSeries constant{"blue", SeriesMark::kDashedLine, {}, {}, {}, {}};
    for (const OpticsPoint* point : curve.points) {
      constant.x.push_back(point->f_number());
      constant.y.push_back(unit.per_named * point->constant_exposure_time_s());
    }
    exposure.series.push_back(std::move(constant));
  }
  const ChartedQuantity time = {"model", unit.per_named, ExposureTime};
  AddQuantity(&exposure, curve, time);
  MarkBest(&exposure, curve, time);
  if (has_limit) exposure.marks = {unit.per_named * curve.longest_exposure_time_s};

  XyChart scatter = frame;
  scatter.title = "Scatter of the detected line";
  scatter.y.title = "u\u209a\u2093 [px]";
  if (has_real) AddQuantity(&scatter, curve, {"blue", 1, RealUPx});
  const ChartedQuantity u_px = {"model", 1, SimulatedUPx};
  AddQuantity(&scatter, curve, u_px);
  MarkBest(&scatter, curve, u_px);

  XyChart coverage = frame;
  coverage.title = "Profile coverage";
  coverage.y.title = "detected part of the line [%]";
  coverage.y.high = 100;
  const ChartedQuantity percent = {"model", 100, Coverage};
  AddQuantity(&coverage, curve, percent);
  MarkBest(&coverage, curve, percent);

  std::vector<KeyEntry> key = {
      {"model", KeyShape::kDot, "as good as the best"},
      {"model", KeyShape::kHollowDot, "worse"},
      {"model", KeyShape::kBand,
       "95 of 100 fresh frames; of the exposure time: as good as the one drawn"}};
  if (curve.best != nullptr) key.insert(key.begin(), {"null", KeyShape::kRing, "best"});
  if (has_constant_exposure) {
    key.push_back({"blue", KeyShape::kDashedLine, "constant exposure (eq. 6.6)"});
  }
  if (has_real) {
    key.push_back({"blue", KeyShape::kLine, "u\u209a\u2093 expected of the real camera (eq. 6.8)"});
  }
  if (has_limit) key.push_back(LimitKey(curve.longest_exposure_time_s));
  return absl::StrCat("<p class=\"soft\">Every dot is the best setting with that f-number.</p>\n",
                      ChartKey(key), "<div class=\"cards\">\n", XyChartSvg(cost),
                      XyChartSvg(exposure), XyChartSvg(scatter), XyChartSvg(coverage), "</div>\n");
}

std::string ExposureChart(const OpticsCurve& curve) {
  std::vector<const OpticsPoint*> evaluated;
  size_t of_best = std::string::npos;
  for (const OpticsPoint* point : curve.points) {
    if (point->exposures().empty()) continue;
    if (curve.best != nullptr && point->f_number() == curve.best->f_number()) {
      of_best = evaluated.size();
    }
    evaluated.push_back(point);
  }
  if (evaluated.empty()) return "";
  const std::vector<size_t> drawn = Spread(evaluated.size(), kMaxLines, of_best);

  Extent times, costs;
  for (const size_t i : drawn) {
    for (const Exposure& exposure : evaluated[i]->exposures()) {
      times.Add(exposure.exposure_time_s());
      costs.Add(exposure.cost());
    }
  }
  const ShownUnit unit = TimeUnit(times.low, times.high);
  XyChart chart;
  chart.width = 1000;
  chart.height = 420;
  chart.x.title = absl::StrCat("exposure time [", unit.name, "]");
  chart.x.logarithmic = true;
  chart.y.title = "cost [px]";
  std::vector<KeyEntry> key;
  std::vector<ChartSeries> dots;
  for (size_t line = 0; line < drawn.size(); ++line) {
    const OpticsPoint& point = *evaluated[drawn[line]];
    // A search does not ask in order.
    std::vector<const Exposure*> exposures;
    for (const Exposure& exposure : point.exposures()) exposures.push_back(&exposure);
    std::stable_sort(exposures.begin(), exposures.end(), [](const Exposure* a, const Exposure* b) {
      return a->exposure_time_s() < b->exposure_time_s();
    });
    const size_t hue = drawn.size() == 1 ? 1 : line * (kMaxLines - 1) / (drawn.size() - 1);
    // Neighbours among many colours are told apart by the dashes.
    const bool dashed = drawn.size() > 6 && line % 2 == 1;
    ChartSeries series{absl::StrCat("hue", hue),
                       dashed ? SeriesMark::kDashedLine : SeriesMark::kLine,
                       {},
                       {},
                       {},
                       {}};
    for (const Exposure* exposure : exposures) {
      series.x.push_back(unit.per_named * exposure->exposure_time_s());
      series.y.push_back(exposure->cost());
    }
    const Exposure& least = **std::min_element(
        exposures.begin(), exposures.end(),
        [](const Exposure* a, const Exposure* b) { return a->cost() < b->cost(); });
    dots.push_back(
        {series.css_class,
         SeriesMark::kDots,
         {unit.per_named * least.exposure_time_s()},
         {least.cost()},
         {},
         {absl::StrCat(FNumberText(point.f_number()), ", ",
                       SettingText("exposure_time_s", least.exposure_time_s()), ": ",
                       Achieved(least.cost(), least.u_px(), least.profile_coverage()))}});
    key.push_back({series.css_class, dashed ? KeyShape::kDashedLine : KeyShape::kLine,
                   FNumberText(point.f_number())});
    chart.series.push_back(std::move(series));
  }
  const bool has_limit = times.IsNear(curve.longest_exposure_time_s);
  if (has_limit) {
    const double at = unit.per_named * curve.longest_exposure_time_s;
    chart.series.push_back(
        {"mark", SeriesMark::kDashedLine, {at, at}, {costs.low, costs.high}, {}, {}});
    key.push_back(LimitKey(curve.longest_exposure_time_s));
  }
  chart.series.insert(chart.series.end(), dots.begin(), dots.end());
  key.push_back({"observed", KeyShape::kDot, "least cost with that f-number"});
  if (curve.best != nullptr) {
    chart.series.push_back({"null",
                            SeriesMark::kRings,
                            {unit.per_named * curve.best->exposure_time_s()},
                            {curve.best->cost()},
                            {},
                            {Note(*curve.best)}});
    key.push_back({"null", KeyShape::kRing, "best"});
  }
  return absl::StrCat(drawn.size() == evaluated.size()
                          ? ""
                          : absl::StrCat("<p class=\"soft\">", drawn.size(), " of ",
                                         evaluated.size(), " f-numbers are drawn.</p>\n"),
                      ChartKey(key), XyChartSvg(chart));
}

}  // namespace sightline
