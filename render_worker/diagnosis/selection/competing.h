// SPDX-License-Identifier: Apache-2.0
// Explanations that compete, from the screening to the names; for the files that implement it.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competition.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {

// Chi squared over numbers above which the null model fails.
inline constexpr double kRejected = 1.5;
inline constexpr double kPromising = 10;  // [nats]
inline constexpr double kPairGain = 8;    // [nats] about what a second effect's prior odds cost
// A model is rejected by recordings not fitted below this probability of them.
inline constexpr double kRejectedBelow = 0.01;

class Competing {
 public:
  Competing(const SetModel& model, const FitResult& null, const CompetitionSettings& settings,
            const std::function<bool(double)>& progress);

  Competition Run();

 private:
  void Rank();
  Competition Unfinished();

  bool Report(double fraction) {
    if (!stopped_ && !progress_(fraction)) stopped_ = true;
    return !stopped_;
  }

  void Screen();
  void Fit(Candidate& candidate, const FitResult& reference, bool renew, int iterations) const;

  // From the nominal description on: where the null model is far off, so are its deviations.
  void FitAfresh(Candidate& candidate) const;
  void SortByEvidence();

  bool NullIsRejected() const {
    return competition_.null.chi_squared > kRejected * competition_.null.data_count;
  }

  // True if nothing is near the null model, no effect found so far brings it there, recordings of
  // one place show the line at different ones, and a vibration explains them: it is among the
  // candidates then, and what the null model leaves tells nothing of others.
  bool FollowsVibration();
  void FitSingles();

  // An effect besides those of a candidate: what it gains by the linearised model.
  struct Joint {
    const Candidate* base;
    ActiveEffect added;
    double gain;
  };

  static bool Has(const Candidate& candidate, const Effect* effect);

  // The shape of an effect that has been found by itself belongs to what others have left out, not
  // to what is left besides them.
  std::vector<ScreenedEffect> ScreenShapesBesides(const Candidate& base);

  // `besides`: effects screened about the base, which count instead of those about the null model.
  void AddJoints(const Candidate& base, const std::vector<ScreenedEffect>& besides,
                 std::vector<Joint>& joints) const;

  // By what both are expected to explain together.
  static void SortByTotal(std::vector<Joint>& joints);
  static bool SameEffects(const Candidate& a, const Candidate& b);
  static ActiveEffect Scaled(ActiveEffect active, double amplitude);
  void FitPairs();

  // The best of the effects that change what is expected, under its own covariance: where the null
  // model is rejected, that of the null model tells little.
  void RenewBest();
  FitResult FitOfBest() const;
  bool ScatterLeads() const;

  // The covariance of the best model is nearer the truth than that of the null model; derivatives
  // with respect to the deviations are renewed too.
  void FitUnderOneCovariance();

  // Each effect of several by itself, from where all of them led: by itself it may have been stuck
  // where other parameters made up for it.
  void FitPartsOfBest(const FitResult& reference);

  // The best effect's law may be near the truth and not it: besides it free-form terms of its
  // stage, which such a law needs and a true one does not.
  void AddTermsToBest();

  // Terms hold coefficients for whatever may come; physics that is simple needs few of them.
  void SelectTerms();

  // Fitted with those coefficients of its term that the recordings ask for; nothing: that is all,
  // or the evidence is not expected to reach `least`.
  std::optional<Candidate> WithFewerCoefficients(const Candidate& candidate, double least) const;

  void AddRecordingScatter();

  // Strengths, too, that have been found for want of what scatters are not those besides it.
  std::vector<ScreenedEffect> ScreenBesidesScatter(const Candidate& scatter);

  // All effects of the vocabulary that change what is expected. `fraction`: of what is done.
  std::vector<ScreenedEffect> ScreenNamed(const Screening& screening, double fraction);

  // The best effects by themselves, or the best besides what scatters if that explains most.
  std::vector<Candidate> BasesOfScatter();

  // Pairs of an effect and of what scatters besides it.
  void AddScatterToBest();

  // Effects besides a vibration that has been followed. Its speckle, which moves during exposures,
  // is modelled to a part only, and another effect might seem to explain the rest: what is about
  // speckle is left out.
  void AddToVibration();
  PredictiveCheck Check(const Candidate& candidate) const;
  static std::vector<double> Drawn(const ScatterCandidate& scatter);

  // The best score of what a candidate's effects must improve on: the null model's, or that of
  // fewer of its effects.
  double ScoreWithout(const Candidate& candidate, const std::vector<double>& scores) const;

  // Names are given to what predicts recordings that were not fitted; the rest is unknown physics.
  void JudgeByPredictions();
  void EraseWhatDoesNotPredict();

  // Gives unknown physics that probability. If no term of it has been worth a fit, the one that
  // promised most stands for it, without a strength, so that it has a stage.
  void ShareWithUnknown(double share);
  void FindClass();

  const SetModel& model_;
  CompetitionSettings settings_;
  const std::function<bool(double)>& progress_;
  CandidateCounts counts_;
  Screening screening_;
  // Of the settings: what changes expectations, and what scatters between recordings.
  std::vector<const Effect*> expected_, scattering_;
  Competition competition_;
  // Of the first candidate, before all are fitted under one covariance.
  std::optional<FitResult> best_renewed_;
  FitResult about_;  // whose derivatives with respect to the known parameters count for all
  std::vector<Candidate> candidates_;
  bool stopped_ = false;
};

}  // namespace sightline
