// SPDX-License-Identifier: Apache-2.0
#include "report/optics/optics_charts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "report/document/report_series.h"
#include "report/optics/optics_text.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

using v1::OpticsPoint;
using Exposure = v1::OpticsPoint::ExposurePoint;

constexpr size_t kMaxLines = 12;  // as many as there are colours in order

struct Value {
  double value = kNoNumber, lower = kNoNumber, upper = kNoNumber;
};

Value WithInterval(double value, bool has_interval, const v1::OpticsInterval& interval) {
  if (!has_interval) return {value, kNoNumber, kNoNumber};
  return {value, interval.lower(), interval.upper()};
}

// A quantity drawn over the f-number.
struct ChartedQuantity {
  v1::ReportColour colour;
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

// A line through all points and a dot at each: filled if it is as good as the best. Dots of
// simulated quantities have an entry in the key; others have their line in it.
void AddQuantity(const OpticsCurve& curve, const ChartedQuantity& quantity, const std::string& name,
                 v1::ReportChart* chart) {
  const bool in_key = name.empty();
  v1::ReportSeries line = EmptySeries(name, quantity.colour, v1::ReportSeries::LINE);
  v1::ReportSeries good =
      EmptySeries(in_key ? "as good as the best" : "", quantity.colour, v1::ReportSeries::DOTS);
  v1::ReportSeries worse =
      EmptySeries(in_key ? "worse" : "", quantity.colour, v1::ReportSeries::HOLLOW_DOTS);
  for (const OpticsPoint* point : curve.points) {
    const Value value = quantity.of(*point);
    const double y = quantity.factor * value.value;
    AddPoint(point->f_number(), y, &line);
    line.add_low(quantity.factor * value.lower);
    line.add_high(quantity.factor * value.upper);
    if (in_key && std::isfinite(value.lower)) {
      line.set_band_name("95 of 100 fresh frames; of the exposure time: as good as the one drawn");
    }
    AddPoint(point->f_number(), y, Note(*point), AsGoodAsBest(curve, *point) ? &good : &worse);
  }
  for (v1::ReportSeries* series : {&line, &worse, &good}) {
    if (!series->x().empty()) *chart->add_series() = std::move(*series);
  }
}

v1::ReportSeries RingAt(double x, double y, const std::string& note) {
  v1::ReportSeries ring = EmptySeries("best", v1::REPORT_COLOUR_REFERENCE, v1::ReportSeries::RINGS);
  AddPoint(x, y, note, &ring);
  return ring;
}

void MarkBest(const OpticsCurve& curve, const ChartedQuantity& quantity, v1::ReportChart* chart) {
  if (curve.best == nullptr) return;
  *chart->add_series() = RingAt(
      curve.best->f_number(), quantity.factor * quantity.of(*curve.best).value, Note(*curve.best));
}

// All times of a chart share the unit that suits the middle of their logarithmic axis.
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
  // A limit far from the data would only compress the chart.
  bool IsNear(double value) const { return value >= low / 2 && value <= 2 * high; }
};

std::string LimitName(double longest_exposure_time_s) {
  return absl::StrCat("longest exposure time possible, ",
                      SettingText("exposure_time_s", longest_exposure_time_s));
}

// Indices of up to this many of `count` things, evenly spread and including `wanted` (npos: none).
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

// Cost, exposure time, standard deviation and coverage over the f-number, in this order.
ReportBlocks QuantityCharts(const OpticsCurve& curve, const v1::ReportAxis& f_numbers,
                            const Extent& times) {
  const auto chart_of = [&](const char* title, const v1::ReportAxis& y) {
    v1::ReportChart chart;
    chart.set_title(title);
    *chart.mutable_x() = f_numbers;
    *chart.mutable_y() = y;
    return chart;
  };
  const auto finish = [&](const ChartedQuantity& quantity, v1::ReportChart chart) {
    AddQuantity(curve, quantity, "", &chart);
    MarkBest(curve, quantity, &chart);
    return ChartBlock(std::move(chart));
  };
  const v1::ReportColour model = v1::REPORT_COLOUR_MODEL, blue = v1::REPORT_COLOUR_BLUE;
  v1::ReportChart cost = chart_of("Cost", AxisOf("cost", "px"));

  const ShownUnit unit = TimeUnit(times.low, times.high);
  v1::ReportChart exposure = chart_of("Exposure time", AxisOf("exposure time", unit.name, true));
  v1::ReportSeries constant =
      EmptySeries("constant exposure (eq. 6.6)", blue, v1::ReportSeries::DASHED_LINE);
  bool has_constant_exposure = false, has_real = false;
  for (const OpticsPoint* point : curve.points) {
    AddPoint(point->f_number(), unit.per_named * point->constant_exposure_time_s(), &constant);
    has_constant_exposure |= point->constant_exposure_time_s() > 0;
    has_real |= std::isfinite(ExpectedRealUPx(*point));
  }
  if (has_constant_exposure) *exposure.add_series() = std::move(constant);
  if (times.IsNear(curve.longest_exposure_time_s)) {
    AddLineAtY(unit.per_named * curve.longest_exposure_time_s, &exposure,
               LimitName(curve.longest_exposure_time_s));
  }

  v1::ReportChart scatter = chart_of("Scatter of the detected line", AxisOf("u\u209a\u2093", "px"));
  if (has_real) {
    AddQuantity(curve, {blue, 1, RealUPx}, "u\u209a\u2093 expected of the real camera (eq. 6.8)",
                &scatter);
  }
  v1::ReportChart coverage = chart_of("Profile coverage", AxisOf("detected part of the line", "%"));
  coverage.mutable_y()->set_high(100);
  return {finish({model, 1, Cost}, std::move(cost)),
          finish({model, unit.per_named, ExposureTime}, std::move(exposure)),
          finish({model, 1, SimulatedUPx}, std::move(scatter)),
          finish({model, 100, Coverage}, std::move(coverage))};
}

