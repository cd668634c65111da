// SPDX-License-Identifier: Apache-2.0
// Uncertainty of a surface at a target, given the points measured around it: Gaussian-process
// regression along the target's normal (thesis 3.4; Rasmussen and Williams, Gaussian Processes for
// Machine Learning, 2006).
//
// The surface's deviation h from the CAD model about a target is a zero-mean process with the
// squared-exponential covariance sigma_pr^2 exp(-r^2 / 2 l^2) of thesis eq. 3.19. A point measured
// by scan s at place x in the target's tangent plane observes
//   z = h(x) + e + b_s,   e ~ N(0, sigma^2) of its own,   b_s ~ N(0, c_s) common to all its points,
// so that detection noise averages out and calibration errors do not.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

namespace sightline {

// l* [m] that maximises thesis eq. 3.22 for the resolution delta_r [m]: 1.2554 delta_r / pi.
double CovarianceLengthScale(double resolution_m);

struct SurfacePrior {
  double standard_deviation_m = 0.01;
  double length_scale_m = 0.0012;
  // Points farther from the target than this are left out (thesis 3.4.2: 3 l*).
  double neighbourhood_m() const { return 3 * length_scale_m; }
};

// A measured point seen from a target.
struct SurfaceObservation {
  Eigen::Vector2d place_m;   // in the tangent plane, the target at the origin
  double noise_variance_m2;  // of detection, along the target's normal; > 0
};

// Uncertainty of the deviation at a target; variances add up: noise + sampling + calibration +
// registration.
struct SurfaceUncertainty {
  double total_m;             // posterior standard deviation
  double noise_m;             // from detection noise
  double sampling_m;          // from deviation of the surface between and beyond the points
  double calibration_m;       // from errors common to all points of a scan
  double registration_m = 0;  // from joining coordinate systems (core/shared_errors)
};

// Posterior at one target, updated scan by scan. The process is written in a finite basis (weights
// with independent priors), so that scans add up as sums of fixed size and nothing is kept of
// single points. u differs from that of DenseSurfaceUncertainty by at most 1 % for prior/noise up
// to 500, 2 % up to 2000 and 5 % up to 5000 (standard deviations; too small). Noise below a 10000th
// of the prior is taken as that, and where the sum of (prior/noise)^2 over all points exceeds 1e10
// all of it is scaled down to that: u comes out larger than it would be.
class LocalSurface {
 public:
  // Products of functions of the two axes of total degree <= 14.
  static constexpr int kDegree = 14;
  static constexpr int kFunctions = (kDegree + 1) * (kDegree + 2) / 2;

  // Both members of the prior > 0.
  explicit LocalSurface(const SurfacePrior& prior);

  // Adds the points of one scan; those outside the neighbourhood (and places that are not numbers)
  // are ignored. `calibration_variance_m2` (>= 0) is the variance of their common error along the
  // normal. Points of one scan given in two calls have two independent common errors.
  void AddScan(std::span<const SurfaceObservation> points, double calibration_variance_m2);
  // Before any point: the prior, all of it sampling.
  SurfaceUncertainty Uncertainty() const;
  // Back to the prior; keeps the memory.
  void Clear();

 private:
  SurfacePrior prior_;
  double information_ = 0;  // sum of w
  // See local_surface.cpp: moments of all points for k + j <= 2 kDegree; for every scan with a
  // common error c, v sqrt(c / (1 + c sum w)) of kFunctions numbers and 1 / (1 + c sum w).
  static constexpr int kMoments = (2 * kDegree + 1) * (kDegree + 1);
  std::array<double, kMoments> moments_;
  std::vector<double> common_;
  std::vector<double> own_share_;
};

// The same by the dense matrices of thesis eq. 3.14, with the calibration term: the reference.
// scans[i] are the points of scan i, calibration_variances_m2[i] its common variance.
SurfaceUncertainty DenseSurfaceUncertainty(const SurfacePrior& prior,
                                           std::span<const std::vector<SurfaceObservation>> scans,
                                           std::span<const double> calibration_variances_m2);

// Posterior standard deviation u [m] at a surface point where points lie densely, as a function of
// the information density lambda = sum over scans of (points per area) / sigma^2 [1/m^4]:
//   u^2 = int S(f) / (1 + lambda S(f)) 2 pi f df,   S the 2-D spectrum of the covariance,
//   S(f) = sigma_pr^2 2 pi l^2 exp(-2 pi^2 l^2 f^2).
// Closed form: with a = lambda sigma_pr^2 2 pi l^2,  u^2 = sigma_pr^2 ln(1 + a) / a.
double UncertaintyAtDensity(const SurfacePrior& prior, double information_density_per_m4);
// Its inverse for u in (0, sigma_pr): the density [1/m^4] after which the surface is known to u.
double DensityForUncertainty(const SurfacePrior& prior, double uncertainty_m);

// Variance [m^2] of the surface between the points of a grid of spacing a [m] along one axis: what
// the process has above the grid's Nyquist frequency 1/(2a), there and folded back,
//   2 sigma_pr^2 erfc(pi l / (sqrt(2) a)), at most sigma_pr^2.
// For one scan of lines a apart and little noise its root is 0.88 of that of the dense matrices at
// a = 0.83 l, 1.09 at 1.25 l and 1.15 at 1.67 l. Of two scans with steps across each other the
// relative variances multiply (within 12 % in u at little noise); of scans in parallel lines they
// do not: there the offset between the lines decides.
double SamplingVariance(const SurfacePrior& prior, double spacing_m);

// Posterior standard deviation [m] where points lie densely only up to a straight border: the
// density on the target's side and `border_distance_m` between target and border, > 0 where the
// target lies among the points, < 0 where it lies beyond them. The border of points that lie in a
// grid is half a spacing beyond the last ones. With L = ln(1 + a), E = ln(sigma_pr / u), a and u
// as of UncertaintyAtDensity, x = distance / l and r = 0.336 sqrt(L) - 0.195:
//   x >= 0:  u(x) = u exp(r / (1 + r x / 0.0865)),
//   x <  0:  u(x) = sigma_pr exp(-(E - r) exp(-(1.475 - 1.105/L) |x| - (3.44/L - 0.116) |x|^3)).
// A fit to the dense computation (points 0.085 l to 0.11 l apart within 3 l): within 8 % for
// 300 <= a <= 1e9 and -2.5 <= x <= 3; L is kept to that range in the constants.
// At a right corner of two borders, with t = ln(sigma_pr / u(x)) / E of each,
//   1/t = 1/t1 + 1/t2 - 1,  u = sigma_pr exp(-t E),
// within 15 % of the dense computation, 20 % too small farther than l/2 beyond both (u > 0.5
// sigma_pr there).
double BorderUncertainty(const SurfacePrior& prior, double information_density_per_m4,
                         double border_distance_m);

}  // namespace sightline
