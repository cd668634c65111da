// SPDX-License-Identifier: Apache-2.0
// --other-part, which every command has that takes a plan.
#pragma once

#include <CLI/CLI.hpp>

namespace sightline {

void AddOtherPartOption(CLI::App& app, bool* other_part);

}  // namespace sightline
