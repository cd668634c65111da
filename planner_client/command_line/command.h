// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace sightline {

// A command once its options are added: runs with what they were set to and returns the exit code.
using Command = std::function<int()>;

}  // namespace sightline
