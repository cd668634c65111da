#include "render_worker/diagnosis/random_effect/recording_scatter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <string_view>
#include <utility>

#include "render_worker/diagnosis/expectation/texture_law.h"
#include "render_worker/diagnosis/random_effect/lit_recordings.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/scatter_law.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

namespace sightline {

namespace {

using std::numbers::pi;
// Of the variance that speckle and noise leave to a recording's amplitude, which the model's
// approximations make uncertain.
constexpr double kScatterError = 0.3;
// Gain that this may explain [nats]: more is no small error of the model.
constexpr double kMostUnknownScatter = 15;

// Of strengths: what is drawn is taken for normal and the same all over a block of the line, which
// in rendered sets costs up to half of vibration's and a third of texture's.
constexpr double kStrengthError = 0.35;

// Of the null's chi squared what texture leaves where it is all that is missing and so strong that
// reflectances are far from linear.
constexpr double kStrongTextureLeaves = 0.5;

constexpr std::string_view kVibration = "time.vibration_blur";

bool Moves(const Effect& effect) {
  return effect.description().id == kVibration || effect.description().id == "unknown.movement";
}

// Known parameters of `null` at a realisation, from what does not compare speckle; linearised with
// all entries. `start`: without the realisation.
FitResult FitAtRealisation(const SetModel& model, const FitResult& null, SetParameters start,
                           const Realisation& realisation, std::vector<FitSettings::Round> rounds) {
  const RealisedEffect realised(realisation);
  start.effects.push_back({&realised, {}});
  FitSettings settings;
  settings.rounds = std::move(rounds);
  for (int e = 0; e < model.entries(); ++e) {
    settings.use_entry.push_back(!model.ComparesSpeckle(e));
  }
  const SetParameters found = FitSet(model, start, null.free, settings, nullptr).parameters;
  settings.use_entry.clear();
  settings.rounds.assign(1, FitSettings::Round());
  settings.max_iterations = 0;
  FitResult fit = FitSet(model, found, null.free, settings, nullptr);
  fit.parameters.effects.pop_back();
  return fit;
}

// The set about a realisation: what is left of the data and what the amplitudes change, whitened.
struct Linearisation {
  Eigen::MatrixXd change;                     // of all entries, per unit of every amplitude
  Eigen::MatrixXd within;                     // per ScatterLaw::within; may be empty
  Eigen::VectorXd origin;                     // the amplitudes' values here
  Eigen::VectorXd within_origin;              // of ScatterLaw::within
  Eigen::VectorXd residual;                   // extrapolated to amplitudes and known parameters 0
  Eigen::MatrixXd jacobian;                   // of the known parameters
  std::map<int, Eigen::MatrixXd> covariance;  // of the entries that have another than the null's
  double log_determinant = 0;                 // of these over the null's

  // After the known parameters have been taken off:
  Eigen::LLT<Eigen::MatrixXd> information;     // of them
  Eigen::MatrixXd inner;                       // V' P V
  Eigen::VectorXd slope;                       // V' P r
  double length = 0;                           // r' P r
  Eigen::MatrixXd within_inner, within_cross;  // U' P U, V' P U
  Eigen::VectorXd within_slope;                // U' P r
};

class RecordingScatter {
 public:
  // Linearised about `about`, a fit at realisation `at`; compared with `null`.
  RecordingScatter(const SetModel& model, const FitResult& about, const Realisation& at,
                   const FitResult& null)
      : model_(model), null_(about), at_(at), lit_(model) {
    offset_.push_back(0);
    for (const Eigen::VectorXd& mean : null.mean) {
      offset_.push_back(offset_.back() + static_cast<int>(mean.size()));
    }
    FindAmplitudesOfEntries();
    jacobian_ = null_.jacobian;
    for (size_t i = 0; i < null_.held.size(); ++i) {
      if (!null_.held[i]) continue;
      for (Eigen::MatrixXd& entry : jacobian_) entry.col(static_cast<Eigen::Index>(i)).setZero();
    }
    // At the best known parameters by the linearised model: the fit may stop short of them.
    Eigen::MatrixXd information = null.prior_weight.asDiagonal();
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(null.standardised.size());
    for (int e = 0; e < model.entries(); ++e) {
      const Eigen::MatrixXd& jacobian = jacobian_[e];
      const Eigen::VectorXd residual = null.residual[e] + jacobian * null.standardised;
      information.noalias() += jacobian.transpose() * jacobian;
      gradient.noalias() += jacobian.transpose() * residual;
      null_total_ += residual.squaredNorm() + null.whitening->LogDeterminant(e) -
                     about.whitening->LogDeterminant(e);
    }
    const Eigen::LLT<Eigen::MatrixXd> solver(information);
    null_total_ -= gradient.dot(solver.solve(gradient));
    null_total_ += 2 * solver.matrixLLT().diagonal().array().log().sum();
  }

  // What it finds is left in `at`.
  ScatterCandidate Evaluate(const Effect& effect, Realisation& at);

 private:
  struct Posterior {
    Eigen::VectorXd parameters;  // known ones, standardised
    Eigen::VectorXd amplitudes;
    Eigen::VectorXd standardised_amplitudes;
    Eigen::MatrixXd factor;
    double log_determinant = 0;
  };
  struct Peak {
    std::vector<double> parameters, standard_errors;
    double log_evidence = 0, gain = -1e300;
  };

  int rows() const { return offset_.back(); }
  int lit() const { return lit_.count(); }

  void FindAmplitudesOfEntries() {
    block_ = BlocksOfEntries(model_);
    for (int e = 0; e < model_.entries(); ++e) position_.push_back(model_.PlatePositionOf(e));
  }

