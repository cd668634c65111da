// SPDX-License-Identifier: Apache-2.0
// The finding in one sentence for people, and a second one on the remainder.
#pragma once

#include <string>

#include "render_worker/diagnosis/selection/hypothesis.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// `best`: the hypothesis of `diagnosis.ranked(0)`. `diagnosis` needs everything but the finding. A
// second line follows if there is a remainder with a probability above 0.5.
std::string FindingText(const Hypothesis& best, const v1::Diagnosis& diagnosis);

}  // namespace sightline