// Costs over exposure times for one f-number, sorted since a search evaluates them out of order.
v1::ReportSeries CostsOverTime(const OpticsPoint& point, const ShownUnit& unit) {
  std::vector<const Exposure*> exposures;
  for (const Exposure& exposure : point.exposures()) exposures.push_back(&exposure);
  std::stable_sort(exposures.begin(), exposures.end(), [](const Exposure* a, const Exposure* b) {
    return a->exposure_time_s() < b->exposure_time_s();
  });
  v1::ReportSeries series = EmptySeries(FNumberText(point.f_number()), v1::REPORT_COLOUR_IN_ORDER,
                                        v1::ReportSeries::LINE);
  for (const Exposure* exposure : exposures) {
    AddPoint(unit.per_named * exposure->exposure_time_s(), exposure->cost(), &series);
  }
  return series;
}

// The first of the f-number's exposure times with the least cost.
v1::ReportSeries LeastCost(const OpticsPoint& point, const ShownUnit& unit) {
  const Exposure& least =
      *std::min_element(point.exposures().begin(), point.exposures().end(),
                        [](const Exposure& a, const Exposure& b) { return a.cost() < b.cost(); });
  v1::ReportSeries dot = EmptySeries("", v1::REPORT_COLOUR_IN_ORDER, v1::ReportSeries::DOTS);
  AddPoint(unit.per_named * least.exposure_time_s(), least.cost(),
           absl::StrCat(FNumberText(point.f_number()), ", ",
                        SettingText("exposure_time_s", least.exposure_time_s()), ": ",
                        Achieved(least.cost(), least.u_px(), least.profile_coverage())),
           &dot);
  return dot;
}

}  // namespace

bool AsGoodAsBest(const OpticsCurve& curve, const OpticsPoint& point) {
  return point.as_good_as_best() ||
         (curve.best != nullptr && point.f_number() == curve.best->f_number());
}

ReportBlocks FNumberBlocks(const OpticsCurve& curve) {
  if (curve.points.empty()) return {};
  v1::ReportAxis f_numbers = AxisOf("f-number", "", true);
  Extent times;
  for (const OpticsPoint* point : curve.points) {
    f_numbers.add_ticks(point->f_number());
    times.Add(point->exposure_time_s());
  }
  return {RemarkBlock("Every dot is the best setting with that f-number."),
          GroupBlock(v1::ReportGroup::TWO_COLUMNS, QuantityCharts(curve, f_numbers, times))};
}

ReportBlocks ExposureBlocks(const OpticsCurve& curve) {
  std::vector<const OpticsPoint*> evaluated;
  size_t of_best = std::string::npos;
  for (const OpticsPoint* point : curve.points) {
    if (point->exposures().empty()) continue;
    if (curve.best != nullptr && point->f_number() == curve.best->f_number()) {
      of_best = evaluated.size();
    }
    evaluated.push_back(point);
  }
  if (evaluated.empty()) return {};
  const std::vector<size_t> drawn = Spread(evaluated.size(), kMaxLines, of_best);
  Extent times;
  for (const size_t i : drawn) {
    for (const Exposure& exposure : evaluated[i]->exposures())
      times.Add(exposure.exposure_time_s());
  }
  const ShownUnit unit = TimeUnit(times.low, times.high);
  v1::ReportChart chart;
  chart.set_title("Cost against exposure time");
  chart.set_explanation("A dot is the least cost with its f-number.");
  *chart.mutable_x() = AxisOf("exposure time", unit.name, true);
  *chart.mutable_y() = AxisOf("cost", "px");
  std::vector<v1::ReportSeries> dots;
  for (size_t line = 0; line < drawn.size(); ++line) {
    const OpticsPoint& point = *evaluated[drawn[line]];
    const size_t hue = drawn.size() == 1 ? 1 : line * (kMaxLines - 1) / (drawn.size() - 1);
    v1::ReportSeries& costs = *chart.add_series();
    costs = CostsOverTime(point, unit);
    // Dashes distinguish neighbours among many colours.
    if (drawn.size() > 6 && line % 2 == 1) costs.set_mark(v1::ReportSeries::DASHED_LINE);
    costs.set_hue(static_cast<int32_t>(hue));
    dots.push_back(LeastCost(point, unit));
    dots.back().set_hue(static_cast<int32_t>(hue));
  }
  if (times.IsNear(curve.longest_exposure_time_s)) {
    AddLineAtX(unit.per_named * curve.longest_exposure_time_s, &chart,
               LimitName(curve.longest_exposure_time_s));
  }
  for (v1::ReportSeries& dot : dots) *chart.add_series() = std::move(dot);
  if (curve.best != nullptr) {
    *chart.add_series() = RingAt(unit.per_named * curve.best->exposure_time_s(), curve.best->cost(),
                                 Note(*curve.best));
  }
  ReportBlocks blocks;
  if (drawn.size() < evaluated.size()) {
    blocks.push_back(
        RemarkBlock(absl::StrCat(drawn.size(), " of ", evaluated.size(), " f-numbers are drawn.")));
  }
  blocks.push_back(ChartBlock(std::move(chart)));
  return blocks;
}

}  // namespace sightline
