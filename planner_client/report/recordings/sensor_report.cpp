// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/recordings/sensor_report.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "core/file/atomic_write.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

// A value, its unit and how many of it make one of the message's unit.
struct Shown {
  double per_named = 1;
  std::string unit;  // with the space before it
};

// "e-", "DN^2" and plain fractions as people write them.
Shown ShownAs(const std::string& name, const std::string& unit) {
  const bool part = absl::EndsWith(name, "_relative") || absl::EndsWith(name, "_fraction");
  if (unit.empty() || unit == "1") return part ? Shown{100, "\u202f%"} : Shown{};
  return {1, absl::StrCat("\u202f", absl::StrReplaceAll(unit, {{"e-", "e\u207b"},
                                                               {"^2", "\u00b2"},
                                                               {"^3", "\u00b3"},
                                                               {"^-1", "\u207b\u00b9"},
                                                               {"DN2", "DN\u00b2"}}))};
}

// Titles of a camera file's numbers, where words say more than the name.
std::string Title(const std::string& name) {
  static const std::map<std::string, std::string> kTitles = {
      {"gain_dn_per_electron", "Overall system gain"},
      {"quantum_efficiency", "Quantum efficiency"},
      {"saturation_capacity_electrons", "Saturation capacity"},
      {"dark_mean_electrons", "Dark signal at no exposure time"},
      {"dark_noise_electrons", "Temporal dark noise"},
      {"dark_current_electrons_per_s", "Dark current"},
      {"prnu_relative", "Photo response non-uniformity"},
      {"dsnu_electrons", "Dark signal non-uniformity"},
      {"black_level_dn", "Black level"}};
  const auto title = kTitles.find(name);
  return title == kTitles.end() ? EffectTitle(QuantityName(name)) : title->second;
}

std::string Named(const std::string& title, const std::string& detail_html) {
  return absl::StrCat("<span class=\"effect\">", EscapeHtml(title),
                      "</span><span class=\"detail\">", detail_html, "</span>");
}

// The number with the digits that its interval leaves it.
std::string ValueText(double value, double lower, double upper) {
  const double error = 0.25 * (upper - lower);
  if (!(error > 0) || !std::isfinite(error) || !std::isfinite(value) || value == 0) {
    return Number(value, 4);
  }
  const double digits = std::floor(std::log10(std::abs(value))) - std::floor(std::log10(error)) + 2;
  return Number(value, static_cast<int>(std::clamp(digits, 1.0, 8.0)));
}

std::string ParameterText(const v1::SensorParameter& parameter) {
  const Shown shown = ShownAs(parameter.name(), parameter.unit());
  // Without a name no unit is added: it is said by the message.
  const std::string value = QuantityWithError("", shown.per_named * parameter.value(),
                                              shown.per_named * parameter.standard_error());
  return EscapeHtml(value + shown.unit);
}

std::string PerNumber(double chi_squared, int numbers) {
  return numbers > 0 ? Number(chi_squared / numbers) : "\u2013";
}

using Point = v1::PhotonTransferPoint;
using Value = std::function<double(const Point&)>;

class Report {
 public:
  explicit Report(const v1::SensorDiagnosis& diagnosis) : d_(diagnosis) {
    for (const v1::SensorDeparture& departure : d_.departures()) {
      (departure.found()      ? found_
       : departure.testable() ? absent_
                              : not_testable_)
          .push_back(&departure);
    }
    for (const Point& point : d_.photon_transfer()) {
      (point.saturated() ? saturated_ : points_).push_back(&point);
    }
    // Lines go from left to right. A signal that is no number has no place.
    std::erase_if(points_, [](const Point* point) { return !std::isfinite(point->mean_dn()); });
    std::stable_sort(points_.begin(), points_.end(),
                     [](const Point* a, const Point* b) { return a->mean_dn() < b->mean_dn(); });
    has_model_ = !found_.empty();
  }

