// SPDX-License-Identifier: Apache-2.0
// Charts of a verification: dependence of its four quantities on the set-up (thesis, chapter 5),
// and the profiles of a recording.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "report/document/report_parts.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

// The value, or NaN if it is unset: charts leave it out, texts show a dash.
double IntensityError(const v1::ChannelVerification& channel);
double ScatterError(const v1::ChannelVerification& channel);
double RecordedScatterPx(const v1::ChannelVerification& channel);
double SimulatedScatterPx(const v1::ChannelVerification& channel);

// Text of a recording's set-up.
std::string VerifiedSetup(const v1::RecordingVerification& recording);

// Four charts for each quantity of chapter 5, one per abscissa; `channels`: the existing
// ones.
ReportBlocks DependenceBlocks(const v1::Verification& verification,
                              const std::vector<std::string>& channels);

// Recorded and simulated profiles of all channels around the line; without series if there are
// none.
v1::ReportChart ProfileChart(const v1::RecordingVerification& recording);

}  // namespace sightline
