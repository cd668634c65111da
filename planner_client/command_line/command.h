// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace sightline {

// A command whose options have been added: runs with their values and returns the exit code.
using Command = std::function<int()>;

}  // namespace sightline