  std::string Html() const {
    const std::string set = d_.set().empty() ? "Camera" : d_.set();
    StaticPage page;
    page.title = absl::StrCat(set, " \u2013 diagnosis of the camera");
    page.kicker = absl::StrCat("Sightline \u00b7 flat-field and dark frames of ", set);
    page.heading = Heading();
    page.finding_html = Sentence();
    page.figures = Figures();
    page.warnings.assign(d_.warnings().begin(), d_.warnings().end());
    page.sections_html =
        PageSection("departures", "What the linear model leaves out", Found()) +
        PageSection("photon-transfer", "Signal and noise against the linear model", Transfer()) +
        PageSection("quantities", "The camera", Quantities()) +
        PageSection("curves", "Where it shows", Curves()) +
        PageSection("fit", "How well the models fit", Fits()) +
        PageSection("others", "What else was looked for", Others());
    return StaticPageHtml(page);
  }

 private:
  std::string Heading() const {
    if (!d_.finding().empty()) return d_.finding();
    return found_.empty() ? "These images agree with the linear model of EMVA 1288."
                          : "These images show what the linear model of EMVA 1288 leaves out.";
  }

  std::string Sentence() const {
    const size_t count = found_.size();
    std::string html =
        count == 0 ? "No departure from the linear model of EMVA 1288 was found"
                   : absl::StrCat("<strong>", count, count == 1 ? " departure" : " departures",
                                  "</strong> from the linear model of EMVA 1288 ",
                                  count == 1 ? "was found" : "were found");
    const size_t tested = count + absent_.size();
    if (tested > 0) absl::StrAppend(&html, ", of ", tested, " that these images can show");
    html += ".";
    if (!not_testable_.empty()) {
      absl::StrAppend(&html, " ", not_testable_.size(), " more would need other recordings.");
    }
    return d_.departures().empty() ? "" : html;
  }

  std::vector<std::pair<std::string, std::string>> Figures() const {
    std::vector<std::pair<std::string, std::string>> figures;
    if (!d_.verdict().empty()) figures.push_back({"verdict", EscapeHtml(d_.verdict())});
    const auto change = [&](const std::string& before, const std::string& after) {
      return has_model_ ? absl::StrCat(before, " \u2192 ", after) : before;
    };
    const v1::SensorFit &linear = d_.linear_fit(), &model = d_.model_fit();
    if (linear.degrees_of_freedom() > 0) {
      figures.push_back({"\u03c7\u00b2 per degree of freedom",
                         change(PerNumber(linear.chi_squared(), linear.degrees_of_freedom()),
                                PerNumber(model.chi_squared(), model.degrees_of_freedom()))});
    }
    if (linear.held_out_numbers() > 0) {
      figures.push_back(
          {"of steps predicted from the others",
           change(PerNumber(linear.held_out_chi_squared(), linear.held_out_numbers()),
                  PerNumber(model.held_out_chi_squared(), model.held_out_numbers()))});
    }
    if (!d_.photon_transfer().empty()) {
      figures.push_back(
          {"steps with light",
           absl::StrCat(d_.photon_transfer_size(),
                        saturated_.empty()
                            ? ""
                            : absl::StrCat(" <small>", saturated_.size(), " saturated</small>"))});
    }
    return figures;
  }

  std::string Found() const {
    if (found_.empty()) return "";
    std::vector<std::vector<std::string>> rows;
    for (const v1::SensorDeparture* departure : found_) {
      std::vector<std::string> sizes;
      for (const v1::SensorParameter& parameter : departure->parameters()) {
        sizes.push_back(absl::StrCat(EscapeHtml(QuantityName(parameter.name())), " <strong>",
                                     ParameterText(parameter), "</strong>"));
      }
      rows.push_back({Named(EffectTitle(departure->effect()), EscapeHtml(departure->description())),
                      EscapeHtml(departure->stage()), absl::StrJoin(sizes, "<br>"),
                      absl::StrCat("<span class=\"nowrap\">",
                                   EscapeHtml(PValueText(departure->p_value())), "</span>")});
    }
    return PageTable({"departure", "arises in", "size", "chance"}, rows, {0, 1, 2, 3}) +
           SoftParagraph(
               "In the order of the signal: light and response, patterns, changes from frame to "
               "frame. "
               "After \u00b1: the standard error. Chance: the probability p of so clear a sign if "
               "the departure were not there, times the number of tests made.");
  }

