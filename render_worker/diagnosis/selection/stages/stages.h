// SPDX-License-Identifier: Apache-2.0
// Stages of the model comparison, in the order of CompareModels. Each takes the hypotheses of the
// stage before and returns them with its own; none changes anything else. Stages that report
// progress return a StageResult, since they can be stopped.
#pragma once

#include <optional>
#include <vector>

#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/selection/context.h"
#include "render_worker/diagnosis/selection/stages/screen.h"

namespace sightline {

struct StageResult {
  std::vector<Hypothesis> hypotheses;
  bool stopped = false;  // Context::proceed returned false; hypotheses are those found until then
};

// The effects of largest screened gain, each fitted by itself together with the set-up's
// parameters. Sorted by evidence.
StageResult FitSingles(const Context& context, std::vector<Hypothesis> hypotheses);

// Only if the null model is hopeless, no hypothesis so far brings it near the data, and recordings
// of one position show the line at different places: fits a vibration with its phases. If that
// succeeds, hypotheses under the null model's covariance are dropped and the others get an evidence
// that compares with the vibration's. Otherwise the hypotheses are returned as they are. Sorted.
std::vector<Hypothesis> FollowStrongVibration(const Context& context,
                                              std::vector<Hypothesis> hypotheses);
// True if FollowStrongVibration succeeded.
bool VibrationIsFollowed(const std::vector<Hypothesis>& hypotheses);

// Adds the most promising combinations of 2 to ComparisonSettings::max_effects effects. Sorted.
StageResult FitPairs(const Context& context, std::vector<Hypothesis> hypotheses);

// The first hypothesis fitted under a covariance of its own. `fit` is empty if the null model is
// not rejected, since its covariance is good enough then, or if there is no hypothesis.
struct BestRefit {
  std::optional<FitResult> fit;
  bool stopped = false;
};
BestRefit RefitBest(const Context& context, const std::vector<Hypothesis>& hypotheses);

// Adds every random effect per recording or place by itself, with its amplitudes integrated out.
// `best`: BestRefit::fit, or null. Sorted.
std::vector<Hypothesis> AddRandomEffects(const Context& context, std::vector<Hypothesis> hypotheses,
                                         const FitResult* best);
// True if a random effect explains most, also compared with `best`, which may be null.
bool RandomEffectLeads(const std::vector<Hypothesis>& hypotheses, const FitResult* best);

// The null model under the covariance of the first hypothesis, which is closer to the truth than
// the null model's own, and the fit with that covariance. `best`: BestRefit::fit; if empty, it is
// fitted here. Without hypotheses both come from the context.
struct ReferenceResult {
  FitResult null;           // for Context::null
  FitResult linearisation;  // for Context::linearisation
  bool stopped = false;
};
ReferenceResult ReferenceOfBest(const Context& context, const std::vector<Hypothesis>& hypotheses,
                                std::optional<FitResult> best);
// Fits all hypotheses (none of which is a random effect) under the covariance of
// Context::linearisation, then each effect of the best one alone, starting at their common result:
// earlier, it may have been stuck where other parameters compensated for it. Sorted.
StageResult FitUnderOneCovariance(const Context& context, std::vector<Hypothesis> hypotheses);

// Adds pairs of an effect and a random effect; or of an effect and the vibration, if it was
// followed. Sorted.
StageResult AddRandomEffectsBeside(const Context& context, std::vector<Hypothesis> hypotheses);
// The second of them. Speckle that moves during exposures is modelled in part only, and another
// effect might seem to explain the rest: observation blocks about speckle are left out.
StageResult AddEffectsBesideVibration(const Context& context, std::vector<Hypothesis> hypotheses);

// The single named effect of largest evidence that is no random effect; null: there is none.
// `hypotheses` must be sorted by evidence.
const Hypothesis* BestSingle(const std::vector<Hypothesis>& hypotheses);
// True if predictions reject the named model of largest evidence, or if there is none.
bool NamedIsRejected(const Context& context, const std::vector<Hypothesis>& hypotheses);

// Only if the null model is rejected and predictions reject the best named model: looks for a
// second effect in what the best single one leaves, under the covariance of all hypotheses, and
// fits both together. FitPairs does so earlier under the null model's covariance, which strong
// effects make meaningless. Sorted.
StageResult AddSecondEffect(const Context& context, std::vector<Hypothesis> hypotheses);

// Adds pairs of the best single effect and a model-discrepancy term: an effect that is only near
// the truth needs such a term, the true one does not. Terms of the effect's own stage, and of all
// stages if predictions reject the best hypothesis. Sorted.
StageResult AddTermsBeside(const Context& context, std::vector<Hypothesis> hypotheses);

// Only if a discrepancy term has the largest evidence, or predictions reject the best named model:
// adds, for every stage, a discrepancy of several of its terms, by itself and beside the best
// single effect. Their coefficients are added one by one while the evidence of the linearised model
// grows by more than the prior of the choice costs (forward selection; MacKay, Bayesian
// Interpolation, Neural Computation 4 (1992) 415). The best kStageFits of these are fitted. Sorted.
StageResult AddStageDiscrepancies(const Context& context, std::vector<Hypothesis> hypotheses);

// Fits the leading model-discrepancy terms with only those coefficients that raise the evidence.
// Sorted.
std::vector<Hypothesis> DropCoefficients(const Context& context,
                                         std::vector<Hypothesis> hypotheses);

// Numbers of effects and terms that prior probabilities are shared among.
struct HypothesisCounts {
  int effects = 0;
  int free_forms = 0;
};
HypothesisCounts CountsOf(const ComparisonSettings& settings);
// Log evidence of every hypothesis, discounted for the model's own errors [nats]: these, and
// errors of the best effect's modelled change, can look like another effect in its place. An
// additional effect with another change counts in full beyond the gain that such errors could give
// it.
// `effect_error_of_all`: relative error of modelled changes that the covariance does not contain.
std::vector<double> TrustedEvidence(const std::vector<Hypothesis>& hypotheses,
                                    double effect_error_of_all);
// kEffectError, or 0 for a corrected model.
double EffectErrorOf(const SetModel& model);

// True if the error kEffectError of the change by `hypothesis` from the null model may cause a chi
// squared above kErrorWorthRendering. False for a corrected model.
bool ModelErrorsCount(const Context& context, const Hypothesis& hypothesis);
// Sets `log_prior` and `probability`, most probable first. `hypotheses`: at least one.
std::vector<Hypothesis> RankHypotheses(const HypothesisCounts& counts,
                                       std::vector<Hypothesis> hypotheses,
                                       double effect_error = kEffectError);
// Adds the null model, drops hypotheses with an effect that is not detected, and ranks the rest.
std::vector<Hypothesis> Rank(const Context& context, std::vector<Hypothesis> hypotheses);

// Drops hypotheses that do not predict recordings left out clearly better than without one of their
// effects or terms, and judges the rest (render_worker/evidence/judgement.h). Returns `ranked`,
// `named`, both checks and the remainder.
ModelComparison HoldToPredictions(const Context& context, std::vector<Hypothesis> ranked);

// How well the leading hypotheses that act at a stage predict settings that they were not fitted to
// (transfer/transfer_score.h): the best one of each stage. All must be fitted under one covariance.
// Largest gain first.
std::vector<StageTransfer> TransferOfStages(const Context& context,
                                            const std::vector<Hypothesis>& hypotheses);
// The stage of largest gain and the next one, if that is within two standard errors; no stage that
// predicts worse than the null model.
std::vector<Stage> StagesByTransfer(const std::vector<StageTransfer>& transfer);

// Effects whose whitened change is parallel to that of the first hypothesis' first effect after the
// set-up's parameters have absorbed what they can: squared cosine above kSameChange.
std::vector<const Effect*> EquivalenceClass(const Context& context, const Screening& about_null,
                                            const std::vector<Hypothesis>& ranked);

}  // namespace sightline
