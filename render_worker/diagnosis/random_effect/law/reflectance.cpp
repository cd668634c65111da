// SPDX-License-Identifier: Apache-2.0
// A texture of the plate: its reflectance is a random field, a new piece of it at every plate
// position. Amplitudes are the mean reflectances of segments of the line and how much light varies
// within the segments of a position.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "render_worker/diagnosis/expectation/texture_law.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"

namespace sightline {

namespace {

// Length on the plate of a segment of the line [m].
double SegmentLength(const SetModel& model, const FrameSetup& frame) {
  return LengthOnPlate(frame, frame.roi.columns_px) / model.blocks_along_line();
}

const FrameSetup& FirstAt(const SetModel& model, int plate_position_id) {
  const std::vector<RecordedFrame>& frames = model.set().frames;
  return std::find_if(
             frames.begin(), frames.end(),
             [&](const RecordedFrame& f) { return f.plate_position_id == plate_position_id; })
      ->nominal;
}

// Parameters: standard deviation of the reflectance, relative; correlation length [m].
class Reflectance final : public RandomEffect {
 public:
  Reflectance(RandomLaw law, const SetModel& model) : law_(law), model_(model) {}

  Amplitude amplitude() const override { return Amplitude::kReflectance; }

  // A field that is smooth over segments of the first recording is taken for constant along them.
  double largest_shape() const override {
    return SegmentLength(model_, model_.set().frames.front().nominal);
  }

  // Plate positions are independent; so are the variances within segments and the segments' means.
  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& parameters) const override {
    constexpr double kNugget = 1e-6;  // relative; keeps the covariance positive definite
    const int segments = model_.blocks_along_line();
    const std::vector<int>& ids = model_.position_ids();
    const auto positions = static_cast<Eigen::Index>(ids.size());
    const Eigen::Index n = segments * positions;
    Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(n + positions, n + positions);
    for (size_t p = 0; p < ids.size(); ++p) {
      const FrameSetup& frame = FirstAt(model_, ids[p]);
      const TextureLaw texture(law_, frame, parameters);
      const double segment_m = SegmentLength(model_, frame);
      Eigen::MatrixXd covariance(segments, segments);
      for (int a = 0; a < segments; ++a) {
        for (int b = 0; b < segments; ++b) {
          covariance(a, b) = texture.Covariance(segment_m, (a - b) * segment_m);
        }
        covariance(a, a) *= 1 + kNugget;
      }
      const auto at = static_cast<Eigen::Index>(p) * segments;
      factor.block(at, at, segments, segments) = covariance.llt().matrixL();
      const auto within = n + static_cast<Eigen::Index>(p);
      factor(within, within) = texture.DeviationOfVarianceAlong(segment_m) / std::sqrt(segments);
    }
    return factor;
  }

  Eigen::VectorXd VarianceWithin(const std::vector<double>& parameters,
                                 const Eigen::VectorXd& /*amplitudes*/) const override {
    std::vector<double> variance;
    for (const RecordedFrame& frame : model_.set().frames) {
      if (frame.plate_position_id < 0) continue;
      variance.push_back(TextureLaw(law_, frame.nominal, parameters)
                             .VarianceAlong(SegmentLength(model_, frame.nominal)));
    }
    return Eigen::Map<const Eigen::VectorXd>(variance.data(),
                                             static_cast<Eigen::Index>(variance.size()));
  }

  Realisation StartNear(const SetParameters& /*fitted*/) const override {
    return Realisation(model_.set().frames.size());
  }

  Realisation StartFromRecordings(const SetParameters& nominal) const override {
    return RealisedReflectance(model_, ReflectanceExcesses(model_, nominal));
  }

  Realisation RealisationOf(const std::vector<double>& /*parameters*/,
                            const Eigen::VectorXd& amplitudes) const override {
    return RealisedReflectance(model_, amplitudes);
  }

 private:
  RandomLaw law_;
  const SetModel& model_;
};

}  // namespace

std::unique_ptr<const RandomEffect> MakeReflectance(RandomLaw law, const SetModel& model) {
  return std::make_unique<Reflectance>(law, model);
}

}  // namespace sightline