  static std::string Note(const Point& point) {
    std::string note = SettingText("exposure_time_s", point.exposure_time_s());
    if (point.has_photons()) absl::StrAppend(&note, ", ", Number(point.photons(), 4), " photons");
    absl::StrAppend(&note, "; mean ",
                    QuantityWithError("mean_dn", point.mean_dn(), point.mean_standard_error_dn()),
                    "; variance ",
                    QuantityWithError("variance_dn2", point.variance_dn2(),
                                      point.variance_standard_error_dn2()));
    return note;
  }

  static ChartSeries Series(const char* css_class, SeriesMark mark,
                            const std::vector<const Point*>& points, const Value& x,
                            const Value& y) {
    ChartSeries series{css_class, mark, {}, {}, {}, {}};
    const bool noted = mark == SeriesMark::kDots || mark == SeriesMark::kHollowDots;
    for (const Point* point : points) {
      series.x.push_back(x(*point));
      series.y.push_back(y(*point));
      if (noted) series.notes.push_back(Note(*point));
    }
    return series;
  }

  static std::string Card(const std::string& title, const std::string& text, const XyChart& chart) {
    return absl::StrCat("<div class=\"card\"><h3>", EscapeHtml(title), "</h3>\n",
                        text.empty() ? "" : SoftParagraph(EscapeHtml(text)), XyChartSvg(chart),
                        "</div>\n");
  }

  // Three of them stand side by side: their letters shall not shrink.
  static XyChart TransferChart() {
    XyChart chart;
    chart.width = 380;
    chart.height = 280;
    chart.x.title = "mean signal [DN]";
    return chart;
  }

  std::string VarianceChart() const {
    XyChart chart = TransferChart();
    chart.y.title = "variance in time [DN\u00b2]";
    const Value mean = &Point::mean_dn, variance = &Point::variance_dn2;
    chart.series.push_back(Series("observed", SeriesMark::kDots, points_, mean, variance));
    if (!saturated_.empty()) {
      chart.series.push_back(
          Series("observed", SeriesMark::kHollowDots, saturated_, mean, variance));
    }
    chart.series.push_back(Series("null", SeriesMark::kDashedLine, points_, &Point::linear_mean_dn,
                                  &Point::linear_variance_dn2));
    if (has_model_) {
      chart.series.push_back(Series("model", SeriesMark::kLine, points_, &Point::model_mean_dn,
                                    &Point::model_variance_dn2));
    }
    return Card("Photon transfer",
                "Noise of light grows with the signal: the slope is the system gain.", chart);
  }

  // Residuals of both models against the signal. `half_band`: two standard errors.
  XyChart ResidualChart(const std::string& ordinate, const Value& linear, const Value& model,
                        const Value& half_band, std::vector<double> marks) const {
    XyChart chart = TransferChart();
    chart.y.title = ordinate;
    chart.marks = std::move(marks);
    chart.series.push_back(
        Series("null", SeriesMark::kHollowDots, points_, &Point::mean_dn, linear));
    if (has_model_) {
      chart.series.push_back(Series("model", SeriesMark::kDots, points_, &Point::mean_dn, model));
    }
    // The error is the same for both models; it is shown about the one that counts.
    for (const Point* point : points_) chart.series.back().half_band.push_back(half_band(*point));
    return chart;
  }

