// Image that moves across the line as A sin(2 pi f t + phase) during the exposure; the phase is
// random for every recording. Its transfer function is the mean of exp(-2 pi i q displacement) over
// the exposure: whole periods give J0(2 pi q A), what is left over is summed up.
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <unordered_map>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// The image's displacements during one exposure.
class Motion {
 public:
  Motion(double amplitude_m, double periods, double phase) {
    for (size_t k = 0; k < quarter_m_.size(); ++k) {
      quarter_m_[k] = amplitude_m * std::sin(kTurn / 4 * (static_cast<double>(k) + 0.5) /
                                             static_cast<double>(quarter_m_.size()));
    }
    const double whole = std::floor(periods);
    for (size_t k = 0; k < remainder_m_.size(); ++k) {
      remainder_m_[k] =
          amplitude_m *
          std::sin(phase + kTurn * (periods - whole) * (static_cast<double>(k) + 0.5) / kMoments);
    }
    // No time at all: the place at that moment.
    whole_share_ = periods > 0 ? whole / periods : 0;
  }

  std::complex<double> Transfer(double q_per_m) const {
    std::complex<double> transfer = 0;
    if (whole_share_ > 0) {
      double sum = 0;
      for (const double displacement : quarter_m_) sum += std::cos(kTurn * q_per_m * displacement);
      transfer += whole_share_ * sum / static_cast<double>(quarter_m_.size());
    }
    if (whole_share_ < 1) {
      std::complex<double> sum = 0;
      for (const double displacement : remainder_m_) {
        sum += std::polar(1.0, -kTurn * q_per_m * displacement);
      }
      transfer += (1 - whole_share_) / kMoments * sum;
    }
    return transfer;
  }

 private:
  static constexpr int kMoments = 64;
  std::array<double, kMoments / 2> quarter_m_;  // of a quarter period: all magnitudes
  std::array<double, kMoments> remainder_m_;    // of what is left over whole periods
  double whole_share_ = 0;
};

// Images ask for the same few frequencies across the line in all of their columns.
std::complex<double> TransferOnce(const std::shared_ptr<const Motion>& motion, double q_per_m) {
  struct Known {
    std::weak_ptr<const Motion> of;
    std::unordered_map<double, std::complex<double>> transfer;
  };
  thread_local Known known;
  if (known.of.lock() != motion) known = {motion, {}};
  const auto [place, added] = known.transfer.try_emplace(q_per_m);
  if (added) place->second = motion->Transfer(q_per_m);
  return place->second;
}

class VibrationBlurEffect final : public DescribedEffect {
 public:
  VibrationBlurEffect()
      : DescribedEffect({.id = "time.vibration_blur",
                         .stage = Stage::kTime,
                         .summary = "image moves across the line with A sin(2 pi f t + phase)",
                         .reference =
                             "Goodman, Introduction to Fourier Optics, 4th ed., chapter 7; "
                             "Lohmann and Paris, Appl. Opt. 4 (1965) 393",
                         .parameters = {{"vibration_amplitude_px", 0, 0, 50, 1},
                                        {"vibration_frequency_hz", 50, 0.1, 1e5, 50}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    CounterRandom random(DeriveSeed(frame.seeds.noise, "vibration phase"), 0);
    const auto motion = std::make_shared<const Motion>(
        p[0] * frame.sensor.pixel_pitch_m, p[1] * frame.exposure_time_s, kTurn * random.Uniform());
    optics.transfer.push_back(
        [motion](double, double q_per_m) { return TransferOnce(motion, q_per_m); });
  }
};

}  // namespace

const Effect& VibrationBlur() {
  static const VibrationBlurEffect effect;
  return effect;
}

}  // namespace sightline
