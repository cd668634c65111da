// SPDX-License-Identifier: Apache-2.0
// The finding in one sentence, for people.
#pragma once

#include <string>

#include "render_worker/diagnosis/selection/hypothesis.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// `best`: the hypothesis of `diagnosis.ranked(0)`.
std::string FindingText(const Hypothesis& best, const v1::Diagnosis& diagnosis);

}  // namespace sightline