  std::string LinearityChart() const {
    const auto percent = [](double mean, double expected) { return 100 * (mean / expected - 1); };
    const Value linear = [&](const Point& p) { return percent(p.mean_dn(), p.linear_mean_dn()); };
    const Value model = [&](const Point& p) { return percent(p.mean_dn(), p.model_mean_dn()); };
    const Value band = [this](const Point& p) {
      const double expected = has_model_ ? p.model_mean_dn() : p.linear_mean_dn();
      return std::abs(200 * p.mean_standard_error_dn() / expected);
    };
    XyChart chart = ResidualChart("signal over model \u2212 1 [%]", linear, model, band, {0});
    // Close to no signal a part of a DN is many per cent; it shall not take the axis. EMVA 1288
    // judges linearity from 5 % of the range on.
    const bool cut = KeepAxis(linear, model, &chart);
    return Card("Linearity",
                absl::StrCat("How far the mean signal is from what each model expects.",
                             cut ? " Points beyond the axis are drawn at its end." : ""),
                chart);
  }

  // Sets the ordinate's range by the signals of at least 5 % of the largest; whether others lie
  // outside.
  bool KeepAxis(const Value& linear, const Value& model, XyChart* chart) const {
    if (points_.empty()) return false;
    const double least = 0.05 * points_.back()->mean_dn();
    double kept = 0, all = 0;
    for (const Point* point : points_) {
      for (const Value* value : {&linear, &model}) {
        if (value == &model && !has_model_) continue;
        const double size = std::abs((*value)(*point));
        if (!std::isfinite(size)) continue;
        all = std::max(all, size);
        if (point->mean_dn() >= least) kept = std::max(kept, size);
      }
    }
    const double end = 1.25 * kept;
    if (!(kept > 0) || !std::isfinite(end)) return false;
    chart->y.low = -end;
    chart->y.high = end;
    return all > end;
  }

  std::string VarianceResidualChart() const {
    const auto standardised = [](const Point& p, double expected) {
      return (p.variance_dn2() - expected) / p.variance_standard_error_dn2();
    };
    const Value linear = [&](const Point& p) { return standardised(p, p.linear_variance_dn2()); };
    const Value model = [&](const Point& p) { return standardised(p, p.model_variance_dn2()); };
    XyChart chart = ResidualChart("residual [standard errors]", linear, model,
                                  [](const Point&) { return 0.0; }, {-2, 0, 2});
    chart.series.back().half_band.clear();
    return Card("Noise",
                "Variance in time minus what each model expects. About 95 % of points should lie "
                "between \u22122 and 2.",
                chart);
  }

  std::string Transfer() const {
    if (points_.empty()) return "";
    std::vector<KeyEntry> key = {{"observed", KeyShape::kDot, "measured"}};
    if (!saturated_.empty()) {
      key.push_back({"observed", KeyShape::kHollowDot, "measured, saturated: not used"});
    }
    key.push_back({"null", KeyShape::kDashedLine, "linear model"});
    key.push_back({"null", KeyShape::kHollowDot, "measured against the linear model"});
    if (has_model_) {
      key.push_back({"model", KeyShape::kLine, "with the departures found"});
      key.push_back({"model", KeyShape::kDot, "measured against it"});
    }
    key.push_back({has_model_ ? "model" : "null", KeyShape::kBand, "\u00b1 2 standard errors"});
    return SoftParagraph("Every point is one step with light; dark numbers are taken off.") +
           ChartKey(key) + "<div class=\"cards three\">\n" + VarianceChart() + LinearityChart() +
           VarianceResidualChart() + "</div>\n";
  }

