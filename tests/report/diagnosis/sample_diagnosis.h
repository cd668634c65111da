// SPDX-License-Identifier: Apache-2.0
// A diagnosis as it might come back: made up, but with every field filled.
#pragma once

#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

v1::Diagnosis SampleDiagnosis();

// Red, green and blue.
v1::Verification SampleVerification();

}  // namespace sightline
