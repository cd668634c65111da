// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/diagnose_scene.h"

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "render_worker/evidence/answer_text.h"
#include "render_worker/scene_diagnosis/answer/added_light.h"
#include "render_worker/scene_diagnosis/answer/calibrated_scene.h"
#include "render_worker/scene_diagnosis/answer/explanations.h"
#include "render_worker/scene_diagnosis/answer/finding_text.h"
#include "render_worker/scene_diagnosis/answer/fit_messages.h"
#include "render_worker/scene_diagnosis/block/block_means.h"
#include "render_worker/scene_diagnosis/check_scene.h"
#include "render_worker/scene_diagnosis/fit/compare_paths.h"
#include "render_worker/scene_diagnosis/fit/path_fit.h"
#include "render_worker/scene_diagnosis/light_paths.h"

namespace sightline {
namespace {

// Share of light transport in the reported progress; the rest are fits. Chosen after the usual
// share of the time.
constexpr double kTransportShare = 0.75;
// Held-out chi squared per degree of freedom above which a warning calls the best model incomplete.
// Chosen: 1 plus several standard deviations sqrt(2/n) of some hundred blocks.
constexpr double kIncompleteFit = 1.5;

absl::StatusOr<SceneLight> TraceLight(const RecordedScene& scene,
                                      const SceneDiagnosisSettings& settings,
                                      const SceneDiagnosisProgress& report) {
  LightPathSettings tracing;
  tracing.seed = settings.seed;
  tracing.threads = settings.threads;
  tracing.max_bounces = settings.max_bounces;
  tracing.max_image_bytes = settings.max_image_bytes;
  tracing.cancelled = settings.cancelled;
  tracing.progress = [&report](double fraction) {
    report(kTransportShare * fraction, "expected images by light path");
  };
  return TraceLightPaths(scene, tracing);
}

// `traced_all`: false if tracing was interrupted; the traced recordings are then compared with
// single effects only, which takes little time and is not interrupted again.
PathComparison CompareTraced(const RecordedScene& scene, const SceneLight& light,
                             const BlockMeans& blocks, const SceneDiagnosisSettings& settings,
                             bool traced_all, const SceneDiagnosisProgress& report) {
  PathComparisonSettings comparing;
  comparing.excluded_effects = settings.excluded_effects;
  comparing.max_effects = settings.max_effects;
  comparing.singles_only = !traced_all;
  PathComparison comparison =
      ComparePaths(scene, light, blocks, comparing, [&](double fraction, std::string_view what) {
        report(kTransportShare + (1 - kTransportShare) * fraction, what);
        return !traced_all || settings.cancelled == nullptr || !*settings.cancelled;
      });
  comparison.finished = comparison.finished && traced_all;
  return comparison;
}

v1::Diagnosis DescribeComparison(const RecordedScene& scene, const SceneLight& light,
                                 const BlockMeans& blocks, const PathComparison& comparison) {
  const BlockGrid& grid = blocks.grid();
  const std::vector<const PathHypothesis*> ranked = RankHypotheses(comparison.hypotheses);
  const PathHypothesis& best = *ranked.front();
  const PathFit& null_fit = comparison.hypotheses.front().best;
  const AddedLight added = FindAddedLight(scene, light, blocks, best, null_fit);
  v1::Diagnosis diagnosis;
  AddExplanations(scene, comparison, ranked, added.region, &diagnosis);
  if (comparison.finished) {
    diagnosis.set_verdict(best.effects.empty() ? "none" : "effect");
    const std::string left = RemainderText(diagnosis);
    diagnosis.set_finding(
        absl::StrCat(SceneFinding(scene, best, null_fit, added), left.empty() ? "" : "\n", left));
  } else {
    diagnosis.set_verdict("interrupted");
    diagnosis.set_finding(InterruptedSceneFinding(
        best, comparison, grid.recordings, static_cast<int>(scene.recordings.recordings.size())));
  }
  *diagnosis.mutable_held_out_improvement() = HeldOutImprovementOf(grid, null_fit, best.best);
  *diagnosis.mutable_null_fit() = PathFitMessage(grid, null_fit);
  *diagnosis.mutable_model_fit() = PathFitMessage(grid, best.best);
  AddDetectableStrengths(comparison.hypotheses, &diagnosis);
  AddResidualMaps(grid, null_fit, best.best, &diagnosis);
  // Values of an interrupted comparison may still change: nothing should be planned with them.
  if (!comparison.finished) return diagnosis;
  AddCalibration(scene, best.best, &diagnosis);
  if (best.best.HeldOutChiSquaredPerDegree() > kIncompleteFit) {
    diagnosis.add_warnings(absl::StrFormat(
        "held-out chi^2 per degree of freedom is still %.2f: something else differs too",
        best.best.HeldOutChiSquaredPerDegree()));
  }
  return diagnosis;
}

}  // namespace

absl::StatusOr<v1::Diagnosis> DiagnoseScene(const RecordedScene& scene,
                                            const SceneDiagnosisSettings& settings,
                                            const SceneDiagnosisProgress& progress) {
  SIGHTLINE_RETURN_IF_ERROR(CheckRecordedScene(scene));
  if (settings.max_effects < 1 || settings.max_effects > 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_effects: is ", settings.max_effects, ", must be 1 or 2 for a part"));
  }
  const SceneDiagnosisProgress report = [&progress](double fraction, std::string_view what) {
    if (progress) progress(fraction, what);
  };
  SIGHTLINE_ASSIGN_OR_RETURN(const SceneLight light, TraceLight(scene, settings, report));
  const size_t recordings = light.surfaces.size();
  const bool traced_all = recordings == scene.recordings.recordings.size();
  const BlockMeans blocks(scene, static_cast<int>(recordings), settings.block_px,
                          settings.tile_blocks, settings.registration_px);
  const PathComparison comparison =
      CompareTraced(scene, light, blocks, settings, traced_all, report);
  v1::Diagnosis diagnosis = DescribeComparison(scene, light, blocks, comparison);
  diagnosis.set_set(scene.recordings.name);
  diagnosis.set_seed(static_cast<int64_t>(settings.seed));
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
