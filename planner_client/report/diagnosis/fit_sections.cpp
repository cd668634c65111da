// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/fit_sections.h"

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/report/charts/range_chart.h"
#include "planner_client/report/charts/recording_bars.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/diagnosis/diagnosis_text.h"
#include "planner_client/report/diagnosis/diagnosis_view.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/recordings/recording_text.h"

namespace sightline {
namespace {

std::string ObservableChart(const DiagnosisView& view) {
  RangeChart chart;
  chart.title = "Chi squared per degree of freedom of every kind of observable, before and after";
  chart.x.title = "\u03c7\u00b2 per degree of freedom";
  chart.x.logarithmic = true;
  chart.lines = {1};
  chart.joined = true;
  const auto add = [&](const std::string& label, std::optional<double> before,
                       std::optional<double> after, const std::string& note) {
    if (!before.has_value()) return;
    RangeRow row;
    row.label = label;
    row.marks.push_back({"null", *before, 0});
    std::string text = Number(*before);
    if (view.has_model && after.has_value()) {
      row.marks.push_back({"model", *after, 0});
      text = Change(text, Number(*after));
    }
    row.note = note.empty() ? text : absl::StrCat(text, "  (", note, ")");
    chart.rows.push_back(std::move(row));
  };
  const v1::ModelFit& before = view.diagnosis.null_fit();
  const v1::ModelFit& after = view.diagnosis.model_fit();
  add(view.of_part ? "tiles not used in fitting" : "all recordings",
      PerDegree(before.chi_squared(), before.degrees_of_freedom()),
      PerDegree(after.chi_squared(), after.degrees_of_freedom()),
      absl::StrCat(GroupedInteger(before.degrees_of_freedom()), " dof"));
  const v1::HeldOutImprovement& held_out = view.diagnosis.held_out_improvement();
  if (held_out.null() > 0 && !view.of_part) {
    add(view.held_out.empty() ? "every recording, predicted from others" : "held-out recordings",
        held_out.null(), held_out.with_effect(),
        held_out.recordings().empty() ? ""
                                      : absl::StrCat(held_out.recordings_size(), " recordings"));
  }
  for (const v1::ObservableFit& fit : held_out.observables()) {
    add(QuantityName(fit.observable()), PerDegree(fit.null_chi_squared(), fit.degrees_of_freedom()),
        PerDegree(fit.model_chi_squared(), fit.degrees_of_freedom()),
        absl::StrCat(GroupedInteger(fit.degrees_of_freedom()), " dof, never fitted"));
  }
  return chart.rows.empty() ? "" : RangeChartSvg(chart);
}

// Of both fits, by recording.
std::map<int, std::pair<const v1::RecordingFit*, const v1::RecordingFit*>> FitsByRecording(
    const DiagnosisView& view) {
  std::map<int, std::pair<const v1::RecordingFit*, const v1::RecordingFit*>> fits;
  for (const v1::RecordingFit& fit : view.diagnosis.null_fit().recordings())
    fits[fit.recording()].first = &fit;
  if (view.has_model) {
    for (const v1::RecordingFit& fit : view.diagnosis.model_fit().recordings())
      fits[fit.recording()].second = &fit;
  }
  return fits;
}

std::string RecordingNote(const DiagnosisView& view, int index) {
  const v1::Recording* recording = view.RecordingAt(index);
  std::string note = RecordingTitle(index, recording);
  if (recording != nullptr) absl::StrAppend(&note, ": ", RecordingSetup(*recording));
  return note;
}

std::string RecordingChart(const DiagnosisView& view) {
  std::vector<RecordingBars> recordings;
  for (const auto& [index, fits] : FitsByRecording(view)) {
    RecordingBars bars;
    bars.label = absl::StrCat(index);
    bars.note = RecordingNote(view, index);
    bars.marked = view.held_out.count(index) > 0;
    const auto add = [&](const v1::RecordingFit* fit, const char* css_class) {
      if (fit == nullptr) return;
      const auto value = PerDegree(fit->chi_squared(), fit->degrees_of_freedom());
      if (!value.has_value()) return;
      bars.bars.push_back({css_class, *value});
      absl::StrAppend(&bars.note, bars.bars.size() > 1 ? " \u2192 " : "; \u03c7\u00b2/dof ",
                      Number(*value));
    };
    add(fits.first, "null");
    add(fits.second, "model");
    if (!bars.bars.empty()) recordings.push_back(std::move(bars));
  }
  if (recordings.empty()) return "";
  return absl::StrCat("<h3>Recording by recording</h3>\n",
                      RecordingBarsSvg("\u03c7\u00b2 per dof", recordings));
}

std::string IntensityChart(const DiagnosisView& view) {
  ChartSeries before{"null", SeriesMark::kHollowDots, {}, {}, {}, {}};
  ChartSeries after{"model", SeriesMark::kDots, {}, {}, {}, {}};
  for (const auto& [recording, fits] : FitsByRecording(view)) {
    const auto add = [&, index = recording](const v1::RecordingFit* fit, ChartSeries* series) {
      if (fit == nullptr || !fit->has_intensity_ratio() || !(fit->intensity_ratio() > 0)) return;
      // Recorded minus expected, over recorded (thesis, eq. 5.7).
      const double e_i = 100 * (1 - 1 / fit->intensity_ratio());
      series->x.push_back(index);
      series->y.push_back(e_i);
      series->notes.push_back(
          absl::StrCat(RecordingNote(view, index), "; e\u1d62 ", Number(e_i, 2), "\u202f%"));
    };
    add(fits.first, &before);
    add(fits.second, &after);
  }
  if (before.x.empty() && after.x.empty()) return "";
  XyChart chart;
  chart.width = 900;
  chart.height = 230;
  chart.x.title = "recording";
  chart.x.whole_numbers = true;
  chart.y.title = "e\u1d62 [%]";
  chart.marks = {0};
  chart.series = {before, after};
  return absl::StrCat(
      "<h3>Intensity error e<sub>i</sub></h3>\n",
      SoftParagraph("Recorded minus expected mean signal, over recorded (thesis, eq. 5.7)."),
      XyChartSvg(chart));
}

}  // namespace

std::string FitHtml(const DiagnosisView& view) {
  const std::string charts = ObservableChart(view) + RecordingChart(view) + IntensityChart(view);
  if (charts.empty()) return "";
  std::string words = "1 means that what is left is as large as noise and speckle make it.";
  const auto p_value = [](const v1::ModelFit& fit) {
    return EscapeHtml(PValueText(fit.p_value()));
  };
  if (view.diagnosis.null_fit().degrees_of_freedom() > 0) {
    absl::StrAppend(&words, " The nominal description, fitted again: \u03c7\u00b2/dof ",
                    PerDegreeText(view.diagnosis.null_fit().chi_squared(),
                                  view.diagnosis.null_fit().degrees_of_freedom()),
                    " (", p_value(view.diagnosis.null_fit()), ")");
    if (view.has_model && view.diagnosis.model_fit().degrees_of_freedom() > 0) {
      absl::StrAppend(&words, "; ", EscapeHtml(view.ModelName()), ": ",
                      PerDegreeText(view.diagnosis.model_fit().chi_squared(),
                                    view.diagnosis.model_fit().degrees_of_freedom()),
                      " (", p_value(view.diagnosis.model_fit()), ")");
    }
    words += ".";
  }
  std::vector<KeyEntry> key = {{"null", KeyShape::kDot, "nominal description, fitted again"}};
  if (view.has_model) key.push_back({"model", KeyShape::kDot, view.ModelName()});
  if (!view.held_out.empty())
    key.push_back({"usual", KeyShape::kBox, "recording not used in fitting"});
  return SoftParagraph(words) + ChartKey(key) + charts;
}

std::string DeviationsHtml(const DiagnosisView& view) {
  std::map<std::string, const v1::FittedDeviation*> after;
  if (view.has_model) {
    for (const v1::FittedDeviation& fitted : view.diagnosis.model_fit().deviations())
      after[fitted.name()] = &fitted;
  }
  RangeChart chart;
  chart.title = "Fitted deviations of the set-up over their stated uncertainties";
  chart.x.title =
      "true minus nominal, in units of the stated uncertainty; lines: \u00b1 2 standard errors";
  chart.lines = {-1, 0, 1};
  chart.shaded_low = -2;
  chart.shaded_high = 2;
  const auto add = [&](const v1::FittedDeviation& before, const v1::FittedDeviation* with_effect) {
    const double unit = before.standard_uncertainty();
    if (!(unit > 0)) return;
    RangeRow row;
    row.label = QuantityName(before.name());
    row.marks.push_back({"null", before.value() / unit, 2 * before.standard_error() / unit});
    const v1::FittedDeviation& last = with_effect != nullptr ? *with_effect : before;
    if (with_effect != nullptr) {
      row.marks.push_back(
          {"model", with_effect->value() / unit, 2 * with_effect->standard_error() / unit});
    }
    row.note = absl::StrCat(QuantityWithError(before.name(), last.value(), last.standard_error()),
                            " (stated \u00b1", SettingText(before.name(), unit), ")");
    chart.rows.push_back(std::move(row));
  };
  for (const v1::FittedDeviation& fitted : view.diagnosis.null_fit().deviations()) {
    const auto it = after.find(fitted.name());
    add(fitted, it == after.end() ? nullptr : it->second);
  }
  if (chart.rows.empty()) return "";
  std::vector<KeyEntry> key = {{"null", KeyShape::kDot, "nominal description, fitted again"}};
  if (view.has_model)
    key.push_back(
        {"model", KeyShape::kDot, absl::StrCat(view.ModelName(), " (values at the right)")});
  return absl::StrCat(
      SoftParagraph(
          "What is known of the set-up was fitted first, within its stated uncertainties: only "
          "what "
          "that cannot explain counts. Beyond the shaded range a value is hard to believe."),
      ChartKey(key), RangeChartSvg(chart));
}

}  // namespace sightline
