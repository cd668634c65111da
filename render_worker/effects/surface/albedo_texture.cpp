// SPDX-License-Identifier: Apache-2.0
// Reflectance that varies with the place on the plate: 1 + rms g(X, s), g a normal random field of
// correlation exp(-r^2/l^2). The field belongs to the plate (drawn once a rig); recordings of
// another plate position see another part of it.
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// White noise on a periodic lattice of pitch l/2, smoothed with exp(-2 r^2/l^2), whose
// autocorrelation is exp(-r^2/l^2). Normalised at every place: variance 1 everywhere.
class RandomField {
 public:
  RandomField(uint64_t seed, double length_m)
      : pitch_m_(0.5 * length_m), noise_(size_t{kSize} * kSize) {
    for (int i = 0; i < kSize * kSize; ++i) noise_[i] = CounterRandom(seed, i).Normal();
  }

  double At(double x_m, double y_m) const {
    const Weights column(x_m / pitch_m_);
    const Weights row(y_m / pitch_m_);
    double sum = 0;
    for (int i = 0; i < kReach; ++i) {
      double along = 0;
      for (int j = 0; j < kReach; ++j) {
        along += column.weight[j] * noise_[row.Place(i) * kSize + column.Place(j)];
      }
      sum += row.weight[i] * along;
    }
    return sum / std::sqrt(column.square * row.square);
  }

 private:
  static constexpr int kSize = 256;
  static constexpr int kReach = 8;

  struct Weights {
    int first;
    double weight[kReach];
    double square = 0;

    explicit Weights(double place) {
      first = static_cast<int>(std::floor(place)) - kReach / 2 + 1;
      for (int i = 0; i < kReach; ++i) {
        const double offset = place - (first + i);  // in half lengths
        weight[i] = std::exp(-0.5 * offset * offset);
        square += weight[i] * weight[i];
      }
    }
    int Place(int i) const { return (first + i) & (kSize - 1); }
  };

  double pitch_m_;
  std::vector<double> noise_;
};

class AlbedoTextureEffect final : public DescribedEffect {
 public:
  AlbedoTextureEffect()
      : DescribedEffect({.id = "surface.albedo_texture",
                         .stage = Stage::kSurface,
                         .kind = EffectKind::kRandomPerPlace,
                         .random_law = RandomLaw::kGaussianReflectance,
                         .signature = {{"along_line", "line_core"}, {"plate_position"}},
                         .scope = EffectScope::kFlatPlate,
                         .summary = "reflectance times 1 + rms g(X, s), correlation exp(-r^2/l^2)",
                         .reference = "thesis 5.3.1, roughness measurements (texture)",
                         .parameters = {{"texture_rms_relative", 0, 0, 1, 0.1},
                                        {"texture_length_m", 1e-3, 1e-5, 0.1, 1e-3}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the plate stays the same along X
    const auto field =
        std::make_shared<RandomField>(DeriveSeed(frame.seeds.rig, "albedo texture"), p[1]);
    CounterRandom position(DeriveSeed(frame.seeds.speckle, "plate position"), 0);
    const double offset_x = 128 * p[1] * position.Uniform();
    const double offset_s = 128 * p[1] * position.Uniform();
    scene.constant_along_line = false;
    scene.brdf_per_sr = [=, rms = p[0], before = std::move(scene.brdf_per_sr)](double x_m,
                                                                               double s_m) {
      return before(x_m, s_m) * std::max(0.0, 1 + rms * field->At(x_m + offset_x, s_m + offset_s));
    };
  }
};

}  // namespace

const Effect& AlbedoTexture() {
  static const AlbedoTextureEffect effect;
  return effect;
}

}  // namespace sightline