  SetParameters WithRealisation(const SetParameters& parameters, const RealisedEffect& realised) {
    SetParameters all = parameters;
    all.effects.push_back({&realised, {}});
    return all;
  }

  Entries MeanOf(const Realisation& realisation, bool middle_only) {
    const RealisedEffect realised(realisation);
    return model_.Expect(WithRealisation(null_.parameters, realised), false, middle_only).mean;
  }

  // Change of all entries, whitened as the null's, per unit of what `values` holds for each laser
  // recording. Recordings of different plate positions move together: their entries differ.
  Eigen::MatrixXd Derivative(const Realisation& at, std::vector<double> Realisation::*values,
                             double step, const Entries& origin, bool middle_only = true) {
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), lit());
    for (int slot = 0; slot < lit_.slots(); ++slot) {
      Realisation moved = at;
      for (int i = 0; i < lit(); ++i) {
        if (lit_.SlotOf(i) == slot) (moved.*values)[lit_.frames()[i]] += step;
      }
      const Entries mean = MeanOf(moved, middle_only);
      const std::vector<int> recordings = lit_.RecordingsOfEntries(slot);
      for (int e = 0; e < model_.entries(); ++e) {
        if (recordings[e] < 0) continue;
        change.col(recordings[e]).segment(offset_[e], mean[e].size()) =
            (*null_.whitening)(e, (mean[e] - origin[e]) / step);
      }
    }
    return change;
  }

