#include "render_worker/effects/time/sinusoidal_motion.h"

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <unordered_map>

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

}  // namespace

std::function<std::complex<double>(double, double)> SinusoidalMotionTransfer(double amplitude_m,
                                                                             double periods,
                                                                             double phase_rad) {
  const auto motion = std::make_shared<const Motion>(amplitude_m, periods, phase_rad);
  return [motion](double, double q_per_m) { return TransferOnce(motion, q_per_m); };
}

}  // namespace sightline
