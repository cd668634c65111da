// SPDX-License-Identifier: Apache-2.0
// Parallel work on the tiles of an image.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "render_worker/light_transport/light_transport.h"

namespace sightline {

// Calls work(i) once for every i in [0, count), in any order; each call must write to its own
// slot. Reports progress between `from` and `to`. CANCELLED after the running calls have
// finished.
absl::Status ForEachTile(int count, int threads, const TransportProgress& progress, double from,
                         double to, const std::function<void(int)>& work);

}  // namespace sightline
