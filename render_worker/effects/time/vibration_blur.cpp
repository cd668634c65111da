// Image that moves across the line as A sin(2 pi f t + phase) during the exposure; the phase is
// random for every recording. Its transfer function is the mean of exp(-2 pi i q displacement) over
// the exposure: whole periods give J0(2 pi q A), what is left over is summed up.
#include <array>
#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

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
    constexpr int kMoments = 64;
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    const double amplitude = p[0] * frame.sensor.pixel_pitch_m;
    CounterRandom random(DeriveSeed(frame.seeds.noise, "vibration phase"), 0);
    const double phase = kTurn * random.Uniform();
    const double periods = p[1] * frame.exposure_time_s;
    const double whole = std::floor(periods);
    const double rest = periods - whole;
    std::array<double, kMoments / 2> quarter;  // displacements of a quarter period: all magnitudes
    for (size_t k = 0; k < quarter.size(); ++k) {
      quarter[k] = amplitude * std::sin(kTurn / 4 * (static_cast<double>(k) + 0.5) /
                                        static_cast<double>(quarter.size()));
    }
    std::array<double, kMoments> remainder;
    for (size_t k = 0; k < remainder.size(); ++k) {
      remainder[k] =
          amplitude * std::sin(phase + kTurn * rest * (static_cast<double>(k) + 0.5) / kMoments);
    }
    // No time at all: the place at that moment.
    const double whole_share = periods > 0 ? whole / periods : 0;
    optics.transfer.push_back([=](double, double qy) {
      std::complex<double> transfer = 0;
      if (whole_share > 0) {
        double sum = 0;
        for (const double displacement : quarter) sum += std::cos(kTurn * qy * displacement);
        transfer += whole_share * sum / static_cast<double>(quarter.size());
      }
      if (whole_share < 1) {
        std::complex<double> sum = 0;
        for (const double displacement : remainder) {
          sum += std::polar(1.0, -kTurn * qy * displacement);
        }
        transfer += (1 - whole_share) / kMoments * sum;
      }
      return transfer;
    });
  }
};

}  // namespace

const Effect& VibrationBlur() {
  static const VibrationBlurEffect effect;
  return effect;
}

}  // namespace sightline
