// SPDX-License-Identifier: Apache-2.0
// The process that renders a share of the visibility field's directions.
#pragma once

#include <optional>

namespace sightline {

// To be called by main(). If this process was started as a field worker, does the work and returns
// the exit code; else nullopt.
std::optional<int> MaybeRunFieldWorker(int argc, char** argv);

}  // namespace sightline
