// SPDX-License-Identifier: Apache-2.0
// Records answers of a gain model in a file and replays them, so that interrupted planning resumes.
//
// A strategy is a deterministic function of the gain model's answers. When it runs again with the
// recorded answers of the interrupted run, it sends the same queries in the same order, at the
// speed of reading. Where the file ends, it continues with the gain model. The plan is identical,
// byte for byte, to that of an uninterrupted run.
#pragma once

#include <cstdint>
#include <fstream>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

class RecordReplayGainModel final : public GainModel {
 public:
  // Receives a sentence about the file for people.
  using Remark = std::function<void(const std::string&)>;

  // `fingerprint` identifies everything that the answers depend on (part, inspection, program). A
  // file with another fingerprint is overwritten. An answer that is damaged, incomplete or for
  // another query is computed again, and so are all later ones. `remark` (may be empty) is called
  // in each of these cases. INTERNAL: the file cannot be opened for writing.
  static absl::StatusOr<std::unique_ptr<RecordReplayGainModel>> Open(
      std::unique_ptr<GainModel> gain_model, const std::string& file,
      const std::string& fingerprint, Remark remark = {});

  // Returns the wrapped gain model; this object must not be used afterwards.
  std::unique_ptr<GainModel> Release() { return std::move(gain_model_); }

  // Number of queries answered from the file so far.
  int64_t replayed_queries() const { return replayed_queries_; }

  const TargetBits& measurable() const override { return gain_model_->measurable(); }
  const TargetBits& validation_measurable() const override {
    return gain_model_->validation_measurable();
  }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override;
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override;
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  // Same count as that of the gain model without replay: it is stored with every answer, so that
  // plans with and without a journal are equal.
  int64_t evaluations() const override { return evaluations_; }

  std::vector<ShareStep> steps() const override { return gain_model_->steps(); }
  bool ScoresPlans() const override { return gain_model_->ScoresPlans(); }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override;
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override;

 private:
  RecordReplayGainModel(std::unique_ptr<GainModel> gain_model, std::string file, Remark remark)
      : gain_model_(std::move(gain_model)), file_(std::move(file)), remark_(std::move(remark)) {}

  // Reads the next answer of the file; ends the replay if it is incomplete or for another query.
  bool NextAnswer(uint64_t query, std::string* answer);
  void EndReplay(const std::string& why);
  void Append(uint64_t query, const std::string& answer);
  // Reads the answer from the file, or calls `ask` and appends the result.
  template <typename Answer>
  absl::StatusOr<Answer> AnswerTo(uint64_t query,
                                  const std::function<absl::StatusOr<Answer>()>& ask);

  std::unique_ptr<GainModel> gain_model_;
  const std::string file_;
  const Remark remark_;
  std::ifstream replay_;
  int64_t replay_end_ = 0;  // size of the file when it was opened
  bool replaying_ = false;
  std::ofstream append_;
  int64_t size_bytes_ = 0;
  int64_t evaluations_ = 0;
  int64_t replayed_queries_ = 0;
};

}  // namespace sightline
