// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "absl/strings/str_format.h"
#include "core/frame_light/frame_light.h"

namespace sightline {
namespace {

// A slope of print over paper is taken as clear if this limit is two standard errors away.
constexpr double kMostlyLens = 0.7;
// Light squares next to the line are brighter than far ones by this factor if there is a halo.
constexpr double kHaloIsThere = 1.3;
// A weaker halo is said if its slope of print over paper is known to this standard error: the
// slopes of a halo in the lens, 1, and on the board, about 0.1, then differ by six of them.
constexpr double kClearSlope = 0.15;
// Patterns along the line that agree between frames, and differ along it, by this much.
constexpr double kSamePattern = 0.5, kUneven = 1.3;
// Exponents of shot noise: 1 in linear numbers, 2 - 2.2 in numbers with a gamma of 2.2.
constexpr double kLinearExponent = 1, kGammaExponent = -0.2;

void AddHalo(const FrameLight& light, std::vector<std::string>* findings) {
  const double slope = light.print_over_paper, error = light.print_over_paper_error;
  const HaloBin &near = light.halo.front(), &far = light.halo.back();
  const std::string there = absl::StrFormat(
      "light squares have %.0f DN at %.0f mm from the line and %.0f DN at %.0f mm. "
      "Dark squares show %.2f (standard error %.2f) of the change",
      near.paper_dn, 1e3 * near.from_line_m, far.paper_dn, 1e3 * far.from_line_m, slope, error);
  if (slope + 2 * error < kMostlyLens) {
    findings->push_back("Halo on the board: " + there +
                        ", so at most this part of it can come from lens or sensor.");
  } else if (slope - 2 * error > kMostlyLens) {
    findings->push_back("Halo in lens or sensor: " + there + ", although they reflect less.");
  } else {
    findings->push_back("Halo: " + there +
                        ", which does not distinguish the board from lens and sensor.");
  }
}

}  // namespace

std::vector<std::string> LightFindings(const FrameLight& light) {
  std::vector<std::string> findings;
  if (light.frame_count == 0) return findings;
  const bool strong = !light.halo.empty() &&
                      light.halo.front().paper_dn > kHaloIsThere * light.halo.back().paper_dn;
  const bool measured = !light.halo.empty() && light.print_over_paper_error > 0 &&
                        light.print_over_paper_error < kClearSlope;
  if (strong || measured) {
    AddHalo(light, &findings);
  }
  const auto most =
      std::max_element(light.along_line.begin(), light.along_line.end(),
                       [](const auto& a, const auto& b) { return a.relative < b.relative; });
  const auto least =
      std::min_element(light.along_line.begin(), light.along_line.end(),
                       [](const auto& a, const auto& b) { return a.relative < b.relative; });
  if (most != light.along_line.end() && light.along_line_correlation > kSamePattern &&
      most->relative > kUneven * least->relative) {
    findings.push_back(absl::StrFormat(
        "Light that moves with the scanner: beside the line it is %.1f times as strong at %.0f px "
        "along the line as at %.0f px, at the same places of the image in all frames (correlation "
        "%.2f). Light that a part of the scanner reflects onto the target does so; an uneven laser "
        "line does so too.",
        most->relative / least->relative, most->along_px, least->along_px,
        light.along_line_correlation));
  }
  for (const BrightPlace& place : light.bright) {
    findings.push_back(absl::StrFormat(
        "A bright part moves with the scanner: about (%.0f, %.0f) px the image is clipped in up to "
        "%d of %d frames, away from the line.",
        place.image_px.x(), place.image_px.y(), place.frame_count, light.frame_count));
  }
  return findings;
}

std::vector<std::string> NotDetermined(const FrameLight& light) {
  std::vector<std::string> texts;
  if (light.frame_count == 0) {
    texts.emplace_back("All of the light: fewer than four frames show enough of the board.");
    return texts;
  }
  if (light.clipped_fraction > 0.1) {
    texts.push_back(absl::StrFormat(
        "Height, width and speckle of the line, beam focus and laser power: the line is clipped in "
        "%.0f %% of its rows or columns.",
        100 * light.clipped_fraction));
  }
  texts.emplace_back(
      "Exposure time, f-number, gain in electrons and dark signal: there are no dark frames and no "
      "second exposure.");
  const double p = light.noise_exponent, error = light.noise_exponent_error;
  const std::string measured = absl::StrFormat(
      "Away from the line the variance of the noise grows with the level to the power %.2f "
      "(standard error %.2f). ",
      p, error);
  if (p - 2 * error > kLinearExponent + 0.3) {
    texts.push_back("Gamma: " + measured +
                    "That is more than shot noise (1 in linear numbers), so texture or speckle are "
                    "part of it, which have the power 2 with any gamma.");
  } else if (p - 2 * error > kGammaExponent + 0.3) {
    texts.push_back(
        "Gamma, in part: " + measured +
        "Shot noise has 1 in linear numbers and -0.2 with a gamma of 2.2; unless texture "
        "adds to it, the numbers are nearer to linear.");
  } else {
    texts.push_back("Gamma: " + measured +
                    "Shot noise with a gamma of 2.2 has -0.2: the numbers may be encoded.");
  }
  return texts;
}

}  // namespace sightline