  static std::string CurveCard(const v1::SensorCurve& curve) {
    const auto decades = [](const google::protobuf::RepeatedField<double>& values) {
      double least = INFINITY, most = 0;
      for (const double value : values) {
        if (!std::isfinite(value)) continue;
        least = std::min(least, value);
        most = std::max(most, value);
      }
      return least > 0 && std::isfinite(least) && most >= 1e3 * least;
    };
    XyChart chart;
    chart.x.title = curve.abscissa();
    chart.y.title = curve.ordinate();
    chart.x.logarithmic = decades(curve.abscissa_values());
    chart.y.logarithmic = decades(curve.values());
    if (chart.x.logarithmic) chart.x.title += ", log";
    if (chart.y.logarithmic) chart.y.title += ", log";
    constexpr int kMostDots = 60;
    ChartSeries series{
        "model",
        curve.values_size() > kMostDots ? SeriesMark::kLine : SeriesMark::kLineAndDots,
        {curve.abscissa_values().begin(), curve.abscissa_values().end()},
        {curve.values().begin(), curve.values().end()},
        {},
        {}};
    for (const double error : curve.standard_errors()) series.half_band.push_back(2 * error);
    chart.series.push_back(std::move(series));
    return Card(curve.title(), "", chart);
  }

  std::string Curves() const {
    std::string cards;
    bool bands = false;
    for (const v1::SensorCurve& curve : d_.curves()) {
      if (curve.values().empty()) continue;
      cards += CurveCard(curve);
      bands |= !curve.standard_errors().empty();
    }
    if (cards.empty()) return "";
    return absl::StrCat(bands ? SoftParagraph("Shaded: \u00b1 2 standard errors.") : "",
                        "<div class=\"cards\">\n", cards, "</div>\n");
  }

