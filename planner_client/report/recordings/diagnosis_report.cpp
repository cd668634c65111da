#include "planner_client/report/recordings/diagnosis_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/json/strict_json.h"
#include "planner_client/report/charts/range_chart.h"
#include "planner_client/report/charts/recording_bars.h"
#include "planner_client/report/charts/region_map_picture.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/recordings/line_range.h"
#include "planner_client/report/recordings/predictive_check.h"
#include "planner_client/report/recordings/raw_picture.h"
#include "planner_client/report/recordings/recording_text.h"

namespace sightline {
namespace {

// Pictures of the most telling recordings; more would hide the finding.
constexpr int kMaxProfiles = 6;
constexpr int kMaxRegionMaps = 4;

std::string Code(const std::string& text) {
  return absl::StrCat("<code>", EscapeHtml(text), "</code>");
}

std::string Soft(const std::string& text) {
  return absl::StrCat("<p class=\"soft\">", text, "</p>\n");
}

// Names of the vocabulary as words: "line_flanks" -> "line flanks".
std::string Words(const google::protobuf::RepeatedPtrField<std::string>& names) {
  std::vector<std::string> words;
  for (const std::string& name : names) {
    // What is said in words stays as it is.
    words.push_back(name.find(' ') == std::string::npos ? QuantityName(name) : name);
  }
  return absl::StrJoin(words, ", ");
}

// Chi squared per degree of freedom; nothing to say without any.
std::optional<double> PerDegree(double chi_squared, int degrees_of_freedom) {
  if (degrees_of_freedom <= 0) return std::nullopt;
  return chi_squared / degrees_of_freedom;
}

std::string PerDegreeText(double chi_squared, int degrees_of_freedom) {
  const std::optional<double> value = PerDegree(chi_squared, degrees_of_freedom);
  return value.has_value() ? Number(*value) : "\u2013";
}

// "before -> after", as HTML.
std::string Change(const std::string& before, const std::string& after) {
  return absl::StrCat(before, " \u2192 ", after);
}

std::string GainText(double nats) { return FixedNumber(nats, std::abs(nats) < 10 ? 1 : 0); }

// "proportional to exposure_time_s^1 f_number^-2 (0.1 at exposure_time_s 0.02)" with exponents
// raised and values with their units, as HTML.
std::string LawHtml(const std::string& law) {
  const std::vector<std::string> given = absl::StrSplit(law, ' ', absl::SkipEmpty());
  std::vector<std::string> words;
  for (size_t i = 0; i < given.size(); ++i) {
    const std::pair<std::string, std::string> power =
        absl::StrSplit(given[i], absl::MaxSplits('^', 1));
    std::string name = QuantityName(power.first);
    double value = 0;
    const size_t digits = i + 1 < given.size() ? given[i + 1].find_last_not_of(",;)") + 1 : 0;
    if (!power.second.empty()) {
      // Powers side by side are multiplied.
      const bool follows_power = !words.empty() && absl::StartsWith(words.back(), "<em>");
      words.push_back(absl::StrCat("<em>", follows_power ? "\u00b7 " : "", EscapeHtml(name)));
      if (power.second != "1") {
        absl::StrAppend(&words.back(), "<sup>",
                        EscapeHtml(absl::StrReplaceAll(power.second, {{"-", "\u2212"}})), "</sup>");
      }
      words.back() += "</em>";
    } else if (power.first.find('_') != std::string::npos && digits > 0 &&
               absl::SimpleAtod(given[i + 1].substr(0, digits), &value)) {
      ++i;
      words.push_back(EscapeHtml(
          absl::StrCat(name, " ", SettingText(power.first, value), given[i].substr(digits))));
    } else {
      words.push_back(EscapeHtml(name));
    }
  }
  return absl::StrJoin(words, " ");
}

class Report {
 public:
  Report(const v1::Diagnosis& diagnosis, const std::string& set_folder)
      : d_(diagnosis), set_folder_(set_folder) {
    const std::string first = d_.ranked().empty() ? "" : d_.ranked(0).effect();
    has_model_ = d_.ranked().empty() ? d_.verdict() == "effect" : first != "none";
    for (const int32_t recording : d_.held_out_improvement().recordings())
      held_out_.insert(recording);
    for (const v1::ModelFit* fit : {&d_.null_fit(), &d_.model_fit()}) {
      for (const v1::RecordingFit& recording : fit->recordings()) {
        if (recording.held_out()) held_out_.insert(recording.recording());
      }
    }
    // Of parts: tiles of every recording are held out, none as a whole. Of plates: every recording
    // is held out in its turn.
    of_part_ = d_.calibrated().format_version() == 2;
    if (of_part_ || static_cast<int>(held_out_.size()) >= d_.model_fit().recordings_size()) {
      held_out_.clear();
    }
  }

