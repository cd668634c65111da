// SPDX-License-Identifier: Apache-2.0
// Agreement of a detected laser line with the true line: the optical cost of thesis section 6.4.2.
#pragma once

#include <cstdint>
#include <vector>

#include "core/laser_line/detect_laser_line.h"

namespace sightline {

// 97.5 % quantile of the standard normal distribution (two-sided 95 %).
inline constexpr double kNormal95 = 1.959963984540054;

// A crossing of the true line with an image column; a column may have several crossings.
struct LineCrossing {
  int column_px = 0;
  double row_px = 0;
};

// Sums over the comparison with the true line. Adding two of them counts both.
struct LineSums {
  double columns = 0;    // compared columns
  double crossings = 0;  // of the true line
  double found = 0;      // of these, detected
  double clipped = 0;    // of these, with a clipped profile
  double false_lines = 0;
  double deviation_px = 0;    // sum over the found ones of detected minus true row
  double deviation2_px2 = 0;  // of their squares

  LineSums& operator+=(const LineSums& other);
  friend LineSums operator*(double weight, const LineSums& sums);
};

// Compares detected points with the crossings of the true line, both by ascending column, in blocks
// of `block_px` columns over [0, columns_px). Within a column, points and crossings are paired, the
// nearest pairs first, up to a distance of `reach_px`. Points without a crossing are false lines,
// crossings without a point are missed.
std::vector<LineSums> CompareLine(const std::vector<LinePoint>& detected,
                                  const std::vector<LineCrossing>& line, int columns_px,
                                  int block_px, double reach_px);

// Weights of the optical cost.
struct LineCost {
  double prior_uncertainty_px = 3;  // u_pr of thesis eq. 6.5; 3 px there
  // Cost of one false line per column, in units of u_pr; 0 in the thesis.
  double false_line_weight = 0;
  // Fraction of the found crossings that may be clipped, in [0, 1]. Clipped ones beyond it count as
  // not found, because the centre of a clipped profile follows the noise of its flanks. 1: no
  // limit, as in the thesis.
  double max_clipped_fraction = 1;
};

struct LineQuality {
  double u_px = 0;              // standard deviation of detected minus true row
  double bias_px = 0;           // mean
  double rms_px = 0;            // root mean square
  double profile_coverage = 0;  // a_cov, share of the crossings that are found
  double false_lines_per_column = 0;
  double clipped_fraction = 0;  // of the found crossings
  // f = a u_px + (1 - a) u_pr (thesis eq. 6.5) + weight u_pr false lines per column, where
  // a = a_cov (1 - max(0, clipped fraction - its limit)).
  double cost = 0;
};

// Fewer than two found crossings have no standard deviation: u_px is then u_pr.
LineQuality QualityOf(const LineSums& sums, const LineCost& cost);

// Estimates the quality of one setting from several images of the same lines that differ only by
// random effects (speckle, photons, noise).
class QualityEstimate {
 public:
  // sums[b][r]: block b (of columns, of any of the frames, weighted) in realisation r. At least one
  // block; at least two realisations, the same number for every block.
  QualityEstimate(const std::vector<std::vector<LineSums>>& sums, const LineCost& cost);

  // Mean over all realisations.
  const LineQuality& mean() const { return mean_; }

  struct Interval {
    double lower = 0, upper = 0;
  };
  // 95 % prediction interval of one new realisation: value +- 1.96 s sqrt(1 + 1/R). Here s is the
  // standard deviation between realisations, by the delta method: the number is linearised in the
  // sums of independent blocks, whose variances between realisations add up. Many blocks make s
  // well known from few realisations. Fractions stay in [0, 1]. If R realisations had no misses,
  // the misses of a new one follow the predictive distribution of a Poisson count with a flat prior
  // on its mean: k or more with probability (R + 1)^-k. The interval of the coverage includes as
  // many misses as are not ruled out at 5 %.
  Interval u_px() const;
  Interval bias_px() const;
  Interval rms_px() const;
  Interval profile_coverage() const;
  Interval false_lines_per_column() const;
  Interval cost() const;

  // Standard error of the mean cost.
  double CostStandardError() const;
  // Standard error of the difference of two mean costs. Realisations with the same number are
  // paired, so that common random effects cancel, if both estimates have the same blocks.
  double StandardErrorOfDifference(const QualityEstimate& other) const;

 private:
  // Changes of the numbers by every block and realisation, less their mean over realisations.
  struct Change {
    double u_px, bias_px, rms_px, profile_coverage, false_lines_per_column, cost;
  };
  Interval Around(double value, double Change::*number) const;

  LineQuality mean_;
  double crossings_ = 0;  // per realisation
  int realisations_ = 0;
  std::vector<Change> changes_;  // block by block, realisation by realisation
};

}  // namespace sightline