  // Of the blocks of plate positions, at a realisation: the reflectances themselves (relative,
  // minus 1) and, of `light`, the change by every recording's amount, what they change.
  Eigen::VectorXd ReflectanceOf(const Realisation& at) const {
    const int blocks = model_.blocks_along_line();
    const std::vector<int>& ids = model_.position_ids();
    Eigen::VectorXd reflectance =
        Eigen::VectorXd::Zero(blocks * static_cast<Eigen::Index>(ids.size()));
    if (at.blocks.empty()) return reflectance;
    for (const int f : lit_.frames()) {
      const Eigen::Index position = PositionIndex(model_, model_.set().frames[f].plate_position_id);
      for (int block = 0; block < blocks; ++block) {
        reflectance[position * blocks + block] =
            (1 + at.light_relative[f]) * (1 + at.blocks[f].light_relative[block]) - 1;
      }
    }
    return reflectance;
  }
  Eigen::MatrixXd ReflectanceOfLight(const Realisation& at, const Eigen::MatrixXd& light) const {
    const int blocks = model_.blocks_along_line();
    const std::vector<int>& ids = model_.position_ids();
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), blocks * ids.size());
    for (int e = 0; e < model_.entries(); ++e) {
      if (position_[e] < 0) continue;
      const Eigen::Index position = PositionIndex(model_, position_[e]);
      const int size = offset_[e + 1] - offset_[e];
      Eigen::VectorXd sum = light.middleRows(offset_[e], size).rowwise().sum();
      for (int block = 0; block < blocks; ++block) {
        if (block_[e] >= 0 && block != block_[e]) continue;
        if (block_[e] >= 0 && !at.blocks.empty()) {
          sum /= 1 + at.blocks[model_.FramesOf(e).front()].light_relative[block];
        }
        change.col(position * blocks + block).segment(offset_[e], size) =
            block_[e] >= 0 ? sum : Eigen::VectorXd(sum / blocks);
      }
    }
    return change;
  }

  // Per relative variance of the light along the blocks of every laser recording: of the texture of
  // that recording only.
  Eigen::MatrixXd ChangeByLightWithinBlocks(const Realisation& at, const Entries& origin) {
    constexpr double kVariance = 1e-2;
    SetParameters varied = null_.parameters;
    const Effect* const texture = FindEffect("surface.albedo_texture");
    varied.effects.push_back({texture, {std::sqrt(kVariance), 1e-3}});
    const RealisedEffect realised(at);
    const Entries mean = model_.Expect(WithRealisation(varied, realised), false).mean;
    const Eigen::VectorXd variance = ScatterLawOf(texture->description().id, model_)
                                         .within(varied.effects.back().parameters, {});
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), lit());
    for (int e = 0; e < model_.entries(); ++e) {
      if (model_.StatisticOf(e).name() != "texture") continue;
      const std::vector<int>& frames = lit_.frames();
      const auto i =
          std::find(frames.begin(), frames.end(), model_.FramesOf(e).front()) - frames.begin();
      change.col(i).segment(offset_[e], mean[e].size()) =
          (*null_.whitening)(e, (mean[e] - origin[e]) / variance[i]);
    }
    return change;
  }

  // Of columns for every laser recording, by plate position.
  Eigen::MatrixXd SumAtPositions(const Eigen::MatrixXd& of_recordings) const {
    const std::vector<int>& ids = model_.position_ids();
    Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(rows(), static_cast<Eigen::Index>(ids.size()));
    for (int i = 0; i < lit(); ++i) {
      const int id = model_.set().frames[lit_.frames()[i]].plate_position_id;
      sums.col(PositionIndex(model_, id)) += of_recordings.col(i);
    }
    return sums;
  }

  // Square of a whitening's inverse.
  Eigen::MatrixXd NullCovariance(int e) const {
    const Eigen::Index n = offset_[e + 1] - offset_[e];
    Eigen::MatrixXd inverse(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      inverse.col(i) = (*null_.whitening)(e, Eigen::VectorXd::Unit(n, i));
    }
    const Eigen::MatrixXd factor =
        inverse.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(n, n));
    return factor * factor.transpose();
  }

  // Movement makes speckle change between recordings of it: what that does is known to a part
  // only, which the null's covariance does not hold.
  bool ChangesCovariance(int e) const { return position_[e] >= 0 && model_.ComparesSpeckle(e); }

  Linearisation Linearise(Amplitude amplitude, const Realisation& at) {
    Linearisation linear;
    const Entries mean = MeanOf(at, false);
    const Entries middle = at.blocks.empty() ? MeanOf(at, true) : mean;
    linear.residual.resize(rows());
    linear.jacobian.resize(rows(), null_.standardised.size());
    for (int e = 0; e < model_.entries(); ++e) {
      const int n = offset_[e + 1] - offset_[e];
      linear.residual.segment(offset_[e], n) =
          (*null_.whitening)(e, model_.observed()[e] - mean[e]);
      linear.jacobian.middleRows(offset_[e], n) = jacobian_[e];
    }
    if (amplitude == Amplitude::kShift) {
      linear.change = Derivative(at, &Realisation::shift_px, 0.1, middle);
      linear.within = Derivative(at, &Realisation::blur_px2, 0.1, middle);
      linear.origin = AtLit(at.shift_px);
      linear.within_origin = AtLit(at.blur_px2);
      RenewCovariance(at, linear);
    } else if (amplitude == Amplitude::kLight) {
      linear.change = Derivative(at, &Realisation::light_relative, 0.02, middle);
      linear.origin = AtLit(at.light_relative);
    } else {
      const Eigen::MatrixXd light =
          Derivative(at, &Realisation::light_relative, 0.02, middle, at.blocks.empty());
      const Eigen::MatrixXd reflectance = ReflectanceOfLight(at, light);
      linear.within = ChangeByLightWithinBlocks(at, mean);
      linear.within_origin = Eigen::VectorXd::Zero(lit());
      const Eigen::MatrixXd varied = SumAtPositions(linear.within);
      linear.change.resize(rows(), reflectance.cols() + varied.cols());
      linear.change << reflectance, varied;
      linear.origin.resize(linear.change.cols());
      linear.origin << ReflectanceOf(at), Eigen::VectorXd::Zero(varied.cols());
    }
    linear.residual += linear.jacobian * null_.standardised + linear.change * linear.origin;
    Project(linear);
    return linear;
  }

  Eigen::VectorXd AtLit(const std::vector<double>& values) const {
    Eigen::VectorXd lit_values(lit());
    for (int i = 0; i < lit(); ++i) lit_values[i] = values[lit_.frames()[i]];
    return lit_values;
  }

  void RenewCovariance(const Realisation& at, Linearisation& linear) {
    const RealisedEffect realised(at);
    const std::vector<Eigen::MatrixXd> covariance =
        model_.Expect(WithRealisation(null_.parameters, realised), true, true).covariance;
    const RealisedEffect known(at_);
    const std::vector<Eigen::MatrixXd> before =
        model_.Expect(WithRealisation(null_.parameters, known), true, true).covariance;
    for (int e = 0; e < model_.entries(); ++e) {
      if (!ChangesCovariance(e)) continue;
      const int n = offset_[e + 1] - offset_[e];
      const Eigen::MatrixXd null_covariance = NullCovariance(e);
      Eigen::MatrixXd renewed = null_covariance;
      renewed.diagonal() += (covariance[e] - before[e]).diagonal().cwiseMax(0);
      const Eigen::LLT<Eigen::MatrixXd> old_factor(null_covariance), new_factor(renewed);
      const Eigen::MatrixXd old_lower = old_factor.matrixL();
      const auto again = [&](auto block) {
        const Eigen::MatrixXd raw = old_lower * block;
        block = new_factor.matrixL().solve(raw);
      };
      again(linear.residual.segment(offset_[e], n));
      again(linear.jacobian.middleRows(offset_[e], n));
      again(linear.change.middleRows(offset_[e], n));
      again(linear.within.middleRows(offset_[e], n));
      linear.covariance[e] = renewed;
      linear.log_determinant += 2 * (new_factor.matrixLLT().diagonal().array().log().sum() -
                                     old_factor.matrixLLT().diagonal().array().log().sum());
    }
  }

  void Project(Linearisation& linear) const {
    Eigen::MatrixXd information = null_.prior_weight.asDiagonal();
    information.noalias() += linear.jacobian.transpose() * linear.jacobian;
    linear.information.compute(information);
    const auto project = [&](const Eigen::MatrixXd& v) -> Eigen::MatrixXd {
      return v - linear.jacobian * linear.information.solve(linear.jacobian.transpose() * v);
    };
    const Eigen::VectorXd residual = project(linear.residual);
    const Eigen::MatrixXd change = project(linear.change);
    linear.inner.noalias() = linear.change.transpose() * change;
    linear.slope = linear.change.transpose() * residual;
    linear.length = linear.residual.dot(residual);
    if (linear.within.size() == 0) return;
    const Eigen::MatrixXd within = project(linear.within);
    linear.within_inner.noalias() = linear.within.transpose() * within;
    linear.within_cross.noalias() = linear.change.transpose() * within;
    linear.within_slope = linear.within.transpose() * residual;
  }

  // The slope and length of the residual once what is drawn within recordings has been taken off.
  static std::pair<Eigen::VectorXd, double> Remaining(const Linearisation& linear,
                                                      const ScatterLaw& law,
                                                      const std::vector<double>& parameters) {
    if (!law.within) return {linear.slope, linear.length};
    const Eigen::VectorXd more = law.within(parameters, linear.origin) - linear.within_origin;
    return {
        linear.slope - linear.within_cross * more,
        linear.length - 2 * more.dot(linear.within_slope) + more.dot(linear.within_inner * more)};
  }

  // Of the covariance of the amplitudes and of what the null's own scatter is not known to.
  Eigen::MatrixXd Factor(const Linearisation& linear, const ScatterLaw& law,
                         const std::vector<double>& parameters) const {
    const Eigen::MatrixXd factor = law.factor(parameters);
    Eigen::MatrixXd covariance = factor * factor.transpose();
    covariance.diagonal() += kScatterError * linear.inner.diagonal().cwiseMax(1e-6).cwiseInverse();
    return covariance.llt().matrixL();
  }

  // Log-likelihood over the null's, amplitudes and known parameters integrated out.
  double Gain(const Linearisation& linear, const ScatterLaw& law,
              const std::vector<double>& parameters) const {
    const Eigen::MatrixXd factor = Factor(linear, law, parameters);
    const auto [slope, length] = Remaining(linear, law, parameters);
    Eigen::MatrixXd information = factor.transpose() * linear.inner * factor;
    information.diagonal().array() += 1;
    const Eigen::LLT<Eigen::MatrixXd> solver(information);
    const Eigen::VectorXd gradient = factor.transpose() * slope;
    const double known = 2 * linear.information.matrixLLT().diagonal().array().log().sum();
    return 0.5 * (null_total_ - length + gradient.dot(solver.solve(gradient))) -
           solver.matrixLLT().diagonal().array().log().sum() -
           0.5 * (known + linear.log_determinant);
  }

  Peak Search(const Linearisation& linear, const ScatterLaw& law, const Effect& effect) const;
  Posterior MostProbable(const Linearisation& linear, const ScatterLaw& law,
                         const std::vector<double>& parameters) const;
  Realisation RealisationOf(const ScatterLaw& law, const std::vector<double>& parameters,
                            const Posterior& posterior) const;
  std::vector<RecordedMovement> MovementOf(const Linearisation& linear) const;
  Linearisation LineariseAboutFreeMovement(Linearisation linear);
  FitResult Describe(const Linearisation& linear, const ScatterLaw& law,
                     const ScatterCandidate& candidate, const Posterior& posterior,
                     const Realisation& realisation);

  const SetModel& model_;
  const FitResult& null_;
  Realisation at_;                         // of null_'s covariances
  std::vector<Eigen::MatrixXd> jacobian_;  // of null_; what is held at a bound stays there
  std::vector<int> offset_;                // of the entries in the vector of all
  std::vector<int> position_;              // of every entry: plate position; -1: none or several
  std::vector<int> block_;                 // of every entry: along the line; -1: all
  LitRecordings lit_;
  double null_total_ = 0;
};

