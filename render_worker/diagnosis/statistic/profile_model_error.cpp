// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/profile_model_error.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace sightline {

namespace {

// Relative error of the variance of a profile's component that its neighbours do not share, and of
// the profile's signal. Measured on simulated sets without effects.
constexpr double kUnsharedVariance = 0.12;
constexpr double kProfileModelError = 0.005;
// The same between recordings of one speckle. Chosen larger, because SharedSpeckleStatistic
// compares these pixel by pixel.
constexpr double kUnsharedBetweenRecordings = 0.3;
// Relative error of the far wings of the line's image, where the signal is below kWing of its
// crest. Chosen: renderers cut the wings off.
constexpr double kWingError = 0.2;
constexpr double kWing = 0.003;
// Relative error of the signal at the region's edge, for recordings in focus and out of focus, in
// addition to what all recordings have in common (ModelError). Chosen like the latter.
constexpr double kTailInFocusError = 0.3, kTailOutOfFocusError = 1;
// Fraction of the squared error of wings and edge that components do not share. Chosen: half of the
// error.
constexpr double kUnsharedWing = 0.25;
// Distance from the line, relative to the edge's, at which the fall of the signal is read, and the
// largest deviation from it.
constexpr double kReadAt = 2.0 / 3, kReadWithin = 0.3;

// Signal at the outermost bins of one plane, from which all signal is counted. With a signal A /
// x^2 at relative distance x, the difference at x is A (1 / x^2 - 1).
double EdgeSignal(const std::vector<ProfileBin>& bins, const Eigen::ArrayXd& signal, int plane) {
  double edge_px = 0;
  for (const ProfileBin& bin : bins) edge_px = std::max(edge_px, std::abs(bin.centre_px));
  double crest = 0, at_edge = 0, nearest = kReadWithin;
  for (size_t i = 0; i < bins.size(); ++i) {
    if (bins[i].plane != plane) continue;
    const double here = signal[static_cast<Eigen::Index>(i)];
    crest = std::max(crest, here);
    const double x = std::abs(bins[i].centre_px) / edge_px;
    if (std::abs(x - kReadAt) >= nearest) continue;
    nearest = std::abs(x - kReadAt);
    at_edge = here / (1 / (x * x) - 1);
  }
  return std::clamp(at_edge, 0.0, kWing * crest);
}

}  // namespace

Eigen::VectorXd EdgeSignals(const Eigen::VectorXd& means, const ProfileGroup& group) {
  Eigen::VectorXd signals(means.size());
  const double background = means.minCoeff();
  Eigen::Index first = 0;
  for (const std::vector<ProfileBin>& bins : group.bins) {
    const auto size = static_cast<Eigen::Index>(bins.size());
    const Eigen::ArrayXd signal = means.segment(first, size).array() - background;
    std::map<int, double> of_plane;
    for (const ProfileBin& bin : bins) {
      if (!of_plane.contains(bin.plane)) of_plane[bin.plane] = EdgeSignal(bins, signal, bin.plane);
      signals[first++] = of_plane[bin.plane];
    }
  }
  return signals;
}

void AddModelErrors(const Eigen::VectorXd& means, const ProfileGroup& group, int segments,
                    const Eigen::VectorXd& noise_variance,
                    const Eigen::VectorXd& saturation_variance, Eigen::MatrixXd& covariance) {
  const double background = means.minCoeff();
  Eigen::VectorXd wing(group.size), tail = EdgeSignals(means, group);
  int first = 0;
  for (size_t m = 0; m < group.frames.size(); ++m) {
    const auto size = static_cast<Eigen::Index>(group.bins[m].size());
    const Eigen::ArrayXd signal = means.segment(first, size).array() - background;
    wing.segment(first, size) = (kWingError * signal.min(kWing * signal.maxCoeff())).matrix();
    tail.segment(first, size) *= group.in_focus[m] ? kTailInFocusError : kTailOutOfFocusError;
    first += static_cast<int>(size);
  }
  wing *= std::sqrt(static_cast<double>(segments));
  tail *= std::sqrt(static_cast<double>(segments));
  for (int i = 0; i < group.size; ++i) {
    const double signal = means[i] - background;
    covariance(i, i) *=
        1 + (group.frames.size() > 1 ? kUnsharedBetweenRecordings : kUnsharedVariance);
    covariance(i, i) += std::pow(kProfileModelError * signal, 2) + noise_variance[i] +
                        saturation_variance[i] +
                        kUnsharedWing * (wing[i] * wing[i] + tail[i] * tail[i]);
  }
  covariance += wing * wing.transpose() + tail * tail.transpose();
}

}  // namespace sightline