  std::string Html() const {
    const std::string set = d_.set().empty() ? "Recordings" : d_.set();
    StaticPage page;
    page.title = absl::StrCat(set, " \u2013 diagnosis");
    page.kicker = absl::StrCat("Sightline \u00b7 diagnosis of ", set);
    page.heading = Heading();
    page.finding_html = VerdictSentence();
    page.figures = Figures();
    page.warnings.assign(d_.warnings().begin(), d_.warnings().end());
    if (Interrupted()) {
      page.warnings.insert(
          page.warnings.begin(),
          "The diagnosis was interrupted: probabilities and values are of what was "
          "compared until then. What was not compared may explain more.");
    }
    const char* picture = has_model_ ? "The picture that shows it" : "Recorded and expected";
    page.sections_html =
        PageSection("profiles", picture, Profiles()) +
        PageSection("maps", of_part_ ? picture : "Where in the image", RegionMaps()) +
        PageSection("explanations", "What explains it, and what does not", Explanations()) +
        PageSection("next", "What to record next", NextRecordings()) +
        PageSection("fit", "How well the model fits", Fit()) +
        PageSection("prediction", "Does it predict?", PredictiveCheckHtml(d_, NamedModel())) +
        PageSection("setup", "The set-up, fitted again", Deviations()) +
        PageSection("stages", "Where in the chain", Stages()) +
        PageSection("laws", "What it grows with", Laws()) +
        PageSection("free-form", "The missing term", FreeForm()) +
        PageSection("power", "What these recordings could have shown", Power()) +
        PageSection("provenance", "How to get this again", Provenance());
    return StaticPageHtml(page);
  }

 private:
  bool Interrupted() const { return d_.verdict() == "interrupted"; }

  const v1::Recording* RecordingAt(int index) const {
    return index >= 0 && index < d_.calibrated().recordings_size()
               ? &d_.calibrated().recordings(index)
               : nullptr;
  }

  // Title and setup of a recording, as HTML.
  std::string Caption(int index, const std::string& title_suffix = "") const {
    const v1::Recording* recording = RecordingAt(index);
    const std::string setup = recording == nullptr ? "" : RecordingSetup(*recording);
    return absl::StrCat(
        "<h3>", EscapeHtml(RecordingTitle(index, recording) + title_suffix),
        held_out_.count(index) > 0 ? "<span class=\"badge\">not used in fitting</span>" : "",
        "</h3>\n", setup.empty() ? "" : Soft(EscapeHtml(setup)));
  }

  // The model with something added, in words.
  std::string ModelName() const {
    if (d_.ranked().empty() || d_.ranked(0).effect() == "unknown") return "with the missing term";
    return absl::StrCat("with ", ExplanationTitle(d_.ranked(0)));
  }

  // The most probable model with a name, which stands in `named_check`; empty: the null model.
  std::string NamedModel() const {
    if (!d_.part_of_it().empty()) {
      std::vector<std::string> names;
      for (const v1::FittedEffect& effect : d_.part_of_it()) {
        names.push_back(EffectTitle(effect.effect()));
      }
      return absl::StrJoin(names, " + ");
    }
    for (const v1::Explanation& explanation : d_.ranked()) {
      if (explanation.effect() == "none") return "";
      if (explanation.effect() != "unknown" && !explanation.effects().empty())
        return ExplanationTitle(explanation);
    }
    return "";
  }

  static std::string ExplanationTitle(const v1::Explanation& explanation) {
    std::vector<std::string> titles;
    for (const v1::FittedEffect& effect : explanation.effects()) {
      titles.push_back(EffectTitle(effect.effect()));
    }
    if (titles.empty()) return EffectTitle(explanation.effect());
    const std::string joined = absl::StrJoin(titles, " + ");
    return explanation.effect() == "unknown"
               ? absl::StrCat(EffectTitle("unknown"), " (", joined, ")")
               : joined;
  }

  std::string Heading() const {
    if (!d_.finding().empty()) return d_.finding();
    if (!has_model_) return "The recordings agree with the nominal description.";
    return d_.ranked().empty() ? "The recordings differ from the nominal description."
                               : absl::StrCat(ExplanationTitle(d_.ranked(0)), ".");
  }

  std::string VerdictSentence() const {
    if (Interrupted()) {
      return "<strong>Interrupted: this is no finding.</strong> What follows is of what was fitted "
             "until then.";
    }
    if (d_.ranked().empty()) return "";
    const v1::Explanation& first = d_.ranked(0);
    std::string html = absl::StrCat("<strong>", EscapeHtml(ExplanationTitle(first)),
                                    "</strong>, with a probability of ",
                                    EscapeHtml(ProbabilityText(first.probability())), ".");
    std::vector<std::string> regions, depends_on;
    for (const v1::FittedEffect& effect : first.effects()) {
      if (!effect.regions().empty()) regions.push_back(Words(effect.regions()));
      if (!effect.depends_on().empty()) depends_on.push_back(Words(effect.depends_on()));
    }
    if (!regions.empty()) {
      absl::StrAppend(&html, " It shows in: ", EscapeHtml(absl::StrJoin(regions, "; ")), ".");
    }
    if (!depends_on.empty()) {
      absl::StrAppend(&html, " It depends on: ", EscapeHtml(absl::StrJoin(depends_on, "; ")), ".");
    }
    return html;
  }

