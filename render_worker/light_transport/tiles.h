// SPDX-License-Identifier: Apache-2.0
// Work on the tiles of an image from several threads.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "render_worker/light_transport/light_transport.h"

namespace sightline {

// Calls work(i) once for every i in [0, count), in any order; results must go to slots of their
// own. Reports progress between `from` and `to`. CANCELLED: at most the calls under way were
// finished.
absl::Status ForEachTile(int count, int threads, const TransportProgress& progress, double from,
                         double to, const std::function<void(int)>& work);

}  // namespace sightline
