// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/recordings/verification_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/file/atomic_write.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/recordings/line_range.h"
#include "planner_client/report/recordings/recording_text.h"

namespace sightline {
namespace {

using Channel = v1::ChannelVerification;
using Recording = v1::RecordingVerification;

// The channels that occur, in order of appearance.
std::vector<std::string> Channels(const v1::Verification& verification) {
  std::vector<std::string> channels;
  for (const Recording& recording : verification.recordings()) {
    for (const Channel& channel : recording.channels()) {
      if (std::find(channels.begin(), channels.end(), channel.channel()) == channels.end()) {
        channels.push_back(channel.channel());
      }
    }
  }
  return channels;
}

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// Signed, in percent: "+3.2 %".
std::string ErrorText(double relative) {
  if (!std::isfinite(relative)) return Number(relative);
  return absl::StrCat(relative > 0 ? "+" : "", QuantityText("e_relative", relative, 2));
}

std::string Setup(const Recording& recording) {
  v1::Recording setup;
  setup.set_f_number(recording.f_number());
  setup.set_exposure_time_s(recording.exposure_time_s());
  setup.set_camera_distance_m(recording.camera_distance_m());
  setup.set_focus_distance_m(recording.focus_distance_m());
  return RecordingSetup(setup);
}

// Colour in the charts; a channel of another name is drawn like mono.
std::string ChannelClass(const std::string& channel) {
  return channel == "red" || channel == "green" || channel == "blue" ? channel : "mono";
}

absl::Status Check(const v1::Verification& verification) {
  for (int i = 0; i < verification.recordings_size(); ++i) {
    for (int k = 0; k < verification.recordings(i).channels_size(); ++k) {
      const Channel& channel = verification.recordings(i).channels(k);
      const std::pair<const char*, int> sizes[] = {{"recorded_dn", channel.recorded_dn_size()},
                                                   {"simulated_dn", channel.simulated_dn_size()}};
      for (const auto& [field, size] : sizes) {
        if (size != 0 && size != channel.row_px_size()) {
          return absl::InvalidArgumentError(absl::StrFormat(
              "report: recordings[%d].channels[%d].%s has size %d, must be %d (size of row_px)", i,
              k, field, size, channel.row_px_size()));
        }
      }
    }
  }
  return absl::OkStatus();
}

double MeanEi(const v1::ChannelSummary& s) { return s.has_mean_e_i() ? s.mean_e_i() : kNoNumber; }
double MeanEu(const v1::ChannelSummary& s) { return s.has_mean_e_u() ? s.mean_e_u() : kNoNumber; }

std::string SummaryTable(const v1::Verification& verification) {
  if (verification.summary().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const v1::ChannelSummary& s : verification.summary()) {
    const auto deviation = [](bool known, double value) {
      return known ? QuantityText("e_relative", value, 2) : Number(kNoNumber);
    };
    rows.push_back({absl::StrCat("<span class=\"effect\">", EscapeHtml(s.channel()), "</span>"),
                    ErrorText(MeanEi(s)), deviation(s.has_deviation_e_i(), s.deviation_e_i()),
                    ErrorText(s.has_largest_e_i() ? s.largest_e_i() : kNoNumber),
                    absl::StrCat(s.recordings_e_i()), ErrorText(MeanEu(s)),
                    deviation(s.has_deviation_e_u(), s.deviation_e_u()),
                    ErrorText(s.has_largest_e_u() ? s.largest_e_u() : kNoNumber),
                    absl::StrCat(s.recordings_e_u())});
  }
  return absl::StrCat(
      "<p class=\"soft\">e<sub>i</sub> is the error of the peak of the average profile (thesis, "
      "eq. 5.7), e<sub>u</sub> that of the scatter of the detected line (eq. 5.10): recorded minus "
      "simulated, over recorded. Positive: the simulation is too low. Nothing was fitted.</p>\n",
      PageTable({"channel", "mean e<sub>i</sub>", "deviation", "largest", "recordings",
                 "mean e<sub>u</sub>", "deviation", "largest", "recordings"},
                rows, {0}));
}

// What is unset is no number: charts leave it out, texts show a dash.
double Ei(const Channel& c) { return c.has_e_i() ? c.e_i() : kNoNumber; }
double Eu(const Channel& c) { return c.has_e_u() ? c.e_u() : kNoNumber; }
double RecordedUPx(const Channel& c) {
  return c.has_recorded_u_px() ? c.recorded_u_px() : kNoNumber;
}
double SimulatedUPx(const Channel& c) {
  return c.has_simulated_u_px() ? c.simulated_u_px() : kNoNumber;
}

// One of the quantities of chapter 5: up to two values a channel, recorded and simulated.
struct Quantity {
  const char* title;
  std::string axis;
  double (*recorded)(const Channel&);
  double (*simulated)(const Channel&);  // nullptr: it is an error, there is one value only
};

const Quantity kQuantities[] = {
    {"Intensity: e\u1d62 (eq. 5.7)", "e\u1d62 [%]", [](const Channel& c) { return 100 * Ei(c); },
     nullptr},
    {"Scatter of the line in the image: u\u209a\u2093", "u\u209a\u2093 [px]", RecordedUPx,
     SimulatedUPx},
    {"The same as height: u\u2095 (eq. 5.9)", "u\u2095 [\u00b5m]",
     [](const Channel& c) { return c.has_recorded_u_h_m() ? 1e6 * c.recorded_u_h_m() : kNoNumber; },
     [](const Channel& c) {
       return c.has_simulated_u_h_m() ? 1e6 * c.simulated_u_h_m() : kNoNumber;
     }},
    {"Error of the scatter: e\u1d64 (eq. 5.10)", "e\u1d64 [%]",
     [](const Channel& c) { return 100 * Eu(c); }, nullptr},
};

struct Abscissa {
  std::string title;
  bool logarithmic;
  double (*value)(const Recording&);
};

const Abscissa kAbscissae[] = {
    {"camera distance [mm]", false, [](const Recording& r) { return 1e3 * r.camera_distance_m(); }},
    {"focus distance [mm]", false, [](const Recording& r) { return 1e3 * r.focus_distance_m(); }},
    {"f-number", true, [](const Recording& r) { return r.f_number(); }},
    {"normalised exposure [ms]", true,
     [](const Recording& r) { return 1e3 * r.normalised_exposure(); }},
};

// Mean over recordings with the same abscissa, as the thesis's figures join them; only where there
// are few abscissae, each with its own group.
ChartSeries Means(const ChartSeries& dots) {
  std::map<double, std::pair<double, int>> sums;
  for (size_t i = 0; i < dots.x.size(); ++i) {
    if (!std::isfinite(dots.x[i]) || !std::isfinite(dots.y[i])) continue;
    sums[dots.x[i]].first += dots.y[i];
    ++sums[dots.x[i]].second;
  }
  ChartSeries means;
  means.css_class = dots.css_class;
  means.mark = dots.mark == SeriesMark::kHollowDots ? SeriesMark::kDashedLine : SeriesMark::kLine;
  if (sums.size() < 2 || sums.size() > 12) return means;
  for (const auto& [x, sum] : sums) {
    means.x.push_back(x);
    means.y.push_back(sum.first / sum.second);
  }
  return means;
}

std::string QuantityCharts(const v1::Verification& verification, const Quantity& quantity,
                           const std::vector<std::string>& channels) {
  std::string html;
  for (const Abscissa& abscissa : kAbscissae) {
    XyChart chart;
    chart.width = 330;
    chart.height = 240;
    chart.x.title = abscissa.title;
    chart.x.logarithmic = abscissa.logarithmic;
    chart.y.title = quantity.axis;
    if (quantity.simulated == nullptr) {
      chart.marks = {0};
    } else {
      chart.y.low = 0;
    }
    std::vector<ChartSeries> lines, dots;
    for (const std::string& name : channels) {
      ChartSeries recorded, simulated;
      recorded.css_class = simulated.css_class = ChannelClass(name);
      recorded.mark = SeriesMark::kDots;
      simulated.mark = SeriesMark::kHollowDots;
      for (const Recording& recording : verification.recordings()) {
        for (const Channel& channel : recording.channels()) {
          if (channel.channel() != name) continue;
          const std::string note =
              absl::StrCat("recording ", recording.recording(), ", ", name, ": ", Setup(recording));
          recorded.x.push_back(abscissa.value(recording));
          recorded.y.push_back(quantity.recorded(channel));
          recorded.notes.push_back(note);
          if (quantity.simulated == nullptr) continue;
          simulated.x.push_back(abscissa.value(recording));
          simulated.y.push_back(quantity.simulated(channel));
          simulated.notes.push_back(note + ", simulated");
        }
      }
      for (ChartSeries* series : {&recorded, &simulated}) {
        if (series->x.empty()) continue;
        ChartSeries means = Means(*series);
        if (!means.x.empty()) lines.push_back(std::move(means));
        dots.push_back(std::move(*series));
      }
    }
    chart.series = std::move(lines);
    chart.series.insert(chart.series.end(), dots.begin(), dots.end());
    html += XyChartSvg(chart);
  }
  return absl::StrCat("<h3>", EscapeHtml(quantity.title), "</h3>\n<div class=\"cards four\">\n",
                      html, "</div>\n");
}

std::string DependenceSection(const v1::Verification& verification,
                              const std::vector<std::string>& channels) {
  if (channels.empty()) return "";
  std::vector<KeyEntry> key;
  for (const std::string& channel : channels) {
    key.push_back({ChannelClass(channel), KeyShape::kDot,
                   channel == "mono" ? "recorded" : channel + ", recorded"});
  }
  for (const std::string& channel : channels) {
    key.push_back({ChannelClass(channel), KeyShape::kHollowDot,
                   channel == "mono" ? "simulated" : channel + ", simulated"});
  }
  key.push_back({ChannelClass(channels.front()), KeyShape::kLine, "mean over equal settings"});
  std::string body = absl::StrCat(
      "<p class=\"soft\">Every dot is one recording. Exposure is normalised to f/22 (thesis, eq. "
      "5.8).</p>\n",
      ChartKey(key));
  for (const Quantity& quantity : kQuantities)
    body += QuantityCharts(verification, quantity, channels);
  return PageSection("dependence", "Where simulation and recordings differ", body);
}

std::string Crop(const std::string& png, const char* what) {
  if (png.empty()) return "";
  return absl::StrCat("<figure><img alt=\"", what, "\" src=\"", PngDataUri(png), "\"><figcaption>",
                      what, "</figcaption></figure>\n");
}

std::string RecordingCard(const Recording& recording) {
  std::string html = absl::StrCat(
      "<div class=\"card\"><h3>Recording ", recording.recording(),
      recording.file().empty()
          ? ""
          : absl::StrCat(" <span class=\"soft\">", EscapeHtml(recording.file()), "</span>"),
      "</h3>\n<p class=\"soft\">", EscapeHtml(Setup(recording)), "</p>\n");
  XyChart chart;
  chart.width = 420;
  chart.height = 220;
  chart.x.title = "row [px]";
  chart.y.title = "DN";
  std::vector<std::vector<std::string>> numbers;
  double brightest_dn = -INFINITY;
  for (const Channel& channel : recording.channels()) {
    const std::vector<double> rows(channel.row_px().begin(), channel.row_px().end());
    const auto add = [&](const auto& values, SeriesMark mark) {
      if (values.empty()) return;
      ChartSeries series;
      series.css_class = ChannelClass(channel.channel());
      series.mark = mark;
      series.x = rows;
      series.y.assign(values.begin(), values.end());
      // Faint channels are noise beside the line.
      const double peak_dn = *std::max_element(series.y.begin(), series.y.end());
      const auto [first, last] = LineRange(rows, series.y);
      if (peak_dn > brightest_dn && std::isfinite(first) && first < last) {
        brightest_dn = peak_dn;
        chart.x.low = first;
        chart.x.high = last;
      }
      chart.series.push_back(std::move(series));
    };
    add(channel.recorded_dn(), SeriesMark::kLine);
    add(channel.simulated_dn(), SeriesMark::kDashedLine);
    const auto found = [](double fraction) { return FixedNumber(100 * fraction, 0); };
    numbers.push_back(
        {EscapeHtml(channel.channel()), ErrorText(Ei(channel)),
         absl::StrCat(Number(RecordedUPx(channel)), " / ", Number(SimulatedUPx(channel))),
         ErrorText(Eu(channel)),
         absl::StrCat(found(channel.recorded_found_fraction()), " / ",
                      found(channel.simulated_found_fraction()))});
  }
  if (!chart.series.empty()) html += XyChartSvg(chart);
  if (!numbers.empty()) {
    absl::StrAppend(
        &html, "<div class=\"mini\">",
        PageTable({"", "e<sub>i</sub>", "u<sub>px</sub> [px]", "e<sub>u</sub>", "found [%]"},
                  numbers, {0}),
        "</div>\n");
  }
  const std::string crops = Crop(recording.recorded_crop_png(), "recorded") +
                            Crop(recording.simulated_crop_png(), "simulated");
  if (!crops.empty()) absl::StrAppend(&html, "<div class=\"crops\">", crops, "</div>\n");
  return html + "</div>\n";
}

std::string RecordingsSection(const v1::Verification& verification,
                              const std::vector<std::string>& channels) {
  if (verification.recordings().empty()) return "";
  std::vector<KeyEntry> key;
  const bool mono = channels.size() < 2;
  for (const std::string& channel : channels) {
    key.push_back(
        {ChannelClass(channel), KeyShape::kLine, mono ? "recorded" : channel + ", recorded"});
    key.push_back({ChannelClass(channel), KeyShape::kDashedLine,
                   mono ? "simulated" : channel + ", simulated"});
  }
  std::string body = absl::StrCat(
      "<p class=\"soft\">Average profile about the line. u<sub>px</sub>, and the part of the "
      "columns "
      "in which the line was found: recorded / simulated. Crops are scaled alike.</p>\n",
      channels.empty() ? "" : ChartKey(key), "<div class=\"cards three\">\n");
  for (const Recording& recording : verification.recordings()) body += RecordingCard(recording);
  return PageSection("recordings", "Recording by recording", body + "</div>\n");
}

// The answer in a sentence: the channel with the largest mean error stands for all.
std::string Finding(const v1::Verification& verification) {
  if (verification.summary().empty()) return "";
  double e_i = kNoNumber, e_u = kNoNumber;
  for (const v1::ChannelSummary& summary : verification.summary()) {
    if (!(std::abs(MeanEi(summary)) <= std::abs(e_i))) e_i = MeanEi(summary);
    if (!(std::abs(MeanEu(summary)) <= std::abs(e_u))) e_u = MeanEu(summary);
  }
  const auto words = [](double error) {
    if (!std::isfinite(error)) return std::string("could not be compared");
    if (std::abs(error) < 0.0005) return std::string("agrees on average");
    return absl::StrCat("is <strong>", QuantityText("e_relative", std::abs(error), 2), " too ",
                        error > 0 ? "low" : "high", "</strong> on average");
  };
  return absl::StrCat("The simulated intensity ", words(e_i),
                      ", the simulated scatter of the line ", words(e_u),
                      verification.summary_size() > 1 ? ", in the worst channel." : ".");
}

// "+5.0 % red +8.0 % green", as HTML.
std::string ByChannel(const v1::Verification& verification,
                      double (*error)(const v1::ChannelSummary&)) {
  std::vector<std::string> values;
  for (const v1::ChannelSummary& summary : verification.summary()) {
    values.push_back(ErrorText(error(summary)));
    if (verification.summary_size() > 1) {
      absl::StrAppend(&values.back(), " <small>", EscapeHtml(summary.channel()), "</small>");
    }
  }
  return absl::StrJoin(values, " &#160;");
}

}  // namespace

absl::StatusOr<std::string> RenderVerificationReport(const v1::Verification& verification) {
  if (absl::Status status = Check(verification); !status.ok()) return status;
  const std::string name = verification.set().empty() ? "Recordings" : verification.set();
  const std::vector<std::string> channels = Channels(verification);
  StaticPage page;
  page.title = absl::StrCat(name, " \u2013 verification");
  page.kicker = "Sightline \u00b7 verification";
  page.heading = absl::StrCat(name, ": recorded and simulated");
  page.finding_html = Finding(verification);
  page.figures = {{"recordings", absl::StrCat(verification.recordings_size())}};
  if (!verification.summary().empty()) {
    page.figures.push_back({"mean intensity error e\u1d62", ByChannel(verification, MeanEi)});
    page.figures.push_back({"mean error of scatter e\u1d64", ByChannel(verification, MeanEu)});
  }
  page.warnings.assign(verification.warnings().begin(), verification.warnings().end());
  page.sections_html =
      PageSection("summary", "Summary", SummaryTable(verification)) +
      DependenceSection(verification, channels) + RecordingsSection(verification, channels) +
      PageSection(
          "provenance", "How to get this again",
          absl::StrCat("<p>Set ", EscapeHtml(name), ", seed ", verification.seed(), ".</p>\n"));
  return StaticPageHtml(page);
}

absl::Status WriteVerificationReport(const v1::Verification& verification,
                                     const std::string& path) {
  const absl::StatusOr<std::string> html = RenderVerificationReport(verification);
  if (!html.ok()) return html.status();
  return WriteFileAtomically(path, *html);
}

}  // namespace sightline
