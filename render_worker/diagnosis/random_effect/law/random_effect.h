// SPDX-License-Identifier: Apache-2.0
// A random effect gives every recording, or every segment of the line on the plate, an amplitude
// a ~ N(0, K). This interface says what the amplitudes change, how K follows from the effect's
// parameters, and how a first guess of their values is made. The comparison of random effects
// (compare_random_effects) knows them by it alone.
//
// A new random effect is a value of RandomLaw (effects/effect.h), a file in this folder and a line
// in MakeRandomEffect.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// The quantity that an amplitude changes. Recordings with laser light come in the order of the set,
// plate positions in that of SetModel::position_ids.
enum class Amplitude {
  kLight,  // amount of laser light of a recording, relative
  kShift,  // place of the image across the line in a recording [px]
  // Reflectance of a segment of the line at a plate position, relative; all segments of the first
  // position, then of the next. Behind these, for every plate position, the excess of the relative
  // variance of light within its segments over the mean of the distribution.
  kReflectance,
};

// Parameters of a movement whose displacement and blur are seen in single recordings.
struct MovementParameters {
  std::vector<double> parameters, standard_errors;  // in the order of the effect's description
  std::vector<double> phases_rad;  // of every recording, in the middle of its exposure
};

// In all functions, `parameters` are the effect's, in the order of its description: the strength
// (standard deviation of an amplitude in the effect's unit) first, then perhaps a shape.
class RandomEffect {
 public:
  virtual ~RandomEffect() = default;

  virtual Amplitude amplitude() const = 0;
  // Lower triangular factor L of the amplitudes' covariance, K = L L'.
  virtual Eigen::MatrixXd CovarianceFactor(const std::vector<double>& parameters) const = 0;
  // Largest value of the second parameter for which recordings or segments differ; the search ends
  // there.
  virtual double largest_shape() const { return std::numeric_limits<double>::infinity(); }

  // Expected variance within every recording with laser light, given the amplitudes: of the
  // movement about the mean place during the exposure [px^2] for kShift, of the light along a
  // segment, relative, for kReflectance. Empty: the effect is constant within a recording.
  virtual Eigen::VectorXd VarianceWithin(const std::vector<double>& /*parameters*/,
                                         const Eigen::VectorXd& /*amplitudes*/) const {
    return {};
  }

  // For weak amplitudes: linearisation point about the parameters of a fit without them.
  virtual Realisation StartNear(const SetParameters& /*fitted*/) const = 0;
  // For amplitudes so strong that such a fit is wrong: from the recordings, given nominal
  // parameters.
  virtual Realisation StartFromRecordings(const SetParameters& nominal) const = 0;
  // The realisation that these amplitudes stand for.
  virtual Realisation RealisationOf(const std::vector<double>& parameters,
                                    const Eigen::VectorXd& amplitudes) const = 0;

  // Parameters from displacement and blur of single recordings, whose joint distribution is not
  // normal. Empty for effects without phases.
  virtual std::optional<MovementParameters> FitMovements(
      std::span<const RecordedMovement> /*movements*/) const {
    return std::nullopt;
  }
};

// True for effects with random amplitudes per recording or per place on the plate.
inline bool HasRandomLaw(const Effect& effect) {
  return effect.description().random_law != RandomLaw::kNone;
}

// `law` is not kNone; `model` must outlive the effect.
std::unique_ptr<const RandomEffect> MakeRandomEffect(RandomLaw law, const SetModel& model);

// The files of this folder, for MakeRandomEffect.
std::unique_ptr<const RandomEffect> MakePower(const SetModel& model);
std::unique_ptr<const RandomEffect> MakeCorrelatedPower(const SetModel& model);
std::unique_ptr<const RandomEffect> MakeExposureTime(const SetModel& model);
std::unique_ptr<const RandomEffect> MakeScaledExposureTime(const SetModel& model);
std::unique_ptr<const RandomEffect> MakeReflectance(RandomLaw law, const SetModel& model);
std::unique_ptr<const RandomEffect> MakeVibration(const SetModel& model);
std::unique_ptr<const RandomEffect> MakeCorrelatedMovement(const SetModel& model);

}  // namespace sightline
