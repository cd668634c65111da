// SPDX-License-Identifier: Apache-2.0
// The answer for a set in the form of the recordings format, section 5 (docs/diagnosis.md).
#pragma once

#include <string>

#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// `ranked` has one entry per leading effect: explanations that begin with the same effect, alone or
// with others, share one entry with the sum of their probabilities and the parameters of the most
// probable one. `also_present`: further effects of the first explanation, each with the summed
// probability of all explanations that contain it. `remainder`: difference left by the first
// explanation, if the diagnosis has one. Numbers that are not finite are left out.
std::string AnswerJson(const v1::Diagnosis& diagnosis);

}  // namespace sightline
