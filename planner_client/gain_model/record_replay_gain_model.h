// SPDX-License-Identifier: Apache-2.0
// Records answers of a gain model in a file and replays them, so that interrupted planning goes on.
//
// A strategy is a deterministic function of what the gain model answers. Run again with the answers
// of the broken run it asks the same questions in the same order, at the speed of reading, until
// the file ends; from there on it asks the gain model. The plan is the same, byte for byte, as if
// nothing had happened.
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
  // Takes a sentence about the file that people should know.
  using Remark = std::function<void(const std::string&)>;

  // `fingerprint` names everything that the answers depend on (part, inspection, program). A file
  // of another fingerprint is written anew. An answer that is damaged, was not written whole or is
  // to another query is asked again, and so are those behind it. `remark`, which may be empty,
  // hears of all of that. INTERNAL: the file cannot be opened for writing.
  static absl::StatusOr<std::unique_ptr<RecordReplayGainModel>> Open(
      std::unique_ptr<GainModel> gain_model, const std::string& file,
      const std::string& fingerprint, Remark remark = {});

  // Gives back the gain model that it was opened with, after which it answers nothing any more.
  std::unique_ptr<GainModel> Release() { return std::move(gain_model_); }

  // Queries answered from the file so far.
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
  // As many as the gain model counts where it answers all queries itself: its count is kept with
  // every answer, so that plans with and without a journal are equal.
  int64_t evaluations() const override { return evaluations_; }

  std::vector<ShareStep> steps() const override { return gain_model_->steps(); }
  bool ScoresPlans() const override { return gain_model_->ScoresPlans(); }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override;
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override;

 private:
  RecordReplayGainModel(std::unique_ptr<GainModel> gain_model, std::string file, Remark remark)
      : gain_model_(std::move(gain_model)), file_(std::move(file)), remark_(std::move(remark)) {}

  // The next answer of the file if it is to this query and whole; ends the replay if it is not.
  bool NextAnswer(uint64_t query, std::string* answer);
  void EndReplay(const std::string& why);
  void Append(uint64_t query, const std::string& answer);
  // From the file, or from `ask` and then into the file.
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