// The evidence is integrated over a grid: logarithmic in the strength, in the shape's standardised
// scale.
RecordingScatter::Peak RecordingScatter::Search(const Linearisation& linear, const ScatterLaw& law,
                                                const Effect& effect) const {
  const std::vector<EffectParameter>& description = effect.description().parameters;
  const EffectParameter& strength = description[0];
  const bool shaped = description.size() > 1;
  struct Point {
    std::vector<double> parameters;
    double gain, log_weight;  // of the prior's mass
  };
  const auto grid = [&](double low, double high, double step, double shape_low, double shape_high,
                        double shape_step) {
    std::vector<Point> points;
    const int strengths = static_cast<int>(std::lround((high - low) / step)) + 1;
    const int shapes =
        shaped ? static_cast<int>(std::lround((shape_high - shape_low) / shape_step)) + 1 : 1;
    for (int j = 0; j < shapes; ++j) {
      double log_shape = 0, shape = 0;
      if (shaped) {
        const double z = shape_low + j * shape_step;
        shape = ParameterFromStandardised(description[1], z);
        log_shape = std::log(shape_step / (pi * (1 + z * z)));
      }
      for (int i = 0; i < strengths; ++i) {
        const double u = low + i * step, z = std::exp(u);
        std::vector<double> parameters = {std::min(strength.upper, strength.prior_scale * z)};
        if (shaped) parameters.push_back(shape);
        const double gain = Gain(linear, law, parameters);
        points.push_back(
            {std::move(parameters), gain, log_shape + std::log(step * z * 2 / (pi * (1 + z * z)))});
      }
    }
    return points;
  };
  const auto summarise = [&](const std::vector<Point>& points) {
    Peak peak;
    const Point* best = &points.front();
    double largest = -1e300;
    for (const Point& point : points) {
      largest = std::max(largest, point.gain + point.log_weight);
      if (point.gain > best->gain) best = &point;
    }
    double sum = 0;
    std::vector<double> square(description.size(), 0);
    for (const Point& point : points) {
      const double weight = std::exp(point.gain + point.log_weight - largest);
      sum += weight;
      for (size_t k = 0; k < square.size(); ++k) {
        square[k] += weight * std::pow(point.parameters[k] - best->parameters[k], 2);
      }
    }
    peak.parameters = best->parameters;
    peak.gain = best->gain;
    peak.log_evidence = largest + std::log(sum);
    for (double s : square) peak.standard_errors.push_back(std::sqrt(s / sum));
    return peak;
  };
  constexpr double kWeakest = -6;  // log of the strength over its scale
  const double strongest = std::log(strength.upper / strength.prior_scale);
  const double longest =
      shaped ? std::min(6.0, StandardisedParameter(
                                 description[1], std::min(law.largest_shape, description[1].upper)))
             : 0;
  Peak coarse = summarise(grid(kWeakest, std::min(strongest, 4.0), 0.4, -6, longest, 0.5));
  if (coarse.gain < 1) return coarse;
  if (law.amplitude == Amplitude::kShift) {
    // Whole periods in some exposure or other: many peaks along the frequency.
    const double near = std::log(coarse.parameters[0] / strength.prior_scale);
    const Peak finer = summarise(grid(std::max(kWeakest, near - 0.8),
                                      std::min(strongest, near + 0.8), 0.4, -6, longest, 0.05));
    if (finer.gain > coarse.gain) coarse = finer;
  }
  std::array<double, 2> best = {
      std::log(coarse.parameters[0] / strength.prior_scale),
      shaped ? StandardisedParameter(description[1], coarse.parameters[1]) : 0};
  const auto parameters_at = [&](const std::array<double, 2>& x) {
    std::vector<double> parameters = {
        std::min(strength.upper, strength.prior_scale * std::exp(x[0]))};
    if (shaped) parameters.push_back(ParameterFromStandardised(description[1], x[1]));
    return parameters;
  };
  const auto gain_at = [&](const std::array<double, 2>& x) {
    return Gain(linear, law, parameters_at(x));
  };
  double gain = coarse.gain;
  for (double step = 0.2; step > 2e-3; step /= 2) {
    for (bool moved = true; moved;) {
      moved = false;
      for (size_t k = 0; k < description.size(); ++k) {
        for (const double sign : {-1.0, 1.0}) {
          std::array<double, 2> next = best;
          next[k] += sign * step;
          next[0] = std::clamp(next[0], kWeakest, strongest);
          next[1] = std::min(next[1], longest);
          const double there = gain_at(next);
          if (!(there > gain + 1e-3)) continue;
          gain = there;
          best = next;
          moved = true;
        }
      }
    }
  }
  Peak fine = summarise(grid(std::max(kWeakest, best[0] - 0.6), std::min(strongest, best[0] + 0.6),
                             0.1, best[1] - 0.5, std::min(longest, best[1] + 0.5), 0.1));
  fine.parameters = parameters_at(best);
  fine.gain = gain;
  // A wide distribution is covered by the coarse grid only; a narrow one falls between the points,
  // but has a curvature.
  double laplace = gain;
  for (size_t k = 0; k < description.size(); ++k) {
    constexpr double kStep = 0.02;
    std::array<double, 2> less = best, more = best;
    less[k] -= kStep;
    more[k] += kStep;
    const double curvature = (2 * gain - gain_at(less) - gain_at(more)) / (kStep * kStep);
    const double slope = std::abs(parameters_at(more)[k] - parameters_at(less)[k]) / (2 * kStep);
    const double z = k == 0 ? std::exp(best[0]) : best[1];
    laplace += std::log((k == 0 ? 2 * z : 1) / (pi * (1 + z * z)) *
                        std::sqrt(2 * pi / std::max(1.0, curvature)));
    if (curvature > 1) {
      fine.standard_errors[k] = std::max(fine.standard_errors[k], slope / std::sqrt(curvature));
    }
  }
  fine.log_evidence = std::max({laplace, fine.log_evidence, coarse.log_evidence});
  return fine;
}

