// SPDX-License-Identifier: Apache-2.0
// Charts of a verification: how its four quantities depend on the set-up (thesis, chapter 5), and
// the profiles of a recording.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "report/document/report_parts.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

// An unset value is no number (NaN): charts leave it out, texts show a dash.
double IntensityError(const v1::ChannelVerification& channel);
double ScatterError(const v1::ChannelVerification& channel);
double RecordedScatterPx(const v1::ChannelVerification& channel);
double SimulatedScatterPx(const v1::ChannelVerification& channel);

// The set-up of a recording in words.
std::string VerifiedSetup(const v1::RecordingVerification& recording);

// Four charts for each quantity of chapter 5, one for each abscissa; `channels` are those that
// occur.
ReportBlocks DependenceBlocks(const v1::Verification& verification,
                              const std::vector<std::string>& channels);

// Recorded and simulated profiles of all channels about the line. Without series: there are none.
v1::ReportChart ProfileChart(const v1::RecordingVerification& recording);

}  // namespace sightline
