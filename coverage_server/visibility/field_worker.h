// SPDX-License-Identifier: Apache-2.0
// The process that renders a share of the visibility field's directions.
#pragma once

#include <optional>

namespace sightline {

// For main(): if this process was started as a field worker, does the work and returns its exit
// code.
std::optional<int> MaybeRunFieldWorker(int argc, char** argv);

}  // namespace sightline
