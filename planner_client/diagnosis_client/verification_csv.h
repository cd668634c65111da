// SPDX-License-Identifier: Apache-2.0
// Writes the figures of a verification as a table.
#pragma once

#include <string>

#include "sightline/v1/verification.pb.h"

namespace sightline {

// One line per recording and channel; the header names units. Values that were not determined are
// empty.
std::string VerificationCsv(const v1::Verification& verification);

}  // namespace sightline
