// SPDX-License-Identifier: Apache-2.0
// The state behind the page of `sightline explore`, and its requests: JSON in, JSON out, without
// sockets.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "planner_client/explore/explore_request.h"
#include "planner_client/explore/latest_only.h"
#include "planner_client/explore/scan_view.h"
#include "planner_client/render_client/draft_picture.h"
#include "planning/strategy/gain_model.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// Largest number of scans of a manual plan, as for a searched one.
inline constexpr int kMaxExploredScans = 1000;

// A scan of the plan. Without a lens it has no setting.
struct ExploredScan {
  Measurement measurement;
  std::optional<v1::OpticalSetting> setting;
  bool locked = false;
  ScanCoverage exact;
};

struct SavedPlan {
  std::vector<std::string> files;  // as they are to be found
};

struct ExploreTask {
  Inspection inspection;
  std::shared_ptr<const TriangleMesh> part;
  TargetSet targets;
  // Coverage, fast and exact; thread-safe; must outlive the session.
  GainModel* gain_model = nullptr;
  // Scores plans and guides the search if the goal is uncertainty, else null. Thread-safe; must
  // outlive the session.
  GainModel* judge = nullptr;
  // If null, there are no pictures, for the reason in `no_pictures`.
  DrawDraft draw;
  std::string no_pictures;
  // Folder of plans, as shown to people. `saved_before` is true if it already has a plan.
  std::string folder;
  std::function<bool()> saved_before;
  // Overwrites the plan.
  std::function<absl::StatusOr<SavedPlan>(const std::vector<ExploredScan>&)> save;
  // Initial plan.
  std::vector<ExploredScan> scans;
};

// Thread-safe: a request waits only for requests that change the same state. Errors name field,
// value and allowed range.
class ExploreSession {
 public:
  // Opens a session and evaluates the initial scans exactly. Errors of the gain model.
  static absl::StatusOr<std::unique_ptr<ExploreSession>> Open(ExploreTask task);

  // The constant data: parameters and settings with their limits, numbers of targets, names.
  Json Setup() const;
  // Part, targets and rig for the 3-D view, as the JSON of a v1::ReportScene.
  const std::string& Scene() const { return scene_; }
  // Position of the controls, scans of the plan with their gains, coverage so far.
  Json State() const;

  // {"measurement": {...}, "setting": {...}, "exact": bool, "instead_of": index}: measured targets
  // of this scan in addition to the plan's other scans; stores the position of the controls.
  // Measurements must be in the inspection's domain.
  absl::StatusOr<Json> Evaluate(const Json& request);
  // {"measurement", "instead_of"}: number of targets with admissible uncertainty without and with
  // this scan; an infeasible scan adds nothing. {"cancelled": true} if a newer request replaced
  // this one. FAILED_PRECONDITION: the goal is not uncertainty.
  absl::StatusOr<Json> Admissible(const Json& request);
  // {"revision": of the state that the page shows, "action": "add" | "replace" | "remove" | "move"
  // | "load", "index", "to", "measurement", "setting"}: changes the plan and returns the state.
  // ABORTED, reason STATE_CHANGED: the plan has changed since that revision. FAILED_PRECONDITION:
  // the scan is infeasible, or the plan has the largest number of scans.
  absl::StatusOr<Json> ChangePlan(const Json& request);
  // {"from": "here" | "anywhere", "measurement", "instead_of"}: a good next scan, searched by fast
  // estimates and chosen by exact ones; {"cancelled": true} if another search or CancelSuggestion()
  // replaced this one.
  absl::StatusOr<Json> Suggest(const Json& request);
  void CancelSuggestion() { suggestions_.Cancel(); }
  // Progress of the search.
  Json SuggestionProgress() const;
  // {"measurement", "setting", "frame": number of the scan's frame; default the middle one}: a
  // draft of the image; {"cancelled": true} if a newer request replaced this one.
  // FAILED_PRECONDITION, reason NO_PICTURES: the message names what the inspection lacks.
  absl::StatusOr<Json> Picture(const Json& request);
  // {"overwrite": bool}: writes the plan. ALREADY_EXISTS, reason PLAN_EXISTS: there is a plan and
  // "overwrite" is false. FAILED_PRECONDITION: the plan has no scans.
  absl::StatusOr<Json> Save(const Json& request);

  // True if the plan has unsaved changes.
  bool HasUnsaved() const;
  // Scans of the plan, in its order.
  std::vector<ExploredScan> Scans() const;
  // Cancels running requests and rejects later ones.
  void Close();

 private:
  struct Position {
    Measurement measurement;
    std::optional<v1::OpticalSetting> setting;
  };

  explicit ExploreSession(ExploreTask task);

  absl::StatusOr<ScanCoverage> Exact(const Measurement& measurement);
  absl::StatusOr<std::optional<v1::OpticalSetting>> SettingOf(const Json& request) const;
  // Measurements of the plan, without the scan `without` if it is given.
  std::vector<Measurement> PlanScans(std::optional<int64_t> without) const;
  // Accumulated information that the search for a next scan starts from.
  absl::StatusOr<std::vector<float>> KnownShares(std::span<const Measurement> plan,
                                                 const TargetBits& covered) const;
  // Score by targets with admissible uncertainty; each plan is scored only once.
  absl::StatusOr<PlanScore> Score(const std::vector<Measurement>& plan);
  // Targets that the plan covers, without the scan `without` if it is given.
  TargetBits PlanCoverage(std::optional<int64_t> without) const;
  StageTravel TravelOf(const Measurement& measurement, const ScanCoverage& exact) const;
  Json EvaluationJson(const Measurement& measurement, const ScanCoverage& coverage, bool exact,
                      const TargetBits& plan) const;
  Json StateLocked() const;
  std::string Obstacle(const Measurement& measurement, ScanFeasibility feasibility) const;

  const ExploreTask task_;
  const std::string scene_;
  v1::OpticalSetting default_setting_;

  mutable std::mutex mutex_;  // of the state below
  int64_t revision_ = 1;
  int64_t saved_revision_ = 1;
  int64_t plan_revision_ = 1;  // revision of the last change of scans
  Position position_;
  std::vector<ExploredScan> scans_;

  std::mutex exact_mutex_;  // guards the recent evaluations, newest first
  std::deque<std::pair<Measurement, ScanCoverage>> exact_;

  std::mutex score_mutex_;  // guards the recent scores of plans, newest first
  std::deque<std::pair<std::vector<Measurement>, PlanScore>> scores_;

  LatestOnly suggestions_, pictures_, judgements_;
  std::mutex save_mutex_;
  std::atomic<int64_t> search_done_{0}, search_budget_{0}, search_best_{0};
  std::atomic<bool> searching_{false};
};

}  // namespace sightline
