// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/residual_law.h"

#include <cmath>
#include <vector>

#include "render_worker/diagnosis/finding/setup_law/setup_law.h"

namespace sightline {

void AddLaws(const SetModel& model, const FitResult& null, const FitResult& best, uint64_t seed,
             v1::Diagnosis* diagnosis) {
  const RecordedSet& set = model.set();
  const size_t frames = set.frames.size();
  std::vector<double> sum(frames, 0), weight(frames, 0);
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.StatisticOf(e).kind() != StatisticKind::kProfile) continue;
    for (int row = 0; row < static_cast<int>(null.mean[e].size()); ++row) {
      const int frame = model.FrameOfComponent(e, row);
      // Rows in which the two models differ.
      const double change = best.mean[e][row] - null.mean[e][row];
      sum[frame] += change * (model.observed()[e][row] - null.mean[e][row]);
      weight[frame] += change * change;
    }
  }
  std::vector<SetupAmplitude> amplitudes;
  for (size_t f = 0; f < frames; ++f) {
    if (set.frames[f].plate_position_id < 0 || weight[f] <= 0) continue;
    SetupAmplitude amplitude = SetupOf(set.frames[f].nominal);
    // Root mean square of the change [DN], with the sign and size the recording gives it.
    amplitude.amplitude = sum[f] / std::sqrt(weight[f]);
    amplitude.standard_error = 0.1 * std::abs(amplitude.amplitude) + 1e-6;
    amplitudes.push_back(amplitude);
  }
  SetupLawSettings settings;
  settings.seed = seed;
  for (v1::SetupLaw& law : FindSetupLaws(amplitudes, settings)) *diagnosis->add_laws() = law;
}

}  // namespace sightline