  std::vector<std::pair<std::string, std::string>> Figures() const {
    std::vector<std::pair<std::string, std::string>> figures;
    if (!d_.verdict().empty()) {
      std::string value = d_.verdict() == "none" ? "none" : EscapeHtml(d_.verdict());
      for (const v1::Explanation& explanation : d_.ranked()) {
        if (explanation.effect() != "none" || Interrupted()) continue;
        const double probability =
            d_.verdict() == "none" ? explanation.probability() : 1 - explanation.probability();
        absl::StrAppend(&value, " <small>", EscapeHtml(ProbabilityText(probability)), "</small>");
      }
      figures.push_back({"verdict", value});
    }
    if (d_.has_held_out_improvement()) {
      const v1::HeldOutImprovement& held_out = d_.held_out_improvement();
      figures.push_back({"held-out \u03c7\u00b2/dof",
                         has_model_
                             ? Change(Number(held_out.null()), Number(held_out.with_effect()))
                             : Number(held_out.null())});
    }
    if (d_.has_model_fit() && d_.model_fit().degrees_of_freedom() > 0) {
      figures.push_back({of_part_ ? "fit of held-out tiles" : "fit of all recordings",
                         EscapeHtml(PValueText(d_.model_fit().p_value()))});
    }
    const int recordings =
        of_part_ ? d_.calibrated().recordings_size()
                 : std::max({d_.calibrated().recordings_size(), d_.null_fit().recordings_size(),
                             d_.model_fit().recordings_size()});
    if (recordings > 0) {
      figures.push_back(
          {"recordings",
           absl::StrCat(recordings, held_out_.empty() ? ""
                                                      : absl::StrCat(" <small>", held_out_.size(),
                                                                     " held out</small>"))});
    }
    return figures;
  }

  // Halos, offsets and background are a few DN beside a line of hundreds: the residual tells
  // whether faint parts matter.
  static bool NeedsLogarithm(const v1::ProfileComparison& profile) {
    const double peak =
        *std::max_element(profile.observed_dn().begin(), profile.observed_dn().end());
    double all = 0, faint = 0;
    for (int i = 0; i < profile.row_px_size(); ++i) {
      const double sigma =
          profile.standard_deviation_dn_size() > 0 ? profile.standard_deviation_dn(i) : 1;
      const double z = (profile.observed_dn(i) - profile.null_dn(i)) / sigma;
      if (!std::isfinite(z)) continue;
      all += z * z;
      if (profile.observed_dn(i) < 0.15 * peak) faint += z * z;
    }
    return peak > 0 && faint > 0.5 * all;
  }

  std::string ProfileCard(const v1::ProfileComparison& profile) const {
    const std::vector<double> rows(profile.row_px().begin(), profile.row_px().end());
    const std::vector<double> observed(profile.observed_dn().begin(), profile.observed_dn().end());
    const std::vector<double> sigma(profile.standard_deviation_dn().begin(),
                                    profile.standard_deviation_dn().end());
    XyChart signal, residual;
    signal.height = 240;
    signal.hide_x_labels = true;
    signal.y.title = "mean over the line [DN]";
    if (NeedsLogarithm(profile)) {
      signal.y.logarithmic = true;
      signal.y.title += ", log";
      // Rows of noise about 0 shall not take the axis.
      double lowest = INFINITY;
      for (const double value : profile.null_dn()) {
        if (value > 0) lowest = std::min(lowest, value);
      }
      const double peak = *std::max_element(observed.begin(), observed.end());
      signal.y.low = std::clamp(0.5 * lowest, 1e-4 * peak, 0.1 * peak);
    }
    // Where the line itself is what differs, it is shown larger.
    if (!signal.y.logarithmic) {
      const auto [first, last] = LineRange(rows, observed);
      if (std::isfinite(first) && first < last) {
        signal.x.low = residual.x.low = first;
        signal.x.high = residual.x.high = last;
      }
    }
    ChartSeries data{"observed", SeriesMark::kDots, rows, observed, {}, {}};
    for (const double s : sigma) data.half_band.push_back(2 * s);
    signal.series.push_back(data);

    residual.height = 180;
    residual.x.title = "row [px]";
    residual.y.title = "residual [\u03c3]";
    residual.marks = {-2, 0, 2};
    const auto add = [&](const auto& values, const char* css_class, SeriesMark mark) {
      if (values.empty()) return;
      const std::vector<double> expected(values.begin(), values.end());
      signal.series.push_back({css_class, mark, rows, expected, {}, {}});
      if (sigma.empty()) return;
      ChartSeries z{css_class, mark, rows, {}, {}, {}};
      for (size_t i = 0; i < rows.size(); ++i)
        z.y.push_back((observed[i] - expected[i]) / sigma[i]);
      residual.series.push_back(std::move(z));
    };
    add(profile.null_dn(), "null", SeriesMark::kDashedLine);
    if (has_model_) add(profile.model_dn(), "model", SeriesMark::kLine);
    const std::string channel =
        profile.channel().empty() || profile.channel() == "mono" ? "" : ", " + profile.channel();
    return absl::StrCat("<div class=\"card\">", Caption(profile.recording(), channel),
                        XyChartSvg(signal), residual.series.empty() ? "" : XyChartSvg(residual),
                        "</div>\n");
  }

  std::string Profiles() const {
    std::string cards;
    int count = 0, shown = 0;
    for (const v1::ProfileComparison& profile : d_.profiles()) {
      if (profile.row_px().empty()) continue;
      ++count;
      if (shown == kMaxProfiles) continue;
      cards += ProfileCard(profile);
      ++shown;
    }
    if (shown == 0) return "";
    std::vector<KeyEntry> key = {
        {"observed", KeyShape::kDot, "observed"},
        {"observed", KeyShape::kBand, "\u00b1 2\u03c3 of the observation"},
        {"null", KeyShape::kDashedLine, "nominal description, fitted again"}};
    if (has_model_) key.push_back({"model", KeyShape::kLine, ModelName()});
    return absl::StrCat(
        Soft(absl::StrCat(
            "Mean profile across the line; below it what is left, in standard deviations. ",
            has_model_ ? "The recordings that tell most" : "The recordings that differ most",
            count > shown ? absl::StrCat(", ", shown, " of ", count, ".") : ".")),
        ChartKey(key), "<div class=\"cards\">\n", cards, "</div>\n");
  }

