// SPDX-License-Identifier: Apache-2.0
// The part as dots at its targets, coloured by deviation, seen along its six axis directions.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/targets/target_set.h"
#include "report/document/report_parts.h"

namespace sightline {

struct SurfaceDeviations {
  const TargetSet* targets = nullptr;
  std::vector<float> deviations_m;  // one per target, positive outside
  std::vector<char> measured;       // one per target; 0: no points, drawn as a hollow dot
  double scale_m = 1e-4;            // > 0; the ends of the colour scale are at plus and minus this
};

// Red, green and blue for a deviation: blue inside, grey at 0, red outside. Values beyond the scale
// are clamped to its ends.
std::array<uint8_t, 3> DeviationColour(double deviation_m, double scale_m);

// The colour scale and six pictures. Nearer surfaces cover farther ones, as far as dots can.
// Hollow dots mark unmeasured targets. Empty without targets. INTERNAL: a picture cannot be
// encoded.
absl::StatusOr<ReportBlocks> DeviationViews(const SurfaceDeviations& surface);

}  // namespace sightline
