// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/fit_sections.h"

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/diagnosis/diagnosis_text.h"
#include "report/document/report_series.h"
#include "report/page/html.h"
#include "report/page/number_text.h"
#include "report/recordings/recording_text.h"

namespace sightline {
namespace {

constexpr char kNominal[] = "nominal description, fitted again";

v1::ReportSeries NominalDots(v1::ReportSeries::Mark mark) {
  return EmptySeries(kNominal, v1::REPORT_COLOUR_REFERENCE, mark);
}

v1::ReportSeries ModelDots(const DiagnosisView& view) {
  return EmptySeries(view.ModelName(), v1::REPORT_COLOUR_MODEL, v1::ReportSeries::DOTS);
}

// Adds those that have points.
void AddSeries(std::vector<v1::ReportSeries> all, v1::ReportChart* chart) {
  for (v1::ReportSeries& series : all) {
    if (!series.x().empty()) *chart->add_series() = std::move(series);
  }
}

// Adds a category at the end of the ordinate and returns its number.
int AddCategory(const std::string& name, const std::string& note, v1::ReportAxis* axis) {
  axis->add_categories(name);
  axis->add_category_notes(note);
  return axis->categories_size() - 1;
}

ReportBlocks ObservableChart(const DiagnosisView& view) {
  v1::ReportChart chart;
  chart.set_kind(v1::ReportChart::RANGES);
  chart.set_title("Chi squared per degree of freedom of every kind of observable");
  *chart.mutable_x() = AxisOf("\u03c7\u00b2 per degree of freedom", "", true);
  AddLineAtX(1, &chart);
  chart.set_joined(true);
  v1::ReportSeries nominal = NominalDots(v1::ReportSeries::DOTS), model = ModelDots(view);
  const auto add = [&](const std::string& label, std::optional<double> before,
                       std::optional<double> after, const std::string& note) {
    if (!before.has_value()) return;
    const bool both = view.has_model && after.has_value();
    const std::string text = both ? Change(Number(*before), Number(*after)) : Number(*before);
    const int category = AddCategory(
        label, note.empty() ? text : absl::StrCat(text, "  (", note, ")"), chart.mutable_y());
    AddPoint(*before, category, &nominal);
    if (both) AddPoint(*after, category, &model);
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
  if (chart.y().categories().empty()) return {};
  AddSeries({std::move(nominal), std::move(model)}, &chart);
  return {ChartBlock(std::move(chart))};
}

// Both fits, by recording.
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

ReportBlocks RecordingChart(const DiagnosisView& view) {
  v1::ReportChart chart;
  chart.set_kind(v1::ReportChart::BARS);
  chart.set_title("Recording by recording");
  *chart.mutable_x() = AxisOf("recording", "");
  *chart.mutable_y() = AxisOf("\u03c7\u00b2 per dof", "", true);
  AddLineAtY(1, &chart);
  v1::ReportSeries nominal = NominalDots(v1::ReportSeries::DOTS), model = ModelDots(view);
  for (const auto& [index, fits] : FitsByRecording(view)) {
    const auto value = [](const v1::RecordingFit* fit) {
      return fit == nullptr ? std::nullopt
                            : PerDegree(fit->chi_squared(), fit->degrees_of_freedom());
    };
    const std::optional<double> before = value(fits.first), after = value(fits.second);
    if (!before.has_value() && !after.has_value()) continue;
    const int category = chart.x().categories_size();
    chart.mutable_x()->add_categories(absl::StrCat(index));
    const std::string note = RecordingNote(view, index);
    if (before.has_value()) AddPoint(category, *before, note, &nominal);
    if (after.has_value()) AddPoint(category, *after, note, &model);
    if (view.held_out.count(index) == 0) continue;
    v1::ReportSpan& span = *chart.add_spans();
    span.set_low(category - 0.5);
    span.set_high(category + 0.5);
    span.set_name("recording not used in fitting");
  }
  if (chart.x().categories().empty()) return {};
  AddSeries({std::move(nominal), std::move(model)}, &chart);
  return {ChartBlock(std::move(chart))};
}

ReportBlocks IntensityChart(const DiagnosisView& view) {
  v1::ReportSeries before = NominalDots(v1::ReportSeries::HOLLOW_DOTS), after = ModelDots(view);
  for (const auto& [recording, fits] : FitsByRecording(view)) {
    const auto add = [&, index = recording](const v1::RecordingFit* fit, v1::ReportSeries* series) {
      if (fit == nullptr || !fit->has_intensity_ratio() || !(fit->intensity_ratio() > 0)) return;
      // Recorded minus expected, over recorded (thesis, eq. 5.7).
      AddPoint(index, 100 * (1 - 1 / fit->intensity_ratio()), RecordingNote(view, index), series);
    };
    add(fits.first, &before);
    add(fits.second, &after);
  }
  if (before.x().empty() && after.x().empty()) return {};
  v1::ReportChart chart;
  chart.set_title("Intensity error e\u1d62");
  chart.set_explanation("Recorded minus expected mean signal, over recorded (thesis, eq. 5.7).");
  *chart.mutable_x() = AxisOf("recording", "");
  chart.mutable_x()->set_whole_numbers(true);
  *chart.mutable_y() = AxisOf("e\u1d62", "%");
  AddLineAtY(0, &chart);
  AddSeries({std::move(before), std::move(after)}, &chart);
  return {ChartBlock(std::move(chart))};
}

std::string FitWords(const DiagnosisView& view) {
  std::string words = "1 means that what is left is as large as noise and speckle make it.";
  const v1::ModelFit &null = view.diagnosis.null_fit(), &model = view.diagnosis.model_fit();
  const auto outcome = [](const v1::ModelFit& fit) {
    return absl::StrCat(PerDegreeText(fit.chi_squared(), fit.degrees_of_freedom()), " (",
                        PValueText(fit.p_value()), ")");
  };
  if (null.degrees_of_freedom() <= 0) return words;
  absl::StrAppend(&words, " The nominal description, fitted again: \u03c7\u00b2/dof ",
                  outcome(null));
  if (view.has_model && model.degrees_of_freedom() > 0) {
    absl::StrAppend(&words, "; ", view.ModelName(), ": ", outcome(model));
  }
  return words + ".";
}

}  // namespace

ReportBlocks FitBlocks(const DiagnosisView& view) {
  ReportBlocks charts;
  for (ReportBlocks some : {ObservableChart(view), RecordingChart(view), IntensityChart(view)}) {
    for (v1::ReportBlock& chart : some) charts.push_back(std::move(chart));
  }
  if (charts.empty()) return {};
  return {RemarkBlock(FitWords(view)), GroupBlock(v1::ReportGroup::STACK, std::move(charts))};
}

ReportBlocks DeviationBlocks(const DiagnosisView& view) {
  std::map<std::string, const v1::FittedDeviation*> after;
  if (view.has_model) {
    for (const v1::FittedDeviation& fitted : view.diagnosis.model_fit().deviations())
      after[fitted.name()] = &fitted;
  }
  v1::ReportChart chart;
  chart.set_kind(v1::ReportChart::RANGES);
  chart.set_title("Fitted deviations of the set-up");
  *chart.mutable_x() = AxisOf("true minus nominal, in units of the stated uncertainty", "");
  for (const double at : {-1, 0, 1}) AddLineAtX(at, &chart);
  v1::ReportSpan& believed = *chart.add_spans();
  believed.set_low(-2);
  believed.set_high(2);
  believed.set_name("easily believed");
  v1::ReportSeries nominal = NominalDots(v1::ReportSeries::DOTS), model = ModelDots(view);
  const auto add_to = [](v1::ReportSeries* series, int category, const v1::FittedDeviation& of,
                         double unit) {
    AddPoint(of.value() / unit, category, series);
    series->add_low((of.value() - 2 * of.standard_error()) / unit);
    series->add_high((of.value() + 2 * of.standard_error()) / unit);
  };
  for (const v1::FittedDeviation& fitted : view.diagnosis.null_fit().deviations()) {
    const double unit = fitted.standard_uncertainty();
    if (!(unit > 0)) continue;
    const auto it = after.find(fitted.name());
    const v1::FittedDeviation& last = it == after.end() ? fitted : *it->second;
    const int category = AddCategory(
        QuantityName(fitted.name()),
        absl::StrCat(QuantityWithError(fitted.name(), last.value(), last.standard_error()),
                     " (stated \u00b1", SettingText(fitted.name(), unit), ")"),
        chart.mutable_y());
    add_to(&nominal, category, fitted, unit);
    if (it != after.end()) add_to(&model, category, *it->second, unit);
  }
  if (chart.y().categories().empty()) return {};
  AddSeries({std::move(nominal), std::move(model)}, &chart);
  return {RemarkBlock(
              "The set-up was fitted first, within its stated uncertainties: only what that cannot "
              "explain counts. Beyond the shaded range a value is hard to believe. Lines: \u00b1 2 "
              "standard errors. At the right: the last fit's values."),
          ChartBlock(std::move(chart))};
}

}  // namespace sightline
