// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/reduction/start_from_images.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/str_format.h"
#include "core/recordings/expected_line.h"
#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

// A row mean above this fraction of the largest number is clipped in a good part of its columns.
constexpr double kClipped = 0.95;
// A clipped line is at most so many times as high as the clip level: the flanks, where the halo
// counts as well, say no more.
constexpr double kMostOverClip = 30;
constexpr double kFaint_dn = 3;

struct SeenProfile {
  double height_dn = 0, sigma_px = 0;
};

// Width of the part of the profile around its highest row that is above a level, with linear
// interpolation at both ends.
double WidthAbove(const std::vector<double>& profile, size_t peak, double level) {
  const auto edge = [&](int step) {
    auto row = static_cast<int>(peak);
    const int size = static_cast<int>(profile.size());
    while (row + step >= 0 && row + step < size && profile[row + step] > level) row += step;
    const int next = row + step;
    if (next < 0 || next >= size) return static_cast<double>(row);
    return row + step * (profile[row] - level) / (profile[row] - profile[next]);
  };
  return edge(1) - edge(-1);
}

std::optional<SeenProfile> ProfileOf(const Image<uint16_t>& image, double largest_dn) {
  if (image.empty()) return std::nullopt;
  std::vector<double> profile;
  for (int row = 0; row < image.rows_px; ++row) {
    double sum = 0;
    for (int column = 0; column < image.columns_px; ++column) sum += image.At(row, column);
    profile.push_back(sum / image.columns_px);
  }
  const double dark_dn = UpperMedian(profile);
  for (double& value : profile) value -= dark_dn;
  const auto peak =
      static_cast<size_t>(std::max_element(profile.begin(), profile.end()) - profile.begin());
  const double height_dn = profile[peak], clip_dn = kClipped * (largest_dn - dark_dn);
  if (height_dn < kFaint_dn) return std::nullopt;
  if (height_dn < clip_dn) {
    // Full width at half maximum of a Gaussian: 2.355 standard deviations.
    return SeenProfile{height_dn, WidthAbove(profile, peak, 0.5 * height_dn) / 2.3548};
  }
  const double clipped_px = WidthAbove(profile, peak, clip_dn);
  const double half_px = WidthAbove(profile, peak, 0.5 * clip_dn);
  // Widths of a Gaussian of height A at the levels c and c/2: w^2 = 8 sigma^2 log(A / level).
  const double variance = (half_px * half_px - clipped_px * clipped_px) / (8 * std::log(2.0));
  const double least = clipped_px * clipped_px / (8 * std::log(kMostOverClip));
  const double sigma2 = std::max(variance, least);
  return SeenProfile{clip_dn * std::exp(clipped_px * clipped_px / (8 * sigma2)), std::sqrt(sigma2)};
}

}  // namespace

std::vector<std::string> StartFromImages(const std::vector<Image<uint16_t>>& raw_dn,
                                         RecordingSet* set) {
  const bool power = set->uncertainty.power_relative >= kUnknownPower;
  const bool divergence = set->uncertainty.divergence_relative >= kUnknownDivergence;
  if (raw_dn.empty() || !(power || divergence)) return {};
  std::vector<double> widths, heights, seen_sigma;
  std::vector<std::pair<size_t, SeenProfile>> seen;
  for (size_t i = 0; i < raw_dn.size(); ++i) {
    if (set->recordings[i].kind != RecordingKind::kLaser) continue;
    if (const auto profile = ProfileOf(raw_dn[i], set->camera.largest_dn())) {
      seen.emplace_back(i, *profile);
    }
  }
  if (seen.empty()) return {};
  std::vector<std::string> notes;
  const auto expected = [&](size_t i) { return ExpectLine(*set, set->recordings[i]); };
  if (divergence) {
    // The beam alone is scaled, so that the width of the lens is found with a beam of none.
    const Laser before = set->laser;
    set->laser.divergence_rad = 1e-9;
    set->laser.beam_quality_m2 = 1e-9;
    std::vector<double> other;
    for (const auto& [i, profile] : seen) other.push_back(expected(i).width_px);
    set->laser = before;
    for (size_t k = 0; k < seen.size(); ++k) {
      const auto& [i, profile] = seen[k];
      const double nominal = expected(i).width_px;
      const double lens2 = std::min(other[k] * other[k], 0.9 * nominal * nominal);
      const double beam2 = std::max(profile.sigma_px * profile.sigma_px - lens2,
                                    0.04 * profile.sigma_px * profile.sigma_px);
      widths.push_back(std::sqrt(beam2 / (nominal * nominal - lens2)));
      seen_sigma.push_back(profile.sigma_px);
    }
    // Waist and far field both, so that the width changes by this factor at any distance.
    const double factor = UpperMedian(widths);
    set->laser.divergence_rad *= factor;
    set->laser.beam_quality_m2 *= factor * factor;
    notes.push_back(absl::StrFormat(
        "laser.divergence_rad is not stated: %.3g is taken, with which the line is as wide as in "
        "the images (%.2f px, standard deviation)",
        set->laser.divergence_rad, UpperMedian(seen_sigma)));
  }
  if (power) {
    for (const auto& [i, profile] : seen) {
      heights.push_back(profile.height_dn / expected(i).CrestDn(set->camera, 0));
    }
    set->laser.power_w *= UpperMedian(heights);
    notes.push_back(absl::StrFormat(
        "laser.power_w is not stated: %.3g is taken, with which the line is as bright as in the "
        "images at the exposure times given or assumed",
        set->laser.power_w));
  }
  return notes;
}

}  // namespace sightline