  std::string RegionMaps() const {
    std::string cards;
    int count = 0, shown = 0;
    for (const v1::RegionMap& map : d_.region_maps()) {
      if (map.rows() == 0 || map.columns() == 0) continue;
      ++count;
      if (shown == kMaxRegionMaps) continue;
      ++shown;
      const auto pane = [&](const google::protobuf::RepeatedField<float>& z, const char* what) {
        if (z.empty()) return std::string();
        RegionMapGrid grid;
        grid.rows = map.rows();
        grid.columns = map.columns();
        grid.row_edges_px.assign(map.row_edges_px().begin(), map.row_edges_px().end());
        grid.column_edges_px.assign(map.column_edges_px().begin(), map.column_edges_px().end());
        grid.z.assign(z.begin(), z.end());
        double squares = 0;
        int finite = 0;
        for (const float value : z) {
          if (!std::isfinite(value)) continue;
          squares += static_cast<double>(value) * value;
          ++finite;
        }
        const std::string title =
            absl::StrCat("Standardised residuals of recording ", map.recording(), ", ", what);
        return absl::StrCat(
            "<figure><figcaption>", what,
            finite > 0 ? absl::StrCat(", rms ", Number(std::sqrt(squares / finite), 2)) : "",
            "</figcaption>", RegionMapSvg(grid, title), "</figure>\n");
      };
      std::string picture;
      if (const v1::Recording* recording = RecordingAt(map.recording()); recording != nullptr) {
        const std::string png = RawPicturePng(set_folder_, recording->file());
        if (!png.empty()) {
          picture = absl::StrCat(
              "<figure><figcaption>recorded, square root of the signal</figcaption><img alt=\"",
              "Recording ", map.recording(), "\" src=\"", PngDataUri(png), "\"></figure>\n");
        }
      }
      absl::StrAppend(&cards, "<div class=\"card map-card\">", Caption(map.recording()),
                      "<div class=\"panes\">\n", of_part_ ? picture : "",
                      pane(map.null_z(), has_model_ ? "before" : "residual"),
                      has_model_ ? pane(map.model_z(), "after") : "", of_part_ ? "" : picture,
                      "</div></div>\n");
    }
    if (shown == 0) return "";
    return absl::StrCat(
        Soft(absl::StrCat("Standardised residuals over the image: orange where more light was "
                          "recorded than expected, blue where less, pale where it is chance.",
                          count > shown ? absl::StrCat(" ", shown, " of ", count, ".") : "")),
        RegionMapKeySvg(), "<div class=\"cards one\">\n", cards, "</div>\n");
  }

  static std::string ProbabilityBar(double probability) {
    const double cut = std::isfinite(probability) ? std::clamp(probability, 0.0, 1.0) : 0;
    return absl::StrFormat(
        "<span class=\"nowrap\"><svg class=\"probability\" viewBox=\"0 0 110 10\" "
        "aria-hidden=\"true\"><rect "
        "class=\"rail\" "
        "x=\"0\" y=\"4\" width=\"110\" height=\"2\"/><rect class=\"bar\" x=\"0\" y=\"0\" "
        "width=\"%.1f\" "
        "height=\"10\"/></svg>%s</span>",
        110 * cut, EscapeHtml(ProbabilityText(probability)));
  }

  static std::string ParameterText(const v1::FittedParameter& parameter) {
    std::string html = absl::StrCat(EscapeHtml(QuantityName(parameter.name())), " ");
    if (!parameter.has_standard_error() && !(parameter.lower() < parameter.upper())) {
      return absl::StrCat(html, "<span class=\"soft\">not determined by these recordings</span>");
    }
    std::optional<double> error;
    if (parameter.has_standard_error()) error = parameter.standard_error();
    absl::StrAppend(&html, "<strong>",
                    EscapeHtml(QuantityWithError(parameter.name(), parameter.value(), error)),
                    "</strong>");
    if (parameter.lower() < parameter.upper()) {
      absl::StrAppend(
          &html, " <span class=\"soft nowrap\">(", error.has_value() ? "95\u202f%: " : "",
          EscapeHtml(QuantityInterval(parameter.name(), parameter.lower(), parameter.upper())),
          ")</span>");
    }
    return html;
  }

