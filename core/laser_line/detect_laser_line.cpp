// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/detect_laser_line.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/laser_line/profile_centre.h"
#include "core/laser_line/ridge_score.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::Status CheckOptions(const LaserLineOptions& options) {
  const auto error = [](const char* field, double value, const char* range) {
    return absl::InvalidArgumentError(
        absl::StrCat("laser line: ", field, " is ", value, ", must be in ", range));
  };
  if (!(options.ridge_sigma_px > 0.5 && options.ridge_sigma_px <= 20)) {
    return error("ridge_sigma_px", options.ridge_sigma_px, "(0.5, 20] px");
  }
  if (!(options.min_ridge_score_dn >= 0) || std::isinf(options.min_ridge_score_dn)) {
    return error("min_ridge_score_dn", options.min_ridge_score_dn, "[0, inf) DN/px^2");
  }
  if (options.half_window_px < 0 || options.half_window_px > 10000) {
    return error("half_window_px", options.half_window_px, "[0, 10000] px");
  }
  if (options.max_lines < 1) return error("max_lines", options.max_lines, "[1, inf)");
  if (std::isnan(options.saturation_dn)) {
    return error("saturation_dn", options.saturation_dn, "(-inf, inf) DN");
  }
  if (std::isinf(options.background_dn)) {
    return error("background_dn", options.background_dn, "(-inf, inf) DN");
  }
  return absl::OkStatus();
}

// Values that are no finite numbers become linear in between (constant beyond) along the column; 0
// in a column without any.
Image<float> WithoutGaps(const Image<float>& image) {
  Image<float> filled = image;
  for (int column = 0; column < image.columns_px; ++column) {
    int last = -1;  // finite row above
    for (int row = 0; row <= image.rows_px; ++row) {
      const bool end = row == image.rows_px;
      if (!end && !std::isfinite(image.At(row, column))) continue;
      for (int gap = last + 1; gap < row; ++gap) {
        const float below = end ? 0 : image.At(row, column);
        const float above = last < 0 ? below : image.At(last, column);
        const float share = static_cast<float>(gap - last) / static_cast<float>(row - last);
        filled.At(gap, column) = end ? above : above + share * (below - above);
      }
      last = row;
    }
  }
  return filled;
}

// A line crossing a column, before its position is known.
struct Candidate {
  double row = 0;
  double score = 0;
  double half_plateau = 0;  // of a plateau wider than the ridge scale sees, else 0
};

// Saturated runs wider than the ridge scale, each seen at its own: half width / sqrt(3). At the
// nominal scale they would show as two ridges, one along either edge.
void ReplaceWidePlateaus(const std::vector<double>& profile, const LaserLineOptions& options,
                         std::vector<Candidate>* candidates) {
  const int rows = static_cast<int>(profile.size());
  const double sigma = options.ridge_sigma_px;
  const int largest_gap = static_cast<int>(sigma);
  for (int start = 0; start < rows; ++start) {
    if (profile[start] < options.saturation_dn) continue;
    int end = start;  // last of the run; speckle leaves small gaps
    for (int row = start + 1; row < rows && row - end <= largest_gap + 1; ++row) {
      if (profile[row] >= options.saturation_dn) end = row;
    }
    const double half_width = (end - start + 1) / 2.0;
    const double scale = std::max(half_width / std::sqrt(3.0), sigma);
    // With its flanks a plateau this wide may already split.
    if (half_width > sigma) {
      std::erase_if(*candidates, [&](const Candidate& c) {
        return c.row >= start - sigma && c.row <= end + sigma;
      });
      // A plateau at the image's edge has no known centre.
      if (start > 0 && end < rows - 1) {
        Candidate plateau{(start + end) / 2.0, 0, half_width};
        // Second derivative on the column; times (scale / sigma)^2 it is that of a line of the same
        // height that fits the nominal scale.
        const GaussianDerivatives d = MakeGaussianDerivatives(scale);
        const int centre = (start + end) / 2;
        for (int k = -d.radius_px; k <= d.radius_px; ++k) {
          plateau.score -= d.second[k + d.radius_px] * profile[std::clamp(centre + k, 0, rows - 1)];
        }
        plateau.score *= scale * scale / (sigma * sigma);
        if (plateau.score > 0 && plateau.score >= options.min_ridge_score_dn) {
          candidates->push_back(plateau);
        }
      }
    }
    start = end;
  }
}

