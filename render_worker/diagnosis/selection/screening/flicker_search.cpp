// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/flicker_search.h"

#include <algorithm>
#include <boost/math/special_functions/sinc.hpp>
#include <cmath>
#include <complex>
#include <numbers>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

namespace {

using boost::math::sinc_pi;
using std::numbers::pi;

// Amount of other light in every recording, after the set-up's parameters have absorbed what they
// can: normal equations information * amounts = weighted.
struct OtherLight {
  std::vector<double> time_s, exposure_s;
  Eigen::MatrixXd information;
  Eigen::VectorXd weighted;
};

OtherLight LightOfRecordings(const SetModel& model, const FitResult& null,
                             const Eigen::VectorXd& change, double radiance_w_m2_sr) {
  const std::vector<RecordedFrame>& frames = model.set().frames;
  Eigen::MatrixXd changes =
      Eigen::MatrixXd::Zero(change.size(), static_cast<Eigen::Index>(frames.size()));
  Eigen::Index at = 0;
  for (int e = 0; e < model.blocks(); ++e) {
    const Eigen::Index size = null.mean[e].size();
    // A block of several recordings is shared out evenly among them.
    const std::vector<int>& of = model.FramesOf(e);
    for (int f : of) {
      changes.col(f).segment(at, size) =
          change.segment(at, size) / (radiance_w_m2_sr * static_cast<double>(of.size()));
    }
    at += size;
  }
  const LinearFit linear(null);
  std::vector<Eigen::Index> lit;
  OtherLight light;
  for (size_t f = 0; f < frames.size(); ++f) {
    const auto column = static_cast<Eigen::Index>(f);
    if (changes.col(column).squaredNorm() == 0) continue;
    lit.push_back(column);
    const FrameSetup& frame = frames[f].nominal;
    light.exposure_s.push_back(frame.exposure_time_s);
    // The middle of the exposure, of the middle row.
    light.time_s.push_back(frame.timestamp_s + 0.5 * frame.exposure_time_s +
                           0.5 * frame.roi.rows_px * frame.row_time_s);
  }
  const Eigen::MatrixXd of_lit = changes(Eigen::all, lit);
  Eigen::MatrixXd projected(of_lit.rows(), of_lit.cols());
  for (Eigen::Index i = 0; i < of_lit.cols(); ++i) {
    projected.col(i) = linear.Project(of_lit.col(i));
  }
  light.information = of_lit.transpose() * projected;
  light.weighted = projected.transpose() * linear.residual();
  return light;
}

struct Flicker {
  double gain = 0, frequency_hz = 0, mean = 0, modulation = 0;
};

// Least squares of mean + modulation * wave. `wave` has one component per recording; `of_all` is
// the information times a vector of ones.
Flicker Fitted(const OtherLight& light, const Eigen::VectorXd& of_all,
               const Eigen::VectorXd& wave) {
  const double w = of_all.sum(), wc = of_all.dot(wave), wcc = wave.dot(light.information * wave);
  const double b = light.weighted.sum(), bc = light.weighted.dot(wave);
  Flicker fitted;
  const double determinant = w * wcc - wc * wc;
  if (determinant <= 1e-9 * w * wcc) return fitted;
  fitted.mean = (b * wcc - bc * wc) / determinant;
  fitted.modulation = (w * bc - wc * b) / determinant;
  // The phase is given, so that negative amplitudes are unphysical.
  if (fitted.mean > 0 && fitted.modulation > 0) {
    fitted.gain = 0.5 * (fitted.mean * b + fitted.modulation * bc);
  }
  return fitted;
}

// The best frequency within a step of a peak.
Flicker RefinedFlicker(const OtherLight& light, const Eigen::VectorXd& of_all, const Flicker& peak,
                       double step_hz) {
  Flicker best = peak;
  Eigen::VectorXd wave(of_all.size());
  for (int i = -thresholds::kFiner; i <= thresholds::kFiner; ++i) {
    const double frequency_hz = peak.frequency_hz + i * step_hz / thresholds::kFiner;
    for (Eigen::Index r = 0; r < wave.size(); ++r) {
      wave[r] = sinc_pi(pi * frequency_hz * light.exposure_s[r]) *
                std::cos(2 * pi * frequency_hz * light.time_s[r]);
    }
    Flicker here = Fitted(light, of_all, wave);
    here.frequency_hz = frequency_hz;
    if (here.gain > best.gain) best = here;
  }
  return best;
}

}  // namespace

std::vector<ActiveEffect> FlickerSeen(const Effect& effect, const SetModel& model,
                                      const FitResult& null, const Eigen::VectorXd& change,
                                      double radiance_w_m2_sr) {
  const OtherLight light = LightOfRecordings(model, null, change, radiance_w_m2_sr);
  const auto recordings = static_cast<Eigen::Index>(light.time_s.size());
  if (recordings < thresholds::kFewestRecordings) return {};
  const Eigen::VectorXd of_all = light.information.rowwise().sum();
  const auto [first, last] = std::minmax_element(light.time_s.begin(), light.time_s.end());
  const double step_hz = 1 / (thresholds::kStepsOfTurn * std::max(1.0, *last - *first));
  const double all_steps = (thresholds::kHighest_hz - thresholds::kLowest_hz) / step_hz;
  if (all_steps * static_cast<double>(recordings * recordings) > thresholds::kMostProducts) {
    return {};
  }
  const auto steps = static_cast<int>(all_steps);
  std::vector<std::complex<double>> phase(recordings), turn(recordings);
  Eigen::VectorXd wave(recordings);
  std::vector<Flicker> peaks;
  for (int step = 0; step < steps; ++step) {
    const double frequency_hz = thresholds::kLowest_hz + step * step_hz;
    for (Eigen::Index i = 0; i < recordings; ++i) {
      if (step % thresholds::kStepsTogether == 0) {
        const double smoothing = sinc_pi(pi * frequency_hz * light.exposure_s[i]);
        phase[i] = smoothing * std::polar(1.0, 2 * pi * frequency_hz * light.time_s[i]);
        turn[i] = std::polar(1.0, 2 * pi * step_hz * light.time_s[i]);
      } else {
        phase[i] *= turn[i];
      }
      wave[i] = phase[i].real();
    }
    Flicker here = Fitted(light, of_all, wave);
    here.frequency_hz = frequency_hz;
    if (!peaks.empty() && frequency_hz - peaks.back().frequency_hz < thresholds::kWidthOfPeak_hz) {
      if (here.gain > peaks.back().gain) peaks.back() = here;
    } else {
      peaks.push_back(here);
    }
  }
  const auto kept = std::min<size_t>(thresholds::kFlickerPeaks, peaks.size());
  std::partial_sort(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(kept), peaks.end(),
                    [](const Flicker& a, const Flicker& b) { return a.gain > b.gain; });
  std::vector<ActiveEffect> seen;
  for (size_t i = 0; i < kept && peaks[i].gain > 0; ++i) {
    const Flicker flicker = RefinedFlicker(light, of_all, peaks[i], step_hz);
    const double depth = std::min(1.0, flicker.modulation / flicker.mean);
    seen.push_back({&effect, {flicker.mean, depth, flicker.frequency_hz}});
  }
  return seen;
}

}  // namespace sightline
