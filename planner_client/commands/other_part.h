// SPDX-License-Identifier: Apache-2.0
// The option --other-part of every command that reads a plan.
#pragma once

#include <CLI/CLI.hpp>

namespace sightline {

void AddOtherPartOption(CLI::App& app, bool* other_part);

}  // namespace sightline
