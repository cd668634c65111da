// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/check/check_recordings.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/image/image.h"
#include "core/recordings/check/recording_checks.h"
#include "core/recordings/recordings.h"
#include "core/status/stop_check.h"

namespace sightline {

RecordingCheck RecordingChecks::Run() {
  std::vector<void (RecordingChecks::*)()> steps = {
      &RecordingChecks::CollectNumbers, &RecordingChecks::CheckNumbers,
      &RecordingChecks::CheckBlankAndClipped, &RecordingChecks::CheckDuplicates};
  // Segments of slanted lines have steps where the shift of their columns changes: whole images are
  // checked before they are cut.
  const bool reduced = set_.posed && set_.format_version == 1;
  if (!reduced) steps.push_back(&RecordingChecks::CheckBlocks);
  if (set_.format_version == 1) {
    steps.insert(steps.end(), {&RecordingChecks::FindLines, &RecordingChecks::CheckLight,
                               &RecordingChecks::CheckBrightness, &RecordingChecks::CheckPlace,
                               &RecordingChecks::CheckColours, &RecordingChecks::CheckDarkFrames,
                               &RecordingChecks::CheckLinearity, &RecordingChecks::CheckGamma,
                               &RecordingChecks::CheckSpeckle, &RecordingChecks::CheckContents});
  }
  for (const auto step : steps) {
    if (!CheckStop(stop_).ok()) return {};
    (this->*step)();
  }
  Report();
  return std::move(result_);
}

void RecordingChecks::Find(Severity severity, const std::string& reason, const std::string& remark,
                           std::vector<int> recordings) {
  const auto [known, is_new] = finding_of_.try_emplace({severity, reason}, findings_.size());
  if (!is_new) {
    std::vector<int>& same = findings_[known->second].recordings;
    same.insert(same.end(), recordings.begin(), recordings.end());
    return;
  }
  findings_.push_back({severity, reason, remark, std::move(recordings)});
}

void RecordingChecks::Report() {
  for (const Finding& finding : findings_) {
    std::string where;
    constexpr size_t kNamed = 4;
    const size_t files = finding.recordings.size();
    for (size_t k = 0; k < files && k < (files <= kNamed + 1 ? files : kNamed); ++k) {
      absl::StrAppend(&where, k > 0 ? ", " : "", File(finding.recordings[k]));
    }
    if (files > kNamed + 1) absl::StrAppend(&where, " and ", files - kNamed, " more");
    const std::string message =
        where.empty() ? finding.reason : absl::StrCat(where, ": ", finding.reason);
    (finding.severity == Severity::kError ? result_.errors : result_.warnings).push_back(message);
    for (const int i : finding.recordings) {
      result_.recordings[i].remarks.push_back(finding.remark);
    }
  }
}

RecordingCheck CheckRecordings(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                               const StopCheck& stop) {
  return RecordingChecks(set, raw_dn, stop).Run();
}

}  // namespace sightline