RecordingScatter::Posterior RecordingScatter::MostProbable(
    const Linearisation& linear, const ScatterLaw& law,
    const std::vector<double>& parameters) const {
  Posterior posterior;
  posterior.factor = Factor(linear, law, parameters);
  const Eigen::VectorXd slope = Remaining(linear, law, parameters).first;
  Eigen::MatrixXd information = posterior.factor.transpose() * linear.inner * posterior.factor;
  information.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  posterior.standardised_amplitudes = solver.solve(posterior.factor.transpose() * slope);
  posterior.amplitudes = posterior.factor * posterior.standardised_amplitudes;
  Eigen::VectorXd residual = linear.residual - linear.change * posterior.amplitudes;
  if (law.within)
    residual -= linear.within * (law.within(parameters, linear.origin) - linear.within_origin);
  posterior.parameters = linear.information.solve(linear.jacobian.transpose() * residual);
  for (size_t i = 0; i < null_.held.size(); ++i) {
    const auto held = static_cast<Eigen::Index>(i);
    if (null_.held[i]) posterior.parameters[held] = null_.standardised[held];
  }
  posterior.log_determinant = 2 * (solver.matrixLLT().diagonal().array().log().sum() +
                                   linear.information.matrixLLT().diagonal().array().log().sum());
  return posterior;
}

Realisation RecordingScatter::RealisationOf(const ScatterLaw& law,
                                            const std::vector<double>& parameters,
                                            const Posterior& posterior) const {
  Realisation realisation(model_.set().frames.size());
  if (law.amplitude == Amplitude::kReflectance) {
    return RealisedReflectance(model_, posterior.amplitudes);
  }
  const Eigen::VectorXd blur =
      law.within ? law.within(parameters, posterior.amplitudes) : Eigen::VectorXd();
  for (int i = 0; i < lit(); ++i) {
    const int f = lit_.frames()[i];
    if (law.amplitude == Amplitude::kLight) {
      realisation.light_relative[f] = posterior.amplitudes[i];
    } else {
      realisation.shift_px[f] = posterior.amplitudes[i];
      realisation.blur_px2[f] = blur[i];
    }
  }
  return realisation;
}

