// SPDX-License-Identifier: Apache-2.0
// Which further recording would tell two explanations apart.
#pragma once

#include <string>
#include <vector>

#include "render_worker/diagnosis/selection/competition.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Recordings like those of the set with another f-number, exposure, distance, focus or place in the
// field, and dark frames; those that tell `a` from `b` best, at most `count`. The expected gain is
// the mutual information of the verdict and the recording, by Bhattacharyya's bound on the error of
// a test of two Gaussians [bit].
std::vector<v1::NextRecording> NextRecordings(const RecordedSet& set, const Candidate& a,
                                              const Candidate& b, int count);

}  // namespace sightline
