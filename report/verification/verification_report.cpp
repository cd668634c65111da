// SPDX-License-Identifier: Apache-2.0
#include "report/verification/verification_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "report/document/report_page.h"
#include "report/document/report_parts.h"
#include "report/page/number_text.h"
#include "report/verification/verification_charts.h"

namespace sightline {
namespace {

using ErrorOfChannel = double (*)(const v1::ChannelSummary&);

constexpr double kNotCompared = std::numeric_limits<double>::quiet_NaN();

// The channels that occur, in order of appearance.
std::vector<std::string> VerifiedChannels(const v1::Verification& verification) {
  std::vector<std::string> channels;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    for (const v1::ChannelVerification& channel : recording.channels()) {
      if (std::find(channels.begin(), channels.end(), channel.channel()) == channels.end()) {
        channels.push_back(channel.channel());
      }
    }
  }
  return channels;
}

// Signed, in percent: "+3.2 %".
std::string ErrorText(double relative) {
  if (!std::isfinite(relative)) return Number(relative);
  return absl::StrCat(relative > 0 ? "+" : "", QuantityText("e_relative", relative, 2));
}

v1::ReportCell ErrorCell(double relative) {
  return NumberCell(100 * relative, ErrorText(relative), "%");
}

absl::Status CheckProfiles(const v1::Verification& verification) {
  for (int i = 0; i < verification.recordings_size(); ++i) {
    for (int k = 0; k < verification.recordings(i).channels_size(); ++k) {
      const v1::ChannelVerification& channel = verification.recordings(i).channels(k);
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

double MeanIntensityError(const v1::ChannelSummary& s) {
  return s.has_mean_e_i() ? s.mean_e_i() : kNotCompared;
}
double MeanScatterError(const v1::ChannelSummary& s) {
  return s.has_mean_e_u() ? s.mean_e_u() : kNotCompared;
}

ReportBlocks SummaryBlocks(const v1::Verification& verification) {
  if (verification.summary().empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::ChannelSummary& s : verification.summary()) {
    const auto deviation = [](bool known, double value) {
      return known ? NumberCell(100 * value, QuantityText("e_relative", value, 2), "%")
                   : TextCell(kNoValue);
    };
    rows.push_back({StrongCell(s.channel()), ErrorCell(MeanIntensityError(s)),
                    deviation(s.has_deviation_e_i(), s.deviation_e_i()),
                    ErrorCell(s.has_largest_e_i() ? s.largest_e_i() : kNotCompared),
                    CountCell(s.recordings_e_i()), ErrorCell(MeanScatterError(s)),
                    deviation(s.has_deviation_e_u(), s.deviation_e_u()),
                    ErrorCell(s.has_largest_e_u() ? s.largest_e_u() : kNotCompared),
                    CountCell(s.recordings_e_u())});
  }
  std::vector<v1::ReportColumn> columns = {WordsColumn("channel")};
  for (const char* error : {"Intensity, e\u1d62", "Scatter, e\u1d64"}) {
    for (const char* name : {"mean", "deviation", "largest", "recordings"}) {
      columns.push_back(NumberColumn(name));
      columns.back().set_group(error);
    }
  }
  return {RemarkBlock(
              "e\u1d62 is the error of the peak of the average profile (thesis, eq. 5.7), e\u1d64 "
              "that of the scatter of the detected line (eq. 5.10): recorded minus simulated, over "
              "recorded. Positive: the simulation is too low. Nothing was fitted."),
          TableBlock("Mean errors by channel", columns, rows)};
}

v1::ReportBlock RecordingCard(const v1::RecordingVerification& recording) {
  ReportBlocks blocks;
  if (v1::ReportChart chart = ProfileChart(recording); !chart.series().empty()) {
    blocks.push_back(ChartBlock(std::move(chart)));
  }
  std::vector<ReportCells> rows;
  for (const v1::ChannelVerification& channel : recording.channels()) {
    const auto percent = [](double fraction) {
      return NumberCell(100 * fraction, FixedNumber(100 * fraction, 0));
    };
    const auto pixels = [](double px) { return NumberCell(px, Number(px)); };
    rows.push_back({TextCell(channel.channel()), ErrorCell(IntensityError(channel)),
                    pixels(RecordedScatterPx(channel)), pixels(SimulatedScatterPx(channel)),
                    ErrorCell(ScatterError(channel)), percent(channel.recorded_found_fraction()),
                    percent(channel.simulated_found_fraction())});
  }
  if (!rows.empty()) {
    std::vector<v1::ReportColumn> columns = {WordsColumn(""),          NumberColumn("e\u1d62"),
                                             NumberColumn("recorded"), NumberColumn("simulated"),
                                             NumberColumn("e\u1d64"),  NumberColumn("recorded"),
                                             NumberColumn("simulated")};
    for (const size_t i : {2, 3}) columns[i].set_group("u\u209a\u2093, px");
    for (const size_t i : {5, 6}) columns[i].set_group("found, %");
    blocks.push_back(
        TableBlock(absl::StrCat("Errors of recording ", recording.recording()), columns, rows));
  }
  ReportBlocks crops;
  if (!recording.recorded_crop_png().empty()) {
    crops.push_back(PictureBlock(recording.recorded_crop_png(), "recorded", "recorded", true));
  }
  if (!recording.simulated_crop_png().empty()) {
    crops.push_back(PictureBlock(recording.simulated_crop_png(), "simulated", "simulated", true));
  }
  if (!crops.empty()) blocks.push_back(GroupBlock(v1::ReportGroup::ROW, std::move(crops)));
  if (blocks.empty()) blocks.push_back(RemarkBlock("There is nothing to compare."));
  return CardBlock(absl::StrCat("Recording ", recording.recording(),
                                recording.file().empty() ? "" : ": ", recording.file()),
                   VerifiedSetup(recording), std::move(blocks));
}

ReportBlocks RecordingBlocks(const v1::Verification& verification) {
  if (verification.recordings().empty()) return {};
  ReportBlocks cards;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    cards.push_back(RecordingCard(recording));
  }
  return {RemarkBlock(
              "u\u209a\u2093 is the scatter of the line, found the part of the columns in which "
              "the line was found. Crops are scaled alike."),
          GroupBlock(v1::ReportGroup::THREE_COLUMNS, std::move(cards))};
}

// The answer in a sentence: the channel with the largest mean error stands for all.
void AddVerificationFinding(const v1::Verification& verification, v1::Report* report) {
  if (verification.summary().empty()) return;
  const auto largest = [&](ErrorOfChannel error) {
    double found = kNotCompared;
    for (const v1::ChannelSummary& summary : verification.summary()) {
      if (!(std::abs(error(summary)) <= std::abs(found))) found = error(summary);
    }
    return found;
  };
  const auto add = [&](const char* what, double error) {
    if (!std::isfinite(error) || std::abs(error) < 0.0005) {
      *report->add_finding() = PlainRun(absl::StrCat(
          what, std::isfinite(error) ? " agrees on average" : " could not be compared"));
      return;
    }
    *report->add_finding() = PlainRun(absl::StrCat(what, " is "));
    *report->add_finding() = StrongRun(absl::StrCat(QuantityText("e_relative", std::abs(error), 2),
                                                    " too ", error > 0 ? "low" : "high"));
    *report->add_finding() = PlainRun(" on average");
  };
  add("The simulated intensity", largest(MeanIntensityError));
  add(", the simulated scatter of the line", largest(MeanScatterError));
  *report->add_finding() =
      PlainRun(verification.summary_size() > 1 ? ", in the worst channel." : ".");
}

v1::ReportFact ErrorFact(const v1::Verification& verification, const char* name,
                         ErrorOfChannel error) {
  if (verification.summary_size() == 1) {
    const double only = error(verification.summary(0));
    return NumberFact(name, 100 * only, "%", ErrorText(only));
  }
  std::vector<std::string> values, channels;
  for (const v1::ChannelSummary& summary : verification.summary()) {
    values.push_back(ErrorText(error(summary)));
    channels.push_back(summary.channel());
  }
  return TextFact(name, absl::StrJoin(values, ", "), absl::StrJoin(channels, ", "));
}

}  // namespace

absl::StatusOr<v1::Report> VerificationReport(const v1::Verification& verification) {
  SIGHTLINE_RETURN_IF_ERROR(CheckProfiles(verification));
  const std::string name = verification.set().empty() ? "Recordings" : verification.set();
  v1::Report report;
  report.set_title(absl::StrCat(name, " \u2013 verification"));
  report.set_kind("verification");
  report.set_subject("Sightline \u00b7 verification");
  report.set_heading(absl::StrCat(name, ": recorded and simulated"));
  AddVerificationFinding(verification, &report);
  *report.add_figures() = NumberFact("recordings", verification.recordings_size(), "",
                                     absl::StrCat(verification.recordings_size()));
  if (!verification.summary().empty()) {
    *report.add_figures() =
        ErrorFact(verification, "mean intensity error e\u1d62", MeanIntensityError);
    *report.add_figures() =
        ErrorFact(verification, "mean error of scatter e\u1d64", MeanScatterError);
  }
  *report.mutable_warnings() = verification.warnings();
  AddSection(&report, "summary", "Summary", SummaryBlocks(verification));
  AddSection(&report, "dependence", "Where simulation and recordings differ",
             DependenceBlocks(verification, VerifiedChannels(verification)));
  AddSection(&report, "recordings", "Recording by recording", RecordingBlocks(verification));
  AddSection(&report, "provenance", "How to get this again",
             {TextBlock(absl::StrCat("Set ", name, ", seed ", verification.seed(), "."))});
  return report;
}

absl::Status WriteVerificationReport(const v1::Verification& verification,
                                     const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(const v1::Report report, VerificationReport(verification));
  return WriteReport(report, path);
}

}  // namespace sightline
