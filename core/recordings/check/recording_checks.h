// SPDX-License-Identifier: Apache-2.0
// State that the checks of recordings share: the set, its images so far, and the findings.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/expected_line.h"
#include "core/recordings/raw_numbers.h"
#include "core/recordings/recordings.h"
#include "core/statistics/order_statistics.h"
#include "core/status/stop_check.h"

namespace sightline {

// The upper median of the values; 0 without any.
inline double MedianOf(std::vector<double> values) {
  return values.empty() ? 0 : UpperMedian(std::move(values));
}

// The line as it is seen in the rows' means of the brightest channel.
struct SeenLine {
  bool found = false;
  double row_px = 0;
  double energy_dn = 0;        // of a column, summed across the line
  double energy_error_dn = 0;  // standard error by the scatter of the other rows
};

class RecordingChecks {
 public:
  RecordingChecks(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                  const StopCheck& stop)
      : set_(set), raw_(raw_dn), stop_(stop), count_(static_cast<int>(set.recordings.size())) {
    result_.recordings.resize(set.recordings.size());
  }

  RecordingCheck Run();

 private:
  enum class Severity { kError, kWarning };
  struct Finding {
    Severity severity;
    std::string reason, remark;
    std::vector<int> recordings;  // empty: the set as a whole
  };

  const std::string& File(int i) const { return set_.recordings[i].file; }
  bool IsLaser(int i) const { return set_.recordings[i].kind == RecordingKind::kLaser; }
  bool IsDark(int i) const { return set_.recordings[i].kind == RecordingKind::kDark; }
  bool Has(int i) const { return !raw_[i].empty(); }
  int Largest() const { return static_cast<int>(set_.camera.largest_dn()); }

  // Findings with the same reason become one.
  void Find(Severity severity, const std::string& reason, const std::string& remark,
            std::vector<int> recordings);
  void Error(const std::string& reason, const std::string& remark, std::vector<int> recordings) {
    Find(Severity::kError, reason, remark, std::move(recordings));
  }
  void Warning(const std::string& reason, const std::string& remark, std::vector<int> recordings) {
    Find(Severity::kWarning, reason, remark, std::move(recordings));
  }

  void Report();
  void CollectNumbers();

  // Half of an image's pixels are at or below it.
  int MedianValue(int i) const;

  // Nominal mean of a dark pixel at zero exposure time.
  double NominalDark() const {
    return set_.camera.black_level_dn +
           set_.camera.gain_dn_per_electron * set_.camera.dark_mean_electrons;
  }
  double NominalDarkNoise() const {
    return std::hypot(set_.camera.gain_dn_per_electron * set_.camera.dark_noise_electrons,
                      std::sqrt(1 / 12.0));
  }
  // Seen: median of the dark frames, else of the laser recordings' (mostly dark) pixels.
  double DarkLevel() const;
  // The checks, in the order of Run; each may use what those before it have seen.
  void CheckNumbers();
  void CheckBlankAndClipped();
  void CheckDuplicates();
  void CheckBlocks();
  void FindLines();
  double ExpectedEnergyDn(int i) const;
  void CheckLight();
  void CheckBrightness();
  void CheckPlace();
  void CheckColours();
  void CheckDarkFrames();
  void CheckLinearity();
  void CheckGamma();
  void CheckSpeckle();

  // Reports quantities for which the set is too small.
  void CheckContents();

  const RecordingSet& set_;
  const std::vector<Image<uint16_t>>& raw_;
  const StopCheck& stop_;
  const int count_;
  RecordingCheck result_;
  std::vector<Finding> findings_;
  std::map<std::pair<Severity, std::string>, size_t> finding_of_;
  Histogram all_;
  int largest_seen_ = 0;
  bool out_of_range_ = false, narrow_ = false;
  std::set<int> blank_, no_line_;
  std::vector<ExpectedLine> expected_;
  std::vector<SeenLine> lines_;
  double median_ratio_ = 1;
};

}  // namespace sightline
