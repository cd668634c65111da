// SPDX-License-Identifier: Apache-2.0
#include "report/sensor/sensor_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "report/document/report_page.h"
#include "report/document/report_parts.h"
#include "report/page/number_text.h"
#include "report/sensor/sensor_charts.h"
#include "report/sensor/sensor_view.h"

namespace sightline {
namespace {

// Titles of a camera file's values whose names are not clear enough.
std::string SensorQuantityTitle(const std::string& name) {
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

std::string WithUnit(const std::string& number, const std::string& unit) {
  return unit.empty() ? number : absl::StrCat(number, "\u202f", unit);
}

// The number with as many digits as its interval justifies.
std::string NumberOfInterval(double value, double lower, double upper) {
  const double error = 0.25 * (upper - lower);
  if (!(error > 0) || !std::isfinite(error) || !std::isfinite(value) || value == 0) {
    return Number(value, 4);
  }
  const double digits = std::floor(std::log10(std::abs(value))) - std::floor(std::log10(error)) + 2;
  return Number(value, static_cast<int>(std::clamp(digits, 1.0, 8.0)));
}

std::string SensorParameterText(const v1::SensorParameter& parameter) {
  const SensorUnit unit = SensorUnitOf(parameter.name(), parameter.unit());
  // Without a name no unit is added: the message contains it.
  return WithUnit(QuantityWithError("", unit.per_named * parameter.value(),
                                    unit.per_named * parameter.standard_error()),
                  unit.name);
}

v1::ReportCell PerNumberCell(double chi_squared, int numbers) {
  if (numbers <= 0) return TextCell(kNoValue);
  return NumberCell(chi_squared / numbers, Number(chi_squared / numbers));
}

std::string PerNumberText(double chi_squared, int numbers) {
  return PerNumberCell(chi_squared, numbers).text();
}

v1::ReportCell MostProbabilityCell(const v1::SensorDeparture& departure) {
  if (!departure.has_probability()) return TextCell(kNoValue);
  return ShareCell(departure.probability(), ProbabilityText(departure.probability()));
}

v1::ReportCell PValueCell(double p_value) { return NumberCell(p_value, PValueText(p_value)); }

std::string SensorHeading(const SensorView& view) {
  if (!view.diagnosis.finding().empty()) return view.diagnosis.finding();
  return view.found.empty() ? "These images agree with the linear model of EMVA 1288."
                            : "These images show what the linear model of EMVA 1288 leaves out.";
}

void AddSensorFinding(const SensorView& view, v1::Report* report) {
  if (view.diagnosis.departures().empty()) return;
  const size_t count = view.found.size();
  std::string rest;
  if (count == 0) {
    rest = "No departure from the linear model of EMVA 1288 was found";
  } else {
    *report->add_finding() =
        StrongRun(absl::StrCat(count, count == 1 ? " departure" : " departures"));
    rest = absl::StrCat(" from the linear model of EMVA 1288 ",
                        count == 1 ? "was found" : "were found");
  }
  const size_t tested = count + view.absent.size();
  if (tested > 0) absl::StrAppend(&rest, ", of ", tested, " that these images can show");
  rest += ".";
  if (!view.not_testable.empty()) {
    absl::StrAppend(&rest, " ", view.not_testable.size(), " more would need other recordings.");
  }
  *report->add_finding() = PlainRun(rest);
}

void AddSensorFigures(const SensorView& view, v1::Report* report) {
  const v1::SensorDiagnosis& d = view.diagnosis;
  if (!d.verdict().empty()) *report->add_figures() = TextFact("verdict", d.verdict());
  const v1::SensorFit &linear = d.linear_fit(), &model = d.model_fit();
  const auto add = [&](const char* name, double before, int before_numbers, double after,
                       int after_numbers) {
    if (before_numbers <= 0) return;
    const std::string text = PerNumberText(before, before_numbers);
    *report->add_figures() =
        view.has_model
            ? TextFact(name, absl::StrCat(text, " \u2192 ", PerNumberText(after, after_numbers)))
            : NumberFact(name, before / before_numbers, "", text);
  };
  add("\u03c7\u00b2 per degree of freedom", linear.chi_squared(), linear.degrees_of_freedom(),
      model.chi_squared(), model.degrees_of_freedom());
  add("of steps predicted from the others", linear.held_out_chi_squared(),
      linear.held_out_numbers(), model.held_out_chi_squared(), model.held_out_numbers());
  if (d.photon_transfer().empty()) return;
  *report->add_figures() = NumberFact(
      "steps with light", d.photon_transfer_size(), "", absl::StrCat(d.photon_transfer_size()),
      view.saturated.empty() ? "" : absl::StrCat(view.saturated.size(), " saturated"));
}

ReportBlocks FoundBlocks(const SensorView& view) {
  if (view.found.empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::SensorDeparture* departure : view.found) {
    std::vector<std::string> sizes;
    for (const v1::SensorParameter& parameter : departure->parameters()) {
      sizes.push_back(
          absl::StrCat(QuantityName(parameter.name()), " ", SensorParameterText(parameter)));
    }
    v1::ReportCell size = TextCell(absl::StrJoin(sizes, "\n"));
    if (departure->parameters_size() == 1) {
      const v1::SensorParameter& only = departure->parameters(0);
      const SensorUnit unit = SensorUnitOf(only.name(), only.unit());
      size = NumberCell(unit.per_named * only.value(), size.text(), unit.name);
    }
    rows.push_back({StrongCell(EffectTitle(departure->effect()), departure->description()),
                    TextCell(departure->stage()), std::move(size), PValueCell(departure->p_value()),
                    MostProbabilityCell(*departure)});
  }
  return {TableBlock("Departures from the linear model",
                     {WordsColumn("departure"), WordsColumn("arises in"), WordsColumn("size"),
                      NumberColumn("chance"), ShareColumn("probability, at most")},
                     rows),
          RemarkBlock(
              "In the order of the signal: light and response, patterns, changes from frame to "
              "frame. After \u00b1: the standard error. Chance: the probability p of so clear a "
              "sign if the departure were not there, times the number of tests made. Probability: "
              "the largest that this chance is compatible with, if 70\u202f% of cameras have one "
              "of the departures looked for.")};
}

ReportCells QuantityRow(const v1::SensorQuantity& q) {
  const SensorUnit unit = SensorUnitOf(q.name(), q.unit());
  const double k = unit.per_named;
  const auto value = [&](bool given, double number, double lower, double upper) {
    if (!given) return TextCell(kNoValue);
    return NumberCell(k * number,
                      WithUnit(NumberOfInterval(k * number, k * lower, k * upper), unit.name),
                      unit.name);
  };
  const auto interval = [&](bool given, double lower, double upper) {
    // Without a name no unit is added.
    return TextCell(given ? QuantityInterval("", k * lower, k * upper) : kNoValue);
  };
  std::vector<std::string> remarks;
  if (!q.clause().empty()) remarks.push_back(absl::StrCat("EMVA 1288: ", q.clause()));
  if (!q.note().empty()) remarks.push_back(q.note());
  v1::ReportCell fitted = value(q.has_value(), q.value(), q.lower(), q.upper());
  fitted.set_strong(true);
  return {StrongCell(SensorQuantityTitle(q.name()), q.name()),
          std::move(fitted),
          interval(q.has_lower() && q.has_upper(), q.lower(), q.upper()),
          value(q.has_emva_value(), q.emva_value(), q.emva_lower(), q.emva_upper()),
          interval(q.has_emva_lower() && q.has_emva_upper(), q.emva_lower(), q.emva_upper()),
          TextCell(absl::StrJoin(remarks, "\n"))};
}

ReportBlocks QuantityBlocks(const v1::SensorDiagnosis& diagnosis) {
  if (diagnosis.quantities().empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::SensorQuantity& q : diagnosis.quantities()) rows.push_back(QuantityRow(q));
  std::vector<v1::ReportColumn> columns = {WordsColumn("quantity"),
                                           NumberColumn("value"),
                                           NumberColumn("95\u202f% interval"),
                                           NumberColumn("value"),
                                           NumberColumn("95\u202f% interval"),
                                           WordsColumn("remarks")};
  columns[1].set_group("Fitted");
  columns[2].set_group("Fitted");
  columns[3].set_group("By EMVA 1288, release 4.0");
  columns[4].set_group("By EMVA 1288, release 4.0");
  return {
      TableBlock("Quantities of the camera", columns, rows),
      RemarkBlock("Fitted: to all steps at once, with the departures found. By EMVA 1288: as the "
                  "standard defines it, for comparison with data sheets.")};
}

ReportBlocks SensorFitBlocks(const SensorView& view) {
  std::vector<ReportCells> rows;
  const auto add = [&](const char* title, const v1::SensorFit& fit, bool reference) {
    const double gain = fit.held_out_log_score_gain();
    if (fit.degrees_of_freedom() <= 0 && fit.parameters().empty()) return;
    std::vector<std::string> parameters;
    for (const v1::SensorParameter& parameter : fit.parameters()) {
      parameters.push_back(
          absl::StrCat(SensorQuantityTitle(parameter.name()), " ", SensorParameterText(parameter)));
    }
    rows.push_back({StrongCell(title), PerNumberCell(fit.chi_squared(), fit.degrees_of_freedom()),
                    CountCell(fit.degrees_of_freedom()),
                    PerNumberCell(fit.held_out_chi_squared(), fit.held_out_numbers()),
                    reference || fit.held_out_numbers() <= 0
                        ? TextCell(kNoValue)
                        : NumberCell(gain, FixedNumber(gain, std::abs(gain) < 10 ? 1 : 0)),
                    TextCell(absl::StrJoin(parameters, "\n"))});
  };
  add("Linear model", view.diagnosis.linear_fit(), true);
  if (view.has_model) add("With the departures found", view.diagnosis.model_fit(), false);
  if (rows.empty()) return {};
  return {
      RemarkBlock(
          "Means and variances of all steps below saturation. 1 means that what is left over "
          "is as large as noise makes it."),
      TableBlock("Fits of both models",
                 {WordsColumn("model"), NumberColumn("\u03c7\u00b2 per degree of freedom"),
                  NumberColumn("degrees of freedom"),
                  NumberColumn("\u03c7\u00b2 per number of steps predicted from the others"),
                  NumberColumn("gain in log score of these", "nats"), WordsColumn("fitted values")},
                 rows)};
}

// Effects that were not found interest few readers, so they are folded away.
ReportBlocks OtherBlocks(const SensorView& view) {
  ReportBlocks blocks;
  if (!view.absent.empty()) {
    std::vector<ReportCells> rows;
    for (const v1::SensorDeparture* departure : view.absent) {
      rows.push_back({StrongCell(EffectTitle(departure->effect()), departure->description()),
                      TextCell(departure->stage()), PValueCell(departure->p_value()),
                      MostProbabilityCell(*departure)});
    }
    const std::string title = absl::StrCat("Looked for and not found: ", view.absent.size());
    blocks.push_back(FoldedBlock(
        title, {TableBlock(title,
                           {WordsColumn("departure"), WordsColumn("would arise in"),
                            NumberColumn("chance"), ShareColumn("probability, at most")},
                           rows)}));
  }
  if (!view.not_testable.empty()) {
    std::vector<ReportCells> rows;
    for (const v1::SensorDeparture* departure : view.not_testable) {
      rows.push_back({StrongCell(EffectTitle(departure->effect())), TextCell(departure->stage()),
                      TextCell(departure->description())});
    }
    const std::string title = absl::StrCat("These images cannot show: ", view.not_testable.size());
    blocks.push_back(
        FoldedBlock(title, {TableBlock(title,
                                       {WordsColumn("departure"), WordsColumn("would arise in"),
                                        WordsColumn("what it needs")},
                                       rows)}));
  }
  return blocks;
}

absl::Status CheckCurves(const v1::SensorDiagnosis& diagnosis) {
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

absl::StatusOr<v1::Report> SensorReport(const v1::SensorDiagnosis& diagnosis) {
  SIGHTLINE_RETURN_IF_ERROR(CheckCurves(diagnosis));
  const SensorView view(diagnosis);
  const std::string set = diagnosis.set().empty() ? "Camera" : diagnosis.set();
  v1::Report report;
  report.set_title(absl::StrCat(set, " \u2013 diagnosis of the camera"));
  report.set_kind("sensor_diagnosis");
  report.set_subject(absl::StrCat("Sightline \u00b7 flat-field and dark frames of ", set));
  report.set_heading(SensorHeading(view));
  AddSensorFinding(view, &report);
  AddSensorFigures(view, &report);
  *report.mutable_warnings() = diagnosis.warnings();
  AddSection(&report, "departures", "What the linear model leaves out", FoundBlocks(view));
  AddSection(&report, "photon-transfer", "Signal and noise against the linear model",
             PhotonTransferBlocks(view));
  AddSection(&report, "quantities", "The camera", QuantityBlocks(diagnosis));
  AddSection(&report, "curves", "Where it shows", SensorCurveBlocks(diagnosis));
  AddSection(&report, "fit", "How well the models fit", SensorFitBlocks(view));
  AddSection(&report, "others", "What else was looked for", OtherBlocks(view));
  return report;
}

absl::Status WriteSensorReport(const v1::SensorDiagnosis& diagnosis, const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(const v1::Report report, SensorReport(diagnosis));
  return WriteReport(report, path);
}

}  // namespace sightline
