// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/converter/converter_departures.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/recordings/raw_numbers.h"
#include "render_worker/sensor_diagnosis/converter/code_widths.h"
#include "render_worker/sensor_diagnosis/departure_names.h"

namespace sightline {
namespace {

// Smallest share of missing codes, and of dark pixels at 0, that matters. Chosen; data that were
// digitised once miss nearly none (MissingValueShare).
constexpr double kMaterialMissing = 0.05, kMaterialClipped = 1e-4;

// The outcome of these tests is certain, not a matter of chance: p is 0 or 1.
double CertainP(bool found) { return found ? 0.0 : 1.0; }

Departure MissingCodes(const Histogram& histogram, int largest) {
  const int step = CommonPowerOfTwo(histogram);
  const double missing = MissingValueShare(histogram, UpperLimit(histogram, largest));
  // Each code that counts as missing would be expected at least eight times.
  const bool found = step > 1 || missing > kMaterialMissing;
  Departure departure{.effect = NamesInVocabulary().missing_codes,
                      .stage = "readout",
                      .description = absl::StrFormat(
                          "numbers are multiples of %d; %.2g %% of those that should occur do not",
                          step, 100 * missing),
                      .p_value = CertainP(found),
                      .material = found};
  departure.parameters = {{"step", "DN", static_cast<double>(step), 0},
                          {"missing", "", missing, 0}};
  return departure;
}

Departure ClippedBlackLevel(double share_of_dark_at_zero) {
  const bool found = share_of_dark_at_zero > kMaterialClipped;
  Departure departure{
      .effect = std::string(kBlackLevelClipped),
      .stage = "readout",
      .description = absl::StrFormat(
          "%.3g %% of the pixels are 0 in the dark: the black level is too low, dark noise and "
          "dark level are wrong by what is cut off",
          100 * share_of_dark_at_zero),
      .p_value = CertainP(found),
      .material = found};
  departure.parameters.push_back({"share_at_zero", "", share_of_dark_at_zero, 0});
  return departure;
}

}  // namespace

std::vector<Departure> ConverterDepartures(const std::vector<int64_t>& counts, int bit_depth_bit,
                                           double share_of_dark_at_zero) {
  Histogram histogram(65536, 0);
  std::copy(counts.begin(), counts.end(), histogram.begin());
  const int largest = (1 << bit_depth_bit) - 1;
  return {MissingCodes(histogram, largest), OddEvenWidth(histogram, largest),
          ClippedBlackLevel(share_of_dark_at_zero)};
}

}  // namespace sightline