// Strongest first; a weaker one within two sigma of a stronger one is the same line.
std::vector<Candidate> FindCandidates(const std::vector<double>& profile,
                                      const Image<float>& scores, int column,
                                      const LaserLineOptions& options) {
  std::vector<Candidate> candidates;
  const int rows = scores.rows_px;
  for (int row = 0; row < rows; ++row) {
    const float score = scores.At(row, column);
    if (!(score > 0) || score < options.min_ridge_score_dn) continue;
    if (row > 0 && scores.At(row - 1, column) >= score) continue;
    if (row + 1 < rows && scores.At(row + 1, column) > score) continue;
    candidates.push_back({static_cast<double>(row), score, 0});
  }
  if (options.saturation_dn > 0) ReplaceWidePlateaus(profile, options, &candidates);
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.score != b.score ? a.score > b.score : a.row < b.row;
  });
  std::vector<Candidate> lines;
  for (const Candidate& c : candidates) {
    const bool same = std::any_of(lines.begin(), lines.end(), [&](const Candidate& line) {
      return std::abs(line.row - c.row) <
             2 * options.ridge_sigma_px + line.half_plateau + c.half_plateau;
    });
    if (!same) lines.push_back(c);
  }
  return lines;
}

// Place of the least mean of three values between two lines.
double Valley(const std::vector<double>& profile, double from, double to) {
  const int first = static_cast<int>(std::ceil(from)), last = static_cast<int>(std::floor(to));
  double least = 0, place = (from + to) / 2;
  bool found = false;
  for (int row = first + 1; row < last; ++row) {
    const double mean = profile[row - 1] + profile[row] + profile[row + 1];
    // Among equal values the one nearest to the middle wins.
    if (!found || mean < least ||
        (mean == least && std::abs(row - (from + to) / 2) < std::abs(place - (from + to) / 2))) {
      least = mean;
      place = row;
      found = true;
    }
  }
  return place;
}

}  // namespace

absl::StatusOr<std::vector<LinePoint>> DetectLaserLine(const Image<float>& image_dn,
                                                       const LaserLineOptions& options,
                                                       LaserLineMethod method) {
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(options));
  if (image_dn.empty()) return absl::InvalidArgumentError("laser line: the image is empty");
  const Image<float> image = WithoutGaps(image_dn);
  const Image<float> scores = RidgeScore(image, options.ridge_sigma_px);
  const int rows = image.rows_px;

  std::vector<LinePoint> points;
  std::vector<double> profile(rows);
  for (int column = 0; column < image.columns_px; ++column) {
    for (int row = 0; row < rows; ++row) profile[row] = image.At(row, column);
    std::vector<Candidate> lines = FindCandidates(profile, scores, column, options);
    std::vector<double> by_row;
    for (const Candidate& line : lines) by_row.push_back(line.row);
    std::sort(by_row.begin(), by_row.end());
    if (static_cast<int>(lines.size()) > options.max_lines) lines.resize(options.max_lines);
    std::sort(lines.begin(), lines.end(),
              [](const Candidate& a, const Candidate& b) { return a.row < b.row; });

    for (const Candidate& line : lines) {
      ProfileWindow window{0, rows - 1.0, line.row, 0};
      window.half_width = options.half_window_px > 0 ? options.half_window_px
                                                     : std::ceil(4 * options.ridge_sigma_px);
      window.half_width += line.half_plateau;
      const auto own = std::lower_bound(by_row.begin(), by_row.end(), line.row);
      if (own != by_row.begin()) window.lower = Valley(profile, *(own - 1), line.row);
      if (own + 1 != by_row.end()) window.upper = Valley(profile, line.row, *(own + 1));

      std::optional<ProfileCentre> centre;
      if (method == LaserLineMethod::kGaussianFit) {
        centre = FitGaussian(profile, window, options.saturation_dn);
      } else {
        const double background = std::isnan(options.background_dn)
                                      ? LocalBackground(profile, window)
                                      : options.background_dn;
        centre = CentreOfGravity(profile, window, background);
      }
      if (!centre) continue;
      LinePoint point{column, centre->place, centre->peak, centre->width, line.score, false};
      if (options.saturation_dn > 0) {
        const int first = std::max(0, static_cast<int>(centre->place - window.half_width));
        const int last =
            std::min(rows - 1, static_cast<int>(centre->place + window.half_width) + 1);
        for (int row = first; row <= last; ++row) {
          point.saturated |=
              profile[row] >= options.saturation_dn && row >= window.lower && row <= window.upper;
        }
      }
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace sightline