// Every laser recording's own place and blur, with hardly any prior.
std::vector<RecordedMovement> RecordingScatter::MovementOf(const Linearisation& linear) const {
  constexpr double kShift_px = 10, kBlur_px2 = 10;
  const Eigen::Index n = lit();
  Eigen::MatrixXd information(2 * n, 2 * n);
  information << linear.inner, linear.within_cross, linear.within_cross.transpose(),
      linear.within_inner;
  information.diagonal().head(n).array() += 1 / (kShift_px * kShift_px);
  information.diagonal().tail(n).array() += 1 / (kBlur_px2 * kBlur_px2);
  Eigen::VectorXd slope(2 * n);
  slope << linear.slope + linear.within_cross * linear.within_origin,
      linear.within_slope + linear.within_inner * linear.within_origin;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd found = solver.solve(slope);
  const Eigen::VectorXd variance = solver.solve(Eigen::MatrixXd::Identity(2 * n, 2 * n)).diagonal();
  // The place of a plate position is hardly told from a movement there.
  const double place_error_px = model_.set().description.uncertainty.line_position_each_px;
  std::vector<RecordedMovement> movements;
  for (int i = 0; i < lit(); ++i) {
    movements.push_back(
        {.exposure_time_s = model_.set().frames[lit_.frames()[i]].nominal.exposure_time_s,
         .shift_px = found[i],
         .shift_error_px = std::hypot(std::sqrt(variance[i]), place_error_px),
         .blur_px2 = std::max(0.0, found[n + i]),
         .blur_error_px2 = std::sqrt(variance[n + i])});
  }
  return movements;
}

// Strong movement is seen in every recording by itself. What a law that is not the right one says
// of it would keep the next linearisation where that law belongs.
Linearisation RecordingScatter::LineariseAboutFreeMovement(Linearisation linear) {
  constexpr int kTurns = 3;
  constexpr double kLargestStep_px = 0.5, kLargestStep_px2 = 0.5;  // a profile is far from linear
  for (int turn = 0; turn < kTurns; ++turn) {
    const std::vector<RecordedMovement> movements = MovementOf(linear);
    Realisation realisation(model_.set().frames.size());
    for (int i = 0; i < lit(); ++i) {
      realisation.shift_px[lit_.frames()[i]] =
          linear.origin[i] +
          std::clamp(movements[i].shift_px - linear.origin[i], -kLargestStep_px, kLargestStep_px);
      realisation.blur_px2[lit_.frames()[i]] =
          linear.within_origin[i] + std::clamp(movements[i].blur_px2 - linear.within_origin[i],
                                               -kLargestStep_px2, kLargestStep_px2);
    }
    linear = Linearise(Amplitude::kShift, realisation);
  }
  return linear;
}

// The fit by the model itself at the most probable realisation.
FitResult RecordingScatter::Describe(const Linearisation& linear, const ScatterLaw& law,
                                     const ScatterCandidate& candidate, const Posterior& posterior,
                                     const Realisation& realisation) {
  FitResult fit = null_;
  SetupDeviation uncertainty = model_.set().description.uncertainty;
  Eigen::Index at = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double scale = DeviationAt(uncertainty, i);
    if (scale > 0) DeviationAt(fit.parameters.deviations, i) = posterior.parameters[at++] * scale;
  }
  if (uncertainty.line_position_each_px > 0) {
    for (int id : model_.position_ids()) {
      fit.parameters.line_shift_px[id] =
          posterior.parameters[at++] * uncertainty.line_position_each_px;
    }
  }
  for (double& error : fit.parameters.model_error.standardised) error = posterior.parameters[at++];
  for (const FreeEffectParameter& free : null_.free) {
    ActiveEffect& active = fit.parameters.effects[free.effect];
    active.parameters[free.parameter] = ParameterFromStandardised(
        active.effect->description().parameters[free.parameter], posterior.parameters[at++]);
  }
  const RealisedEffect realised(realisation);
  fit.mean = model_.Expect(WithRealisation(fit.parameters, realised), false).mean;
  fit.drawn = std::make_shared<const RealisedEffect>(realisation);
  fit.drawn_besides_law = law.amplitude == Amplitude::kReflectance;
  const int first = static_cast<int>(fit.parameters.effects.size());
  fit.parameters.effects.push_back({candidate.effect, candidate.parameters});
  for (size_t k = 0; k < candidate.parameters.size(); ++k) {
    fit.free.push_back({first, static_cast<int>(k)});
    fit.effect_standard_errors.push_back(candidate.standard_errors[k]);
  }
  if (law.amplitude == Amplitude::kReflectance) {
    // A realisation does not express what varies within blocks.
    const Eigen::VectorXd residual =
        linear.residual - linear.jacobian * posterior.parameters -
        linear.change * posterior.amplitudes -
        linear.within * law.within(candidate.parameters, posterior.amplitudes);
    for (int e = 0; e < model_.entries(); ++e) {
      const int n = offset_[e + 1] - offset_[e];
      fit.residual[e] = residual.segment(offset_[e], n);
      const Eigen::LLT<Eigen::MatrixXd> solver(NullCovariance(e));
      fit.mean[e] = model_.observed()[e] - solver.matrixL() * fit.residual[e];
    }
  } else {
    if (!linear.covariance.empty()) {
      std::vector<Eigen::MatrixXd> covariance;
      for (int e = 0; e < model_.entries(); ++e) {
        const auto renewed = linear.covariance.find(e);
        covariance.push_back(renewed != linear.covariance.end() ? renewed->second
                                                                : NullCovariance(e));
      }
      fit.whitening = std::make_shared<const Whitening>(covariance, Entries());
      fit.data_log_determinant += linear.log_determinant;
    }
    for (int e = 0; e < model_.entries(); ++e) {
      fit.residual[e] = (*fit.whitening)(e, model_.observed()[e] - fit.mean[e]);
    }
  }
  const Eigen::MatrixXd columns = linear.change * posterior.factor;
  fit.chi_squared = 0;
  for (int e = 0; e < model_.entries(); ++e) {
    const int n = offset_[e + 1] - offset_[e];
    Eigen::MatrixXd jacobian(n, linear.jacobian.cols() + columns.cols());
    jacobian << linear.jacobian.middleRows(offset_[e], n), columns.middleRows(offset_[e], n);
    fit.jacobian[e] = std::move(jacobian);
    fit.entry_chi_squared[e] = fit.residual[e].squaredNorm();
    fit.chi_squared += fit.entry_chi_squared[e];
  }
  fit.standardised.resize(posterior.parameters.size() + posterior.amplitudes.size());
  fit.standardised << posterior.parameters, posterior.standardised_amplitudes;
  fit.prior_weight.resize(fit.standardised.size());
  fit.prior_weight << null_.prior_weight, Eigen::VectorXd::Ones(posterior.amplitudes.size());
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  for (const Eigen::MatrixXd& jacobian : fit.jacobian) {
    information.noalias() += jacobian.transpose() * jacobian;
  }
  fit.covariance = information.llt().solve(
      Eigen::MatrixXd::Identity(fit.standardised.size(), fit.standardised.size()));
  fit.prior = fit.standardised.squaredNorm();
  fit.log_determinant = posterior.log_determinant;
  return fit;
}