  std::string Explanations() const {
    if (d_.ranked().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    double sum = 0;
    for (const v1::Explanation& explanation : d_.ranked()) {
      sum += explanation.probability();
      const bool named = explanation.effect() != "none" && explanation.effect() != "unknown";
      std::vector<std::string> ids, stages, parameters;
      for (const v1::FittedEffect& effect : explanation.effects()) {
        ids.push_back(Code(effect.effect()));
        for (const v1::FittedParameter& parameter : effect.parameters()) {
          parameters.push_back(absl::StrCat(
              "<span class=\"parameter\">",
              explanation.effects_size() > 1 ? EscapeHtml(EffectTitle(effect.effect())) + ": " : "",
              ParameterText(parameter), "</span>"));
        }
      }
      if (ids.empty() && named) ids.push_back(Code(explanation.effect()));
      std::string name = absl::StrCat("<span class=\"effect\">",
                                      EscapeHtml(ExplanationTitle(explanation)), "</span>");
      std::string detail = absl::StrJoin(ids, " + ");
      if (!explanation.stage().empty() && explanation.stage() != "none") {
        absl::StrAppend(&detail, detail.empty() ? "" : ", ", "stage ",
                        EscapeHtml(explanation.stage()));
      }
      if (!detail.empty()) absl::StrAppend(&name, "<span class=\"detail\">", detail, "</span>");
      const double chi = explanation.held_out_chi_squared_per_dof();
      std::string last = absl::StrJoin(parameters, "<br>");
      if (!explanation.reason().empty()) {
        absl::StrAppend(&last, "<span class=\"detail\">", EscapeHtml(explanation.reason()),
                        "</span>");
      }
      rows.push_back({name, ProbabilityBar(explanation.probability()),
                      GainText(explanation.log_evidence_gain()), chi > 0 ? Number(chi) : "\u2013",
                      last});
    }
    if (1 - sum > 0.0005) {
      rows.push_back(
          {"<span class=\"soft\">all others</span>", ProbabilityBar(1 - sum), "", "", ""});
    }
    std::string html =
        PageTable({"explanation", "probability", "gain in log evidence<br>over nominal [nats]",
                   "\u03c7\u00b2/dof,<br>held out", "fitted values, and why (not)"},
                  rows, {0, 1, 4});
    html += Soft(
        "Log evidence: how much better an explanation predicts these recordings than the nominal "
        "description fitted again, its freedom taken into account. 3 nats are odds of 20 to 1.");
    if (!d_.same_class().empty()) {
      std::vector<std::string> names;
      double together = 0;
      for (const v1::Explanation& explanation : d_.ranked()) {
        const auto& same = d_.same_class();
        if (&explanation == &d_.ranked(0) ||
            std::find(same.begin(), same.end(), explanation.effect()) != same.end()) {
          together += explanation.probability();
        }
      }
      for (const std::string& id : d_.same_class()) {
        names.push_back(
            absl::StrCat("<strong>", EscapeHtml(EffectTitle(id)), "</strong> (", Code(id), ")"));
      }
      absl::StrAppend(
          &html, "<h3>Cannot be told apart</h3>\n<p>These recordings cannot tell <strong>",
          EscapeHtml(ExplanationTitle(d_.ranked(0))), "</strong> from ", absl::StrJoin(names, ", "),
          ": all of them change these images alike. Together they have ",
          EscapeHtml(ProbabilityText(together)), ".</p>\n");
    }
    return html;
  }

  std::string NextRecordings() const {
    if (d_.next_recordings().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    for (const v1::NextRecording& next : d_.next_recordings()) {
      const std::string setup = RecordingSetup(next.recording());
      std::vector<std::string> apart;
      for (const std::string& id : next.tells_apart()) apart.push_back(EscapeHtml(EffectTitle(id)));
      rows.push_back(
          {next.description().empty() ? absl::StrCat("<strong>", EscapeHtml(setup), "</strong>")
                                      : EscapeHtml(next.description()),
           next.description().empty() ? "" : EscapeHtml(setup),
           absl::StrCat("<strong>", Number(next.expected_gain_bits(), 2), "</strong> bits"),
           absl::StrJoin(apart, ", ")});
    }
    return PageTable({"recording", "settings", "expected gain", "tells apart"}, rows, {0, 1, 3});
  }

  std::string ObservableChart() const {
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
      if (has_model_ && after.has_value()) {
        row.marks.push_back({"model", *after, 0});
        text = Change(text, Number(*after));
      }
      row.note = note.empty() ? text : absl::StrCat(text, "  (", note, ")");
      chart.rows.push_back(std::move(row));
    };
    const v1::ModelFit& before = d_.null_fit();
    const v1::ModelFit& after = d_.model_fit();
    add(of_part_ ? "tiles not used in fitting" : "all recordings",
        PerDegree(before.chi_squared(), before.degrees_of_freedom()),
        PerDegree(after.chi_squared(), after.degrees_of_freedom()),
        absl::StrCat(GroupedInteger(before.degrees_of_freedom()), " dof"));
    const v1::HeldOutImprovement& held_out = d_.held_out_improvement();
    if (held_out.null() > 0 && !of_part_) {
      add(held_out_.empty() ? "every recording, predicted from others" : "held-out recordings",
          held_out.null(), held_out.with_effect(),
          held_out.recordings().empty() ? ""
                                        : absl::StrCat(held_out.recordings_size(), " recordings"));
    }
    for (const v1::ObservableFit& fit : held_out.observables()) {
      add(QuantityName(fit.observable()),
          PerDegree(fit.null_chi_squared(), fit.degrees_of_freedom()),
          PerDegree(fit.model_chi_squared(), fit.degrees_of_freedom()),
          absl::StrCat(GroupedInteger(fit.degrees_of_freedom()), " dof, never fitted"));
    }
    return chart.rows.empty() ? "" : RangeChartSvg(chart);
  }

  // Of both fits, by recording.
  std::map<int, std::pair<const v1::RecordingFit*, const v1::RecordingFit*>> FitsByRecording()
      const {
    std::map<int, std::pair<const v1::RecordingFit*, const v1::RecordingFit*>> fits;
    for (const v1::RecordingFit& fit : d_.null_fit().recordings())
      fits[fit.recording()].first = &fit;
    if (has_model_) {
      for (const v1::RecordingFit& fit : d_.model_fit().recordings())
        fits[fit.recording()].second = &fit;
    }
    return fits;
  }

  std::string RecordingNote(int index) const {
    const v1::Recording* recording = RecordingAt(index);
    std::string note = RecordingTitle(index, recording);
    if (recording != nullptr) absl::StrAppend(&note, ": ", RecordingSetup(*recording));
    return note;
  }

  std::string RecordingChart() const {
    std::vector<RecordingBars> recordings;
    for (const auto& [index, fits] : FitsByRecording()) {
      RecordingBars bars;
      bars.label = absl::StrCat(index);
      bars.note = RecordingNote(index);
      bars.marked = held_out_.count(index) > 0;
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

  std::string IntensityChart() const {
    ChartSeries before{"null", SeriesMark::kHollowDots, {}, {}, {}, {}};
    ChartSeries after{"model", SeriesMark::kDots, {}, {}, {}, {}};
    for (const auto& [index, fits] : FitsByRecording()) {
      const auto add = [&](const v1::RecordingFit* fit, ChartSeries* series) {
        if (fit == nullptr || !fit->has_intensity_ratio() || !(fit->intensity_ratio() > 0)) return;
        // Recorded minus expected, over recorded (thesis, eq. 5.7).
        const double e_i = 100 * (1 - 1 / fit->intensity_ratio());
        series->x.push_back(index);
        series->y.push_back(e_i);
        series->notes.push_back(
            absl::StrCat(RecordingNote(index), "; e\u1d62 ", Number(e_i, 2), "\u202f%"));
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
        Soft("Recorded minus expected mean signal, over recorded (thesis, eq. 5.7)."),
        XyChartSvg(chart));
  }

  std::string Fit() const {
    const std::string charts = ObservableChart() + RecordingChart() + IntensityChart();
    if (charts.empty()) return "";
    std::string words = "1 means that what is left is as large as noise and speckle make it.";
    const auto p_value = [](const v1::ModelFit& fit) {
      return EscapeHtml(PValueText(fit.p_value()));
    };
    if (d_.null_fit().degrees_of_freedom() > 0) {
      absl::StrAppend(
          &words, " The nominal description, fitted again: \u03c7\u00b2/dof ",
          PerDegreeText(d_.null_fit().chi_squared(), d_.null_fit().degrees_of_freedom()), " (",
          p_value(d_.null_fit()), ")");
      if (has_model_ && d_.model_fit().degrees_of_freedom() > 0) {
        absl::StrAppend(
            &words, "; ", EscapeHtml(ModelName()), ": ",
            PerDegreeText(d_.model_fit().chi_squared(), d_.model_fit().degrees_of_freedom()), " (",
            p_value(d_.model_fit()), ")");
      }
      words += ".";
    }
    std::vector<KeyEntry> key = {{"null", KeyShape::kDot, "nominal description, fitted again"}};
    if (has_model_) key.push_back({"model", KeyShape::kDot, ModelName()});
    if (!held_out_.empty())
      key.push_back({"usual", KeyShape::kBox, "recording not used in fitting"});
    return Soft(words) + ChartKey(key) + charts;
  }

  std::string Deviations() const {
    std::map<std::string, const v1::FittedDeviation*> after;
    if (has_model_) {
      for (const v1::FittedDeviation& fitted : d_.model_fit().deviations())
        after[fitted.name()] = &fitted;
    }
    RangeChart chart;
    chart.title = "Fitted deviations of the set-up over their stated uncertainties";
    chart.x.title =
        "true minus nominal, in units of the stated uncertainty; lines: \u00b1 2 standard errors";
    chart.lines = {-1, 0, 1};
    chart.shaded_low = -2;
    chart.shaded_high = 2;
    const auto add = [&](const v1::FittedDeviation& before,
                         const v1::FittedDeviation* with_effect) {
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
    for (const v1::FittedDeviation& fitted : d_.null_fit().deviations()) {
      const auto it = after.find(fitted.name());
      add(fitted, it == after.end() ? nullptr : it->second);
    }
    if (chart.rows.empty()) return "";
    std::vector<KeyEntry> key = {{"null", KeyShape::kDot, "nominal description, fitted again"}};
    if (has_model_)
      key.push_back({"model", KeyShape::kDot, absl::StrCat(ModelName(), " (values at the right)")});
    return absl::StrCat(
        Soft("What is known of the set-up was fitted first, within its stated uncertainties: only "
             "what "
             "that cannot explain counts. Beyond the shaded range a value is hard to believe."),
        ChartKey(key), RangeChartSvg(chart));
  }

  std::string Stages() const {
    if (d_.stages().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    for (const v1::StageEvidence& stage : d_.stages()) {
      rows.push_back({absl::StrCat("<span class=\"effect\">",
                                   EscapeHtml(QuantityName(stage.stage())), "</span>"),
                      ProbabilityBar(stage.probability()), GainText(stage.log_evidence_gain())});
    }
    return Soft("How well a free term at one stage absorbs what is left.") +
           PageTable({"stage", "probability", "gain in log evidence [nats]"}, rows, {0, 1});
  }

  std::string Laws() const {
    if (d_.laws().empty()) return "";
    // One entry that says that there is no dependence.
    if (d_.laws_size() == 1 && d_.laws(0).quantity() == "none") {
      return absl::StrCat("<p>", LawHtml(d_.laws(0).law()), "</p>\n");
    }
    std::vector<std::vector<std::string>> rows;
    for (const v1::SetupLaw& law : d_.laws()) {
      rows.push_back({absl::StrCat("<span class=\"effect\">",
                                   EscapeHtml(QuantityName(law.quantity())), "</span>"),
                      LawHtml(law.law()),
                      law.exponent() == 0 && law.exponent_standard_error() == 0
                          ? "\u2013"
                          : EscapeHtml(QuantityWithError("exponent", law.exponent(),
                                                         law.exponent_standard_error())),
                      ProbabilityBar(law.explained())});
    }
    return PageTable({"quantity", "law", "exponent", "part of the residual it explains"}, rows,
                     {0, 1, 3});
  }

  std::string FreeForm() const {
    const v1::FreeFormTerm& term = d_.free_form();
    if (!d_.has_free_form()) return "";
    std::string html = absl::StrCat(
        "<p>A term",
        term.term().empty() ? ""
                            : absl::StrCat(" of the kind <strong>",
                                           EscapeHtml(QuantityName(term.term())), "</strong>"),
        " at the stage <strong>", EscapeHtml(QuantityName(term.stage())), "</strong>");
    if (!term.law().empty()) absl::StrAppend(&html, ", ", LawHtml(term.law()));
    html += ".</p>\n";
    if (term.values().empty()) return html;
    // Terms without a curve list their coefficients.
    constexpr absl::string_view kCoefficients = "coefficient: ";
    if (absl::StartsWith(term.abscissa(), kCoefficients)) {
      const std::vector<std::string> names =
          absl::StrSplit(term.abscissa().substr(kCoefficients.size()), ", ");
      std::vector<std::vector<std::string>> rows;
      for (int i = 0; i < std::min<int>(term.values_size(), static_cast<int>(names.size())); ++i) {
        const std::string& name = names[static_cast<size_t>(i)];
        std::optional<double> error;
        if (!term.standard_errors().empty()) error = term.standard_errors(i);
        const bool needed = term.values(i) != 0 || error != 0.0;
        rows.push_back(
            {EscapeHtml(QuantityName(name)),
             needed ? EscapeHtml(QuantityWithError(name, term.values(i), error)) : "not needed"});
      }
      return html + PageTable({"coefficient", "value"}, rows, {0});
    }
    XyChart chart;
    chart.width = 900;
    chart.height = 320;
    const auto scaled = [](const std::string& name, const auto& numbers, ChartAxis* axis) {
      double largest = 0;
      for (const double value : numbers) {
        if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
      }
      const ShownUnit unit = ShownUnitOf(name, largest);
      axis->title = QuantityName(name);
      if (!unit.name.empty()) absl::StrAppend(&axis->title, " [", unit.name, "]");
      return unit.per_named;
    };
    const double x_factor = scaled(term.abscissa(), term.abscissa_values(), &chart.x);
    const double y_factor = scaled(term.ordinate(), term.values(), &chart.y);
    // Decades, as of exposure times, need a logarithmic axis.
    double least = INFINITY, most = 0;
    for (const double x : term.abscissa_values()) {
      if (x > 0) least = std::min(least, x);
      most = std::max(most, x);
    }
    chart.x.logarithmic =
        most >= 1e3 * least &&
        *std::min_element(term.abscissa_values().begin(), term.abscissa_values().end()) >= 0;
    ChartSeries curve{"model", SeriesMark::kLineAndDots, {}, {}, {}, {}};
    for (const double x : term.abscissa_values()) curve.x.push_back(x_factor * x);
    for (const double y : term.values()) curve.y.push_back(y_factor * y);
    for (const double error : term.standard_errors())
      curve.half_band.push_back(2 * y_factor * error);
    chart.series.push_back(std::move(curve));
    return absl::StrCat(
        html, XyChartSvg(chart),
        term.standard_errors().empty() ? "" : Soft("Shaded: \u00b1 2 standard errors."));
  }

  std::string Power() const {
    if (d_.power().empty()) return "";
    std::vector<std::vector<std::string>> rows;
    for (const v1::DetectableStrength& power : d_.power()) {
      std::string found;
      if (!d_.ranked().empty()) {
        for (const v1::FittedEffect& effect : d_.ranked(0).effects()) {
          if (effect.effect() != power.effect()) continue;
          for (const v1::FittedParameter& parameter : effect.parameters()) {
            if (parameter.name() == power.parameter()) {
              found = absl::StrCat("<strong>",
                                   EscapeHtml(QuantityText(parameter.name(), parameter.value())),
                                   "</strong>");
            }
          }
        }
      }
      rows.push_back({absl::StrCat("<span class=\"effect\">",
                                   EscapeHtml(EffectTitle(power.effect())), "</span>"),
                      EscapeHtml(QuantityName(power.parameter())),
                      EscapeHtml(QuantityText(power.parameter(), power.strength(), 2)), found,
                      EscapeHtml(power.unit_note())});
    }
    return Soft(
               "The strength of each effect at which these recordings would, on average, raise the "
               "log-likelihood by 5 over the nominal description fitted again. Anything weaker may "
               "be "
               "there unseen.") +
           PageTable({"effect", "parameter", "seen from", "found", ""}, rows, {0, 1, 4});
  }

  std::string Provenance() const {
    std::string html =
        absl::StrCat("<p>Set ", EscapeHtml(d_.set().empty() ? "without a name" : d_.set()),
                     ", seed ", d_.seed(), ".</p>\n");
    if (d_.calibrated_effects().empty()) return html;
    absl::StrAppend(&html, "<p>Effects of the calibrated model:</p>\n<ul>");
    for (const v1::Effect& effect : d_.calibrated_effects()) {
      // The order of a message's map is not fixed.
      const std::map<std::string, double> parameters(effect.parameters().begin(),
                                                     effect.parameters().end());
      std::vector<std::string> values;
      for (const auto& [name, value] : parameters) {
        values.push_back(absl::StrCat(name, " = ", NumberText(value)));
      }
      absl::StrAppend(&html, "<li>", Code(effect.effect()), values.empty() ? "" : ": ",
                      Code(absl::StrJoin(values, ", ")), "</li>\n");
    }
    return html + "</ul>\n";
  }

  const v1::Diagnosis& d_;
  const std::string& set_folder_;
  bool has_model_ = false;
  bool of_part_ = false;
  std::set<int> held_out_;
};

absl::Status SizeError(const std::string& field, int size, int expected, const char* what) {
  return absl::InvalidArgumentError(
      absl::StrFormat("report: %s has size %d, must be %d (%s)", field, size, expected, what));
}

absl::Status Check(const v1::Diagnosis& diagnosis) {
  for (int i = 0; i < diagnosis.profiles_size(); ++i) {
    const v1::ProfileComparison& profile = diagnosis.profiles(i);
    const int rows = profile.row_px_size();
    const auto name = [&](const char* field) { return absl::StrCat("profiles[", i, "].", field); };
    const std::pair<const char*, int> needed[] = {{"observed_dn", profile.observed_dn_size()},
                                                  {"null_dn", profile.null_dn_size()}};
    const std::pair<const char*, int> optional[] = {
        {"model_dn", profile.model_dn_size()},
        {"standard_deviation_dn", profile.standard_deviation_dn_size()}};
    for (const auto& [field, size] : needed) {
      if (size != rows) return SizeError(name(field), size, rows, "size of row_px");
    }
    for (const auto& [field, size] : optional) {
      if (size != 0 && size != rows) return SizeError(name(field), size, rows, "size of row_px");
    }
  }
  for (int i = 0; i < diagnosis.region_maps_size(); ++i) {
    const v1::RegionMap& map = diagnosis.region_maps(i);
    const auto name = [&](const char* field) {
      return absl::StrCat("region_maps[", i, "].", field);
    };
    if (map.rows() < 0 || map.columns() < 0) {
      return absl::InvalidArgumentError(absl::StrFormat("report: %s is %d, must be at least 0",
                                                        name(map.rows() < 0 ? "rows" : "columns"),
                                                        std::min(map.rows(), map.columns())));
    }
    const int64_t cells = int64_t{map.rows()} * map.columns();
    const std::pair<const char*, int> fields[] = {{"null_z", map.null_z_size()},
                                                  {"model_z", map.model_z_size()}};
    for (const auto& [field, size] : fields) {
      if (size != 0 && size != cells) {
        return SizeError(name(field), size, static_cast<int>(cells), "rows x columns");
      }
    }
    if (!map.row_edges_px().empty() && map.row_edges_px_size() != map.rows() + 1) {
      return SizeError(name("row_edges_px"), map.row_edges_px_size(), map.rows() + 1, "rows + 1");
    }
    if (!map.column_edges_px().empty() && map.column_edges_px_size() != map.columns() + 1) {
      return SizeError(name("column_edges_px"), map.column_edges_px_size(), map.columns() + 1,
                       "columns + 1");
    }
    const std::pair<const char*, const google::protobuf::RepeatedField<double>*> edges[] = {
        {"row_edges_px", &map.row_edges_px()}, {"column_edges_px", &map.column_edges_px()}};
    for (const auto& [field, values] : edges) {
      for (int k = 0; k < values->size(); ++k) {
        if (std::isfinite(values->Get(k)) && (k == 0 || values->Get(k) > values->Get(k - 1))) {
          continue;
        }
        return absl::InvalidArgumentError(
            absl::StrFormat("report: %s[%d] is %g, must be finite and greater than the one before",
                            name(field), k, values->Get(k)));
      }
    }
  }
  const v1::FreeFormTerm& term = diagnosis.free_form();
  if (term.abscissa_values_size() != term.values_size()) {
    return SizeError("free_form.abscissa_values", term.abscissa_values_size(), term.values_size(),
                     "size of values");
  }
  if (!term.standard_errors().empty() && term.standard_errors_size() != term.values_size()) {
    return SizeError("free_form.standard_errors", term.standard_errors_size(), term.values_size(),
                     "size of values");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> RenderDiagnosisReport(const v1::Diagnosis& diagnosis,
                                                  const std::string& set_folder) {
  if (absl::Status status = Check(diagnosis); !status.ok()) return status;
  return Report(diagnosis, set_folder).Html();
}

absl::Status WriteDiagnosisReport(const v1::Diagnosis& diagnosis, const std::string& set_folder,
                                  const std::string& path) {
  const absl::StatusOr<std::string> html = RenderDiagnosisReport(diagnosis, set_folder);
  if (!html.ok()) return html.status();
  return WriteFileAtomically(path, *html);
}

}  // namespace sightline
