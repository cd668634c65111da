// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/finding_text.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {

std::string SceneFinding(const RecordedScene& scene, const PathHypothesis& best,
                         const PathFit& null_fit, const AddedLight& added) {
  const double null_held_out = null_fit.HeldOutChiSquaredPerDegree();
  if (best.effects.empty()) {
    return absl::StrFormat(
        "Nothing is missing from the model that these recordings could show (probability %.2f); "
        "held-out chi^2 per degree of freedom %.2f.",
        best.probability, null_held_out);
  }
  std::vector<std::string> descriptions;
  for (const LightPath* path : best.best.paths) {
    if (!path->nominal && path->effect != kUnknownLight) descriptions.push_back(path->description);
  }
  if (descriptions.empty()) {
    descriptions.push_back("light that none of the known paths explains");
  }
  std::string finding = absl::StrCat("Left out of the model: ", absl::StrJoin(descriptions, "; "));
  if (added.sum > 0 && added.laser_sum > 0) {
    absl::StrAppendFormat(&finding, ", %.2g %% of the direct laser light",
                          100 * added.sum / added.laser_sum);
  }
  const ExcessRegion& region = added.region;
  if (!region.surface.empty()) {
    absl::StrAppendFormat(&finding, ", most on surface \"%s\", %.1f electrons a pixel in %s",
                          region.surface, region.mean_electrons,
                          scene.recordings.recordings[static_cast<size_t>(region.recording)].file);
  }
  absl::StrAppendFormat(&finding,
                        "; with it held-out chi^2 per degree of freedom falls from %.2f to %.2f.",
                        null_held_out, best.best.HeldOutChiSquaredPerDegree());
  return finding;
}

std::string InterruptedSceneFinding(const PathHypothesis& best, const PathComparison& comparison,
                                    int recordings, int all_recordings) {
  const auto& hypotheses = comparison.hypotheses;
  const auto compared = static_cast<int>(hypotheses.size()) - 1;
  std::string so_far = "nothing was compared with the model as described yet";
  if (!best.effects.empty()) {
    so_far = absl::StrFormat("so far %s explains most, %.3g nats better than nothing left out",
                             best.Name(), best.log_predictive - hypotheses[0].log_predictive);
  } else if (compared > 0) {
    so_far = "so far nothing explains the recordings better than the model as described";
  }
  return absl::StrFormat(
      "Interrupted with %d of %d recordings computed and %d explanation%s compared: %s; held-out "
      "chi^2 per degree of freedom without any %.2f. This is no finding: what was not compared may "
      "explain more.",
      recordings, all_recordings, compared, compared == 1 ? "" : "s", so_far,
      hypotheses[0].best.HeldOutChiSquaredPerDegree());
}

}  // namespace sightline
