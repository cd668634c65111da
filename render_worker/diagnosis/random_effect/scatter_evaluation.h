// SPDX-License-Identifier: Apache-2.0
// How well a law of what is drawn explains how recordings scatter; for the files that implement it.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/lit_recordings.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/random_effect/scatter_law.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

inline constexpr std::string_view kVibration = "time.vibration_blur";

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
                   const FitResult& null);

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

  void FindAmplitudesOfEntries();
  SetParameters WithRealisation(const SetParameters& parameters, const RealisedEffect& realised);
  Entries MeanOf(const Realisation& realisation, bool middle_only);

  // Change of all entries, whitened as the null's, per unit of what `values` holds for each laser
  // recording. Recordings of different plate positions move together: their entries differ.
  Eigen::MatrixXd Derivative(const Realisation& at, std::vector<double> Realisation::*values,
                             double step, const Entries& origin, bool middle_only = true);

  // Of the blocks of plate positions, at a realisation: the reflectances themselves (relative,
  // minus 1) and, of `light`, the change by every recording's amount, what they change.
  Eigen::VectorXd ReflectanceOf(const Realisation& at) const;
  Eigen::MatrixXd ReflectanceOfLight(const Realisation& at, const Eigen::MatrixXd& light) const;

  // Per relative variance of the light along the blocks of every laser recording: of the texture of
  // that recording only.
  Eigen::MatrixXd ChangeByLightWithinBlocks(const Realisation& at, const Entries& origin);

  // Of columns for every laser recording, by plate position.
  Eigen::MatrixXd SumAtPositions(const Eigen::MatrixXd& of_recordings) const;

  // Square of a whitening's inverse.
  Eigen::MatrixXd NullCovariance(int e) const;

  // Movement makes speckle change between recordings of it: what that does is known to a part
  // only, which the null's covariance does not hold.
  bool ChangesCovariance(int e) const { return position_[e] >= 0 && model_.ComparesSpeckle(e); }

  Linearisation Linearise(Amplitude amplitude, const Realisation& at);
  Eigen::VectorXd AtLit(const std::vector<double>& values) const;
  void RenewCovariance(const Realisation& at, Linearisation& linear);
  void Project(Linearisation& linear) const;

  // The slope and length of the residual once what is drawn within recordings has been taken off.
  static std::pair<Eigen::VectorXd, double> Remaining(const Linearisation& linear,
                                                      const ScatterLaw& law,
                                                      const std::vector<double>& parameters);

  // Of the covariance of the amplitudes and of what the null's own scatter is not known to.
  Eigen::MatrixXd Factor(const Linearisation& linear, const ScatterLaw& law,
                         const std::vector<double>& parameters) const;

  // Log-likelihood over the null's, amplitudes and known parameters integrated out.
  double Gain(const Linearisation& linear, const ScatterLaw& law,
              const std::vector<double>& parameters) const;

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

}  // namespace sightline