ScatterCandidate RecordingScatter::Evaluate(const Effect& effect, Realisation& at) {
  const ScatterLaw law = ScatterLawOf(effect.description().id, model_);
  // Again where that has led to, if it is anywhere.
  constexpr double kWorthwhile = 3;
  const bool moves = law.amplitude == Amplitude::kShift;
  const int rounds = moves ? 4 : law.amplitude == Amplitude::kReflectance ? 1 : 2;
  ScatterCandidate best;
  Realisation from = at;
  double baseline = 0, before = 0;
  for (int round = 0; round < rounds; ++round) {
    Linearisation linear = Linearise(law.amplitude, from);
    Peak peak = Search(linear, law, effect);
    if (round == 0) {
      // What the uncertainty of the null's own scatter explains is no effect.
      std::vector<double> none = peak.parameters;
      none[0] = 0;
      baseline = std::clamp(Gain(linear, law, none), 0.0, kMostUnknownScatter);
    }
    const bool single =
        moves && peak.gain - baseline > kWorthwhile && IsSeenInSingleRecordings(MovementOf(linear));
    std::vector<double> phases_rad;
    if (single) {
      linear = LineariseAboutFreeMovement(std::move(linear));
      peak = Search(linear, law, effect);
    }
    if (single && effect.description().id == kVibration) {
      const std::vector<RecordedMovement> movements = MovementOf(linear);
      const VibrationFit fit = FitVibration(movements);
      peak.parameters = {fit.amplitude_px, fit.frequency_hz};
      phases_rad = PhasesOfMovements(model_, peak.parameters, movements);
      peak.standard_errors = {fit.amplitude_error_px, fit.frequency_error_hz};
    }
    const Posterior posterior = MostProbable(linear, law, peak.parameters);
    from = RealisationOf(law, peak.parameters, posterior);
    ScatterCandidate candidate;
    candidate.effect = &effect;
    candidate.parameters = peak.parameters;
    candidate.standard_errors = peak.standard_errors;
    if (law.amplitude != Amplitude::kLight && !single) {
      candidate.standard_errors[0] =
          std::hypot(candidate.standard_errors[0], kStrengthError * candidate.parameters[0]);
    }
    candidate.log_evidence = peak.log_evidence - baseline;
    candidate.largest_gain = peak.gain - baseline;
    candidate.light_relative = from.light_relative;
    candidate.shift_px = from.shift_px;
    candidate.phases_rad = std::move(phases_rad);
    candidate.fit = Describe(linear, law, candidate, posterior, from);
    // Far off, straight lines lead astray: the model itself decides.
    if (round == 0 || TwiceCost(candidate.fit) < TwiceCost(best.fit)) {
      best = std::move(candidate);
      at = from;
    }
    const double gained = peak.gain - before;
    before = peak.gain;
    if (single || peak.gain - baseline <= kWorthwhile || (round > 0 && std::abs(gained) < 0.5))
      break;
  }
  return best;
}

