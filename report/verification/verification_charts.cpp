// SPDX-License-Identifier: Apache-2.0
#include "report/verification/verification_charts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "report/document/report_series.h"
#include "report/recordings/line_range.h"
#include "report/recordings/recording_text.h"

namespace sightline {
namespace {

using Channel = v1::ChannelVerification;
using Verified = v1::RecordingVerification;

constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();

// Channels with other names are drawn like mono.
v1::ReportColour ChannelColour(const std::string& channel) {
  if (channel == "red") return v1::REPORT_COLOUR_RED;
  if (channel == "green") return v1::REPORT_COLOUR_GREEN;
  return channel == "blue" ? v1::REPORT_COLOUR_BLUE : v1::REPORT_COLOUR_UNSPECIFIED;
}

std::string SeriesName(const std::string& channel, const char* what) {
  return channel == "mono" ? what : absl::StrCat(channel, ", ", what);
}

// One of the quantities of chapter 5: up to two values a channel, recorded and simulated.
struct VerifiedQuantity {
  const char* title;
  const char* axis;
  const char* unit;
  double (*recorded)(const Channel&);
  double (*simulated)(const Channel&);  // nullptr: an error, which has only one value
};

const VerifiedQuantity kVerifiedQuantities[] = {
    {"Intensity: e\u1d62 (eq. 5.7)", "e\u1d62", "%",
     [](const Channel& c) { return 100 * IntensityError(c); }, nullptr},
    {"Scatter of the line in the image: u\u209a\u2093", "u\u209a\u2093", "px", RecordedScatterPx,
     SimulatedScatterPx},
    {"The same as height: u\u2095 (eq. 5.9)", "u\u2095", "\u00b5m",
     [](const Channel& c) { return c.has_recorded_u_h_m() ? 1e6 * c.recorded_u_h_m() : kUnset; },
     [](const Channel& c) { return c.has_simulated_u_h_m() ? 1e6 * c.simulated_u_h_m() : kUnset; }},
    {"Error of the scatter: e\u1d64 (eq. 5.10)", "e\u1d64", "%",
     [](const Channel& c) { return 100 * ScatterError(c); }, nullptr},
};

struct VerifiedAbscissa {
  const char* title;
  const char* unit;
  bool logarithmic;
  double (*value)(const Verified&);
};

const VerifiedAbscissa kVerifiedAbscissae[] = {
    {"camera distance", "mm", false, [](const Verified& r) { return 1e3 * r.camera_distance_m(); }},
    {"focus distance", "mm", false, [](const Verified& r) { return 1e3 * r.focus_distance_m(); }},
    {"f-number", "", true, [](const Verified& r) { return r.f_number(); }},
    {"normalised exposure", "ms", true,
     [](const Verified& r) { return 1e3 * r.normalised_exposure(); }},
};

// Mean over recordings with the same abscissa, as the thesis's figures join them; only where there
// are few abscissae, each with its own group. Otherwise without points.
v1::ReportSeries MeansOf(const v1::ReportSeries& dots) {
  std::map<double, std::pair<double, int>> sums;
  for (int i = 0; i < dots.x_size(); ++i) {
    if (!std::isfinite(dots.x(i)) || !std::isfinite(dots.y(i))) continue;
    sums[dots.x(i)].first += dots.y(i);
    ++sums[dots.x(i)].second;
  }
  v1::ReportSeries means =
      EmptySeries("mean over equal settings", dots.colour(),
                  dots.mark() == v1::ReportSeries::HOLLOW_DOTS ? v1::ReportSeries::DASHED_LINE
                                                               : v1::ReportSeries::LINE);
  if (sums.size() < 2 || sums.size() > 12) return means;
  for (const auto& [x, sum] : sums) AddPoint(x, sum.first / sum.second, &means);
  return means;
}

v1::ReportChart DependenceChart(const v1::Verification& verification,
                                const VerifiedQuantity& quantity, const VerifiedAbscissa& abscissa,
                                const std::vector<std::string>& channels) {
  v1::ReportChart chart;
  *chart.mutable_x() = AxisOf(abscissa.title, abscissa.unit, abscissa.logarithmic);
  *chart.mutable_y() = AxisOf(quantity.axis, quantity.unit);
  if (quantity.simulated == nullptr) {
    AddLineAtY(0, &chart);
  } else {
    chart.mutable_y()->set_low(0);
  }
  std::vector<v1::ReportSeries> lines, dots;
  for (const std::string& name : channels) {
    v1::ReportSeries recorded =
        EmptySeries(SeriesName(name, "recorded"), ChannelColour(name), v1::ReportSeries::DOTS);
    v1::ReportSeries simulated = EmptySeries(SeriesName(name, "simulated"), ChannelColour(name),
                                             v1::ReportSeries::HOLLOW_DOTS);
    for (const Verified& recording : verification.recordings()) {
      for (const Channel& channel : recording.channels()) {
        if (channel.channel() != name) continue;
        const std::string note =
            absl::StrCat("recording ", recording.recording(), ": ", VerifiedSetup(recording));
        const double x = abscissa.value(recording);
        AddPoint(x, quantity.recorded(channel), note, &recorded);
        if (quantity.simulated != nullptr)
          AddPoint(x, quantity.simulated(channel), note, &simulated);
      }
    }
    for (v1::ReportSeries* series : {&recorded, &simulated}) {
      if (series->x().empty()) continue;
      v1::ReportSeries means = MeansOf(*series);
      if (!means.x().empty()) lines.push_back(std::move(means));
      dots.push_back(std::move(*series));
    }
  }
  for (std::vector<v1::ReportSeries>* all : {&lines, &dots}) {
    for (v1::ReportSeries& series : *all) *chart.add_series() = std::move(series);
  }
  return chart;
}

}  // namespace

double IntensityError(const Channel& c) { return c.has_e_i() ? c.e_i() : kUnset; }
double ScatterError(const Channel& c) { return c.has_e_u() ? c.e_u() : kUnset; }
double RecordedScatterPx(const Channel& c) {
  return c.has_recorded_u_px() ? c.recorded_u_px() : kUnset;
}
double SimulatedScatterPx(const Channel& c) {
  return c.has_simulated_u_px() ? c.simulated_u_px() : kUnset;
}

std::string VerifiedSetup(const Verified& recording) {
  v1::Recording setup;
  setup.set_f_number(recording.f_number());
  setup.set_exposure_time_s(recording.exposure_time_s());
  setup.set_camera_distance_m(recording.camera_distance_m());
  setup.set_focus_distance_m(recording.focus_distance_m());
  return RecordingSetup(setup);
}

ReportBlocks DependenceBlocks(const v1::Verification& verification,
                              const std::vector<std::string>& channels) {
  if (channels.empty()) return {};
  ReportBlocks quantities;
  for (const VerifiedQuantity& quantity : kVerifiedQuantities) {
    ReportBlocks charts;
    for (const VerifiedAbscissa& abscissa : kVerifiedAbscissae) {
      charts.push_back(ChartBlock(DependenceChart(verification, quantity, abscissa, channels)));
    }
    quantities.push_back(TitledBlock(
        quantity.title, {GroupBlock(v1::ReportGroup::FOUR_COLUMNS, std::move(charts))}));
  }
  return {
      RemarkBlock("Every dot is one recording. Exposure is normalised to f/22 (thesis, eq. 5.8)."),
      GroupBlock(v1::ReportGroup::STACK, std::move(quantities))};
}

v1::ReportChart ProfileChart(const Verified& recording) {
  v1::ReportChart chart;
  chart.set_title("Average profile");
  *chart.mutable_x() = AxisOf("row", "px");
  *chart.mutable_y() = AxisOf("signal", "DN");
  double brightest_dn = -INFINITY;
  for (const Channel& channel : recording.channels()) {
    const std::vector<double> rows(channel.row_px().begin(), channel.row_px().end());
    const auto add = [&](const auto& values, const char* what, v1::ReportSeries::Mark mark) {
      if (values.empty()) return;
      const std::vector<double> signal(values.begin(), values.end());
      // Faint channels would only add noise next to the line.
      const double peak_dn = *std::max_element(signal.begin(), signal.end());
      const auto [first, last] = LineRange(rows, signal);
      if (peak_dn > brightest_dn && std::isfinite(first) && first < last) {
        brightest_dn = peak_dn;
        chart.mutable_x()->set_low(first);
        chart.mutable_x()->set_high(last);
      }
      *chart.add_series() = SeriesOf(SeriesName(channel.channel(), what),
                                     ChannelColour(channel.channel()), mark, rows, signal);
    };
    add(channel.recorded_dn(), "recorded", v1::ReportSeries::LINE);
    add(channel.simulated_dn(), "simulated", v1::ReportSeries::DASHED_LINE);
  }
  return chart;
}

}  // namespace sightline
