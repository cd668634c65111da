// SPDX-License-Identifier: Apache-2.0
// Design of a further recording: which one distinguishes two hypotheses best.
#pragma once

#include <string>
#include <vector>

#include "render_worker/diagnosis/selection/hypothesis.h"
#include "render_worker/recordings/recorded_set.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Recordings like those of the set with another f-number, exposure, distance, focus or place in the
// field, and dark frames: at most `count` of them, largest expected gain first. The gain is the
// mutual information of the recording and of which hypothesis is true [bit], by Bhattacharyya's
// bound on the error of a test of two normal distributions d standard deviations apart: it is the
// entropy of the two probabilities times 1 - exp(-d^2 / 8) (Kailath, IEEE Trans. Commun. Technol.
// 15 (1967) 52).
std::vector<v1::NextRecording> NextRecordings(const RecordedSet& set, const Hypothesis& a,
                                              const Hypothesis& b, int count);

}  // namespace sightline