  std::string Quantities() const {
    if (d_.quantities().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    for (const v1::SensorQuantity& q : d_.quantities()) {
      const Shown shown = ShownAs(q.name(), q.unit());
      const auto value = [&](bool given, double number, double lower, double upper) {
        if (!given) return std::string("\u2013");
        const double k = shown.per_named;
        return EscapeHtml(ValueText(k * number, k * lower, k * upper) + shown.unit);
      };
      const auto interval = [&](bool given, double lower, double upper) {
        if (!given) return std::string("\u2013");
        // Without a name no unit is added.
        return EscapeHtml(QuantityInterval("", shown.per_named * lower, shown.per_named * upper));
      };
      std::vector<std::string> remarks;
      if (!q.clause().empty())
        remarks.push_back(absl::StrCat("EMVA 1288: ", EscapeHtml(q.clause())));
      if (!q.note().empty()) remarks.push_back(EscapeHtml(q.note()));
      rows.push_back(
          {Named(Title(q.name()), CodeHtml(q.name())),
           absl::StrCat("<strong>", value(q.has_value(), q.value(), q.lower(), q.upper()),
                        "</strong>"),
           interval(q.has_lower() && q.has_upper(), q.lower(), q.upper()),
           value(q.has_emva_value(), q.emva_value(), q.emva_lower(), q.emva_upper()),
           interval(q.has_emva_lower() && q.has_emva_upper(), q.emva_lower(), q.emva_upper()),
           absl::StrJoin(remarks, "<br>")});
    }
    return PageTable({"quantity", "value", "95\u202f% interval", "by EMVA 1288,<br>release 4.0",
                      "95\u202f% interval", "remarks"},
                     rows, {0, 5}) +
           SoftParagraph(
               "Value: fitted to all steps at once, with the departures found. By EMVA 1288: as "
               "the standard defines it, for comparison with data sheets.");
  }

  std::string Fits() const {
    std::vector<std::vector<std::string>> rows;
    const auto add = [&](const char* title, const v1::SensorFit& fit, bool reference) {
      const double gain = fit.held_out_log_score_gain();
      if (fit.degrees_of_freedom() <= 0 && fit.parameters().empty()) return;
      std::vector<std::string> parameters;
      for (const v1::SensorParameter& parameter : fit.parameters()) {
        parameters.push_back(
            absl::StrCat(EscapeHtml(Title(parameter.name())), " ", ParameterText(parameter)));
      }
      rows.push_back({absl::StrCat("<span class=\"effect\">", title, "</span>"),
                      PerNumber(fit.chi_squared(), fit.degrees_of_freedom()),
                      GroupedInteger(fit.degrees_of_freedom()),
                      PerNumber(fit.held_out_chi_squared(), fit.held_out_numbers()),
                      reference || fit.held_out_numbers() <= 0
                          ? "\u2013"
                          : FixedNumber(gain, std::abs(gain) < 10 ? 1 : 0),
                      absl::StrJoin(parameters, "<br>")});
    };
    add("Linear model", d_.linear_fit(), true);
    if (has_model_) add("With the departures found", d_.model_fit(), false);
    if (rows.empty()) return "";
    return SoftParagraph(
               "Means and variances of all steps below saturation. 1 means that what is left over "
               "is as large as noise makes it.") +
           PageTable({"model", "\u03c7\u00b2 per degree<br>of freedom", "degrees<br>of freedom",
                      "\u03c7\u00b2 per number of steps<br>predicted from the others",
                      "gain in log score<br>of these [nats]", "fitted values"},
                     rows, {0, 5});
  }

  // What was not found is of interest to few: folded away.
  std::string Others() const {
    std::string html;
    if (!absent_.empty()) {
      std::vector<std::vector<std::string>> rows;
      for (const v1::SensorDeparture* departure : absent_) {
        rows.push_back(
            {Named(EffectTitle(departure->effect()), EscapeHtml(departure->description())),
             EscapeHtml(departure->stage()), EscapeHtml(PValueText(departure->p_value()))});
      }
      absl::StrAppend(
          &html, "<details><summary>Looked for and not found: ", absent_.size(), "</summary>\n",
          PageTable({"departure", "would arise in", "chance"}, rows, {0, 1, 2}), "</details>\n");
    }
    if (!not_testable_.empty()) {
      std::vector<std::vector<std::string>> rows;
      for (const v1::SensorDeparture* departure : not_testable_) {
        rows.push_back({absl::StrCat("<span class=\"effect\">",
                                     EscapeHtml(EffectTitle(departure->effect())), "</span>"),
                        EscapeHtml(departure->stage()), EscapeHtml(departure->description())});
      }
      absl::StrAppend(&html, "<details><summary>These images cannot show: ", not_testable_.size(),
                      "</summary>\n",
                      PageTable({"departure", "would arise in", "what it needs"}, rows, {0, 1, 2}),
                      "</details>\n");
    }
    return html;
  }

  const v1::SensorDiagnosis& d_;
  std::vector<const v1::SensorDeparture*> found_, absent_, not_testable_;
  // Below saturation, by their signal; and above.
  std::vector<const Point*> points_, saturated_;
  bool has_model_ = false;
};

absl::Status Check(const v1::SensorDiagnosis& diagnosis) {
  for (int i = 0; i < diagnosis.curves_size(); ++i) {
    const v1::SensorCurve& curve = diagnosis.curves(i);
    const int size = curve.values_size();
    const bool errors_fit = curve.standard_errors().empty() || curve.standard_errors_size() == size;
    if (curve.abscissa_values_size() == size && errors_fit) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "report: curves[%d].%s has size %d, must be %d (size of values)", i,
        errors_fit ? "abscissa_values" : "standard_errors",
        errors_fit ? curve.abscissa_values_size() : curve.standard_errors_size(), size));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> RenderSensorReport(const v1::SensorDiagnosis& diagnosis) {
  if (absl::Status status = Check(diagnosis); !status.ok()) return status;
  return Report(diagnosis).Html();
}

absl::Status WriteSensorReport(const v1::SensorDiagnosis& diagnosis, const std::string& path) {
  const absl::StatusOr<std::string> html = RenderSensorReport(diagnosis);
  if (!html.ok()) return html.status();
  return WriteFileAtomically(path, *html);
}

}  // namespace sightline
