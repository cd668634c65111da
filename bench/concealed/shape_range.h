// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace sightline::bench {

// Range from which a parameter is drawn that merely shapes an effect (a period, a place), in the
// parameter's unit. All other parameters of an effect are strengths.
struct ShapeRange {
  std::string_view parameter;
  double low, high;
  bool logarithmic = true;
  bool either_sign = false;
  bool of_full_scale = false;  // low and high are fractions of the converter's full scale
};

}  // namespace sightline::bench
