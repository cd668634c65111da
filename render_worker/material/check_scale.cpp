// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"
#include "render_worker/material/material.h"

namespace sightline {

std::optional<std::string> CheckScale(const Material& material, const std::string& name,
                                      double footprint_m) {
  const std::optional<double> measured_m = material.measured_scale_m();
  if (!measured_m.has_value() || !(footprint_m > 0)) return std::nullopt;
  const double ratio = footprint_m / *measured_m;
  if (ratio <= kScaleMismatchFactor && ratio >= 1 / kScaleMismatchFactor) return std::nullopt;
  return absl::StrCat("material \"", name, "\" was measured at a scale of ",
                      NumberText(*measured_m), " m, a pixel covers ", NumberText(footprint_m),
                      " m: they differ by more than a factor of ", NumberText(kScaleMismatchFactor),
                      ", so its roughness is that of another scale");
}

}  // namespace sightline
