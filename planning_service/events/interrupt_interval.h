// SPDX-License-Identifier: Apache-2.0
// The time between two checks of `interrupted` while a receiver waits for a server: short enough to
// give up within 50 ms.
#pragma once

#include <chrono>

namespace sightline {

inline constexpr std::chrono::milliseconds kInterruptInterval{20};

}  // namespace sightline