// Where what was drawn is so strong that it leads the null model's parameters astray: these and
// what was drawn are found in turn. `effects` draw the same (light, movement or reflectance) by
// different laws, which are compared about one fit: they are to differ by what they say of the
// draws only.
std::vector<ScatterCandidate> EvaluateStrong(const SetModel& model, const FitResult& null,
                                             const std::vector<const Effect*>& effects) {
  SetParameters start;
  start.effects = null.parameters.effects;
  Realisation at(model.set().frames.size());
  const bool moves = Moves(*effects[0]);
  if (moves) {
    at = LineMovements(model, start);
  } else if (IsTexture(effects[0]->description().id)) {
    at = RealisedReflectance(model, ReflectanceExcesses(model, start));
  } else {
    at.light_relative = LightExcesses(model, start);
  }
  std::vector<FitSettings::Round> rounds = {{0.3, 0.3}, {0.1, 0.3}, {0.01, 0.1}, {0, 0}};
  std::vector<ScatterCandidate> best(effects.size());
  double cost = 0;
  const int most_turns = null.parameters.effects.empty() ? 4 : 2;
  for (int turn = 0; turn < most_turns; ++turn) {
    const FitResult about = FitAtRealisation(model, null, start, at, rounds);
    RecordingScatter scatter(model, about, at, null);
    std::vector<ScatterCandidate> candidates;
    candidates.reserve(effects.size());
    std::vector<Realisation> led_to(effects.size(), at);
    size_t leading = 0;
    for (size_t i = 0; i < effects.size(); ++i) {
      candidates.push_back(scatter.Evaluate(*effects[i], led_to[i]));
      // A vibration is followed from where it has led by itself.
      const bool better = candidates[i].log_evidence > candidates[leading].log_evidence;
      if (i == 0 || (better && !moves)) leading = i;
    }
    const double cost_of_turn = TwiceCost(candidates[leading].fit);
    const double gained = turn == 0 ? 0 : cost - cost_of_turn;
    if (turn == 0 || gained > 0) {
      cost = cost_of_turn;
      start = candidates[leading].fit.parameters;
      start.effects.pop_back();
      at = led_to[leading];
      best = std::move(candidates);
    }
    if (turn > 0 && gained < 1) break;
    rounds = {{0, 0.1}, {0, 0}};
    if (!moves) continue;
    // What no uncertainty of a position allows has been movement.
    const double allowed_px = 3 * model.set().description.uncertainty.line_position_each_px;
    for (auto& [id, shift_px] : start.line_shift_px) {
      const double held_px = std::clamp(shift_px, -allowed_px, allowed_px);
      for (size_t f = 0; f < at.shift_px.size(); ++f) {
        if (model.set().frames[f].plate_position_id == id) at.shift_px[f] += shift_px - held_px;
      }
      shift_px = held_px;
    }
  }
  return best;
}

// Normal amplitudes and a symmetric blur are left behind where single recordings show more.
void FollowPhases(const SetModel& model, const FitResult& null, ScatterCandidate& candidate) {
  SetParameters start = candidate.fit.parameters;
  start.effects.pop_back();
  FollowedVibration followed = FollowVibration(model, start, null.free, *candidate.effect,
                                               {candidate.parameters[0], candidate.parameters[1]},
                                               std::move(candidate.phases_rad));
  candidate.phases_rad.clear();
  FitResult& fit = followed.fit;
  const double gained = 0.5 * (TwiceCost(candidate.fit) - TwiceCost(fit));
  if (!(gained > 0)) return;
  candidate.parameters = fit.parameters.effects.back().parameters;
  const size_t before = fit.effect_standard_errors.size() - candidate.parameters.size();
  candidate.standard_errors.assign(fit.effect_standard_errors.begin() + before,
                                   fit.effect_standard_errors.end());
  candidate.log_evidence += gained;
  candidate.largest_gain += gained;
  candidate.fit = std::move(fit);
  candidate.phases_rad = std::move(followed.phases_rad);
}

constexpr std::array<std::string_view, 8> kKnown = {
    "illumination.power_noise",    "time.exposure_jitter",
    "surface.albedo_texture",      kVibration,
    "unknown.power_scatter",       "unknown.exposure_scatter",
    "unknown.reflectance_scatter", "unknown.movement"};

}  // namespace

// So much that the null model's parameters may have been led astray by it.
bool ScattersStrongly(const SetModel& model, const FitResult& fit) {
  double chi_squared = 0, count = 0;
  for (int e = 0; e < model.entries(); ++e) {
    if (!model.ComparesSpeckle(e)) continue;
    chi_squared += fit.residual[e].squaredNorm();
    count += static_cast<double>(fit.residual[e].size());
  }
  return chi_squared > 10 * count;
}

bool IsRecordingScatter(const Effect& effect) {
  return std::find(kKnown.begin(), kKnown.end(), effect.description().id) != kKnown.end();
}

std::vector<ScatterCandidate> CompareRecordingScatter(const SetModel& model, const FitResult& null,
                                                      std::span<const Effect* const> effects,
                                                      bool perhaps_strong) {
  const bool strong = perhaps_strong && ScattersStrongly(model, null);
  const Realisation none(model.set().frames.size());
  RecordingScatter scatter(model, null, none, null);
  std::vector<const Effect*> strong_light, strong_movement, strong_reflectance;
  std::map<const Effect*, ScatterCandidate> found;
  for (const Effect* effect : effects) {
    if (!IsRecordingScatter(*effect)) continue;
    const bool of_places = IsTexture(effect->description().id);
    if (strong && !of_places) {
      (Moves(*effect) ? strong_movement : strong_light).push_back(effect);
      continue;
    }
    Realisation at = none;
    if (Moves(*effect)) at.shift_px = DisplacementsAtPositions(model, null.parameters);
    found[effect] = scatter.Evaluate(*effect, at);
    // Places differ: recordings of one tell nothing of how much.
    if (of_places && found[effect].fit.chi_squared < kStrongTextureLeaves * null.chi_squared) {
      strong_reflectance.push_back(effect);
    }
  }
  for (const auto& family : {strong_light, strong_movement, strong_reflectance}) {
    if (family.empty()) continue;
    for (ScatterCandidate& candidate : EvaluateStrong(model, null, family)) {
      found[candidate.effect] = std::move(candidate);
    }
  }
  std::vector<ScatterCandidate> candidates;
  for (const Effect* effect : effects) {
    if (!IsRecordingScatter(*effect)) continue;
    // Where something else has made recordings of one place agree, there is nothing to follow.
    if (!perhaps_strong) found[effect].phases_rad.clear();
    if (!found[effect].phases_rad.empty()) FollowPhases(model, null, found[effect]);
    candidates.push_back(std::move(found[effect]));
  }
  return candidates;
}

}  // namespace sightline
