// SPDX-License-Identifier: Apache-2.0
// All thresholds of the model comparison. Each comment states the unit and the source; "Chosen"
// means that no paper or program gives the value, and the reason follows. Values that limit the
// work of a stage change the answer only if they are too small. Evaluate every change with
// bench/concealed.
#pragma once

#include <array>
#include <cstddef>

namespace sightline::thresholds {

// Standard errors by which one of an effect's parameters must differ from its null value, in a
// hypothesis of several effects. Derived: the two-sided 95 % interval of a normal distribution.
inline constexpr double kDetected_standard_errors = 2;

// --- Evidence that makes a stage look further ---

// Chi squared over the number of data above which the null model is rejected. Chosen: null sets of
// bench/concealed stay below 1, since the covariance contains the model's own error.
inline constexpr double kRejected = 1.5;
// Log evidence of an effect on which further stages build [nats]. Chosen: twice the 5 nats that
// Kass and Raftery call very strong.
inline constexpr double kPromising_nats = 10;
// Expected gain at which another effect or a term is added to a hypothesis [nats]. Derived: its
// prior odds cost ln(66 / kOneMorePrior) = 6.5 for the 66 effects considered, and evidence counts
// kEvidenceWeight = 0.8.
inline constexpr double kPairGain_nats = 8;
// Chi squared over the number of data of the null model, from which on a vibration is tried as the
// only explanation. Chosen: so far off, changes about the null model are far from linear and rank
// no effects.
inline constexpr double kHopeless = 1000;
// An effect that leaves less than this fraction of the null model's chi squared explains the
// recordings without a vibration. Chosen: an effect that is only near the
// truth leaves far more than this of a hopeless null model.
inline constexpr double kMostlyExplained = 0.05;
// Squared cosine between two effects' whitened changes, above which recordings cannot tell them
// apart. Derived: it is the fraction of the expected gain that one effect gets in place of the
// other; bench/concealed accepts the same 98 % as equivalent.
inline constexpr double kSameChange = 0.98;

// --- Fits of single effects and pairs: how many, by the time they take ---

// Expected gain above which an effect is fitted [nats]. Chosen: less than half of kClearGain_nats,
// since a fit finds more than screening expects.
inline constexpr double kWorthAFit_nats = 1.5;
// Single effects that are fitted, and hypotheses kept for the common covariance. Chosen: by time,
// a fit each.
inline constexpr size_t kFitted = 12;
// Hypotheses fitted with derivatives of their own under the common covariance. Chosen: a fit with
// derivatives takes several times as long.
inline constexpr size_t kFittedAgain = 5;
// Single effects fitted from the nominal description, if the null model is rejected. Chosen: such a
// fit takes five rounds.
inline constexpr size_t kFittedFromNominal = 4;
// Promising effects that are fitted in this way even if the null model is not rejected, since its
// deviations may hide them. Chosen: as few as a pair.
inline constexpr size_t kFittedFromNominalAnyway = 2;
// Linear gain above which parameters of the null model at their bounds may have absorbed an effect
// [nats]. Chosen: as kPromising_nats.
inline constexpr double kDisplacedGain_nats = 10;
// They have absorbed it if the gain with these bounds is below this fraction of the linear gain.
// Chosen: half.
inline constexpr double kDisplacedPart = 0.5;
// A fit from the nominal description has failed if its evidence is below this fraction of the gain
// that screening expected. Chosen: screening overestimates by the prior's cost, some nats.
inline constexpr double kAstray = 0.8;
// Hypotheses to which a further effect is added, and combinations that are fitted for each number
// of effects. Chosen: by time, a fit each.
inline constexpr size_t kBases = 4;
inline constexpr size_t kPairs = 4;
// Number of effects with which random effects are combined, or of effects combined with one random
// effect. Chosen: by time, a search over the parameters of every random effect each.
inline constexpr size_t kRandomEffectBases = 2;
// Second effects that are fitted together with a rejected single one. Chosen: by time, a fit with
// derivatives each.
inline constexpr size_t kSecondEffects = 3;
// Fraction of the comparison that is reported as done during this stage. Chosen: late, since the
// time is not known in advance.
inline constexpr double kSecondEffectDone = 0.98;
// Chi squared due to the error of the modelled change, above which a set is rendered before a named
// model is rejected. Chosen: 1 of many hundreds rejects no model.
inline constexpr double kErrorWorthRendering = 1;
// Fraction done that is reported while a set is rendered.
inline constexpr double kRenderingDone = 0.99;
// Amplitude of an added effect over that at which it was screened. Chosen: beyond, the linear model
// is wrong for most effects.
inline constexpr double kMostAmplitude = 3;
// Squared whitened length of a change below which the known parameters absorb it. Chosen: far below
// the 1 of one standard deviation, and above rounding.
inline constexpr double kAbsorbed = 1e-6;
// As kAbsorbed, of the other effect of an equivalence class.
inline constexpr double kAbsorbedInClass = 1e-9;

// --- Model-discrepancy terms (terms/terms_beside.cpp) ---

// Terms that are fitted again with fewer coefficients. Chosen: by time, a fit each.
inline constexpr int kSelected = 4;
// Terms are not fitted again if they stay farther than this behind the best hypothesis [nats].
// Chosen: a probability of e^-(15 kEvidenceWeight) = 6e-6 changes no answer.
inline constexpr double kSelectedBehind_nats = 15;
// Coefficients of a discrepancy of one stage, and such discrepancies that are fitted. Chosen: by
// time; ten numbers describe a smooth function of two variables.
inline constexpr size_t kStageCoefficients = 10;
inline constexpr size_t kStageFits = 4;
// Fraction of the comparison that is reported as done during this stage.
inline constexpr double kStageDiscrepancyDone = 0.99;
// Hypotheses of one stage whose transfer between settings is computed. Chosen: by time; more
// evidence and better transfer go together.
inline constexpr size_t kTransferredOfStage = 3;
// Largest number of stages in the answer, and standard errors of the transfer score within which
// two stages are equal. Derived: the two-sided 95 % interval of a normal distribution. Chosen: two,
// since a third adds too little.
inline constexpr size_t kStagesSaid = 2;
inline constexpr double kAlikeStages_standard_errors = 2;
// Step of the derivative with respect to a coefficient [prior scales]. Chosen: half a scale is far
// above rounding, and terms are nearly linear in it.
inline constexpr double kTermProbe = 0.5;

// --- Screening of one effect (screening/effect_search.cpp) ---

// First step of a parameter [prior scales]. Chosen: half of all rigs are within one scale.
inline constexpr double kProbe = 0.5;
// Strength limit of the search [prior scales]. Chosen: a Cauchy prior has 0.6 % beyond
// it.
inline constexpr double kFarthest = 100;
// Gain of the linearised model that justifies an evaluation [nats]. Chosen: half of
// kWorthAFit_nats.
inline constexpr double kLeastLinearGain_nats = 0.75;
// Squared whitened length of a change up to which the model is taken to be linear. Chosen: five
// standard deviations.
inline constexpr double kLinearLength = 25;
// Fraction of the linear gain that the model itself must reach; otherwise intermediate strengths
// are tried. Chosen: half.
inline constexpr double kStraight = 0.5;
// Relative error of a change computed in the middle of the line only, below which it stands for the
// whole line. Chosen: as kEffectError, the error of a modelled change.
inline constexpr double kMiddleError = 0.02;
// Squared whitened length of a detectable change. Derived: twice an expected gain of 5 nats, the
// limit that bench/concealed uses for effects that cannot be seen.
inline constexpr double kDetectableLength = 10;
// Steps of the search for it, and the logarithm of the length within which it ends. Chosen: the
// power law through two points needs two or three steps.
inline constexpr int kDetectableTrials = 4;
inline constexpr double kDetectableLogError = 0.2;
// Squared whitened length below which a parameter changes nothing: rounding of the expectation.
inline constexpr double kNoChange = 1e-12;
// Prior scales at which shapes without starts of their own are tried. Chosen: the quartiles of a
// Cauchy distribution are at 1; with hidden strengths farther towards 0.
inline constexpr std::array<double, 2> kShapes = {-1.5, 1.5};
inline constexpr std::array<double, 4> kHiddenShapes = {-4.5, -3, -1.5, 1.5};
// Fractions of a threshold at which a parameter is tried beyond it. Chosen: geometric, finer near
// the threshold, since effects grow fast from there.
inline constexpr std::array<double, 6> kBeyondThreshold = {1.0, 0.97, 0.92, 0.85, 0.7, 0.5};
// Relative width to which a threshold is bracketed. Chosen: a third of the first step beyond.
inline constexpr double kThresholdWidth = 1.01;
// Fractions of the best linear strength to try. Chosen: the full step, and a shorter one for
// nonlinear models.
inline constexpr std::array<double, 2> kStepParts = {1.0, 0.4};
// A full step that reaches this fraction of the linear gain suffices. Chosen: more than half.
inline constexpr double kStepReached = 0.6;
// Largest linear step [prior scales]. Chosen: beyond, larger steps are tried by themselves.
inline constexpr double kLargestStep = 8;
// Information that the prior gives about a strength [1 / squared prior scale]. Chosen: weak, so
// that strong effects are not pulled towards none.
inline constexpr double kStrengthInformation = 0.01;

// --- Periodogram over time (screening/flicker_search.cpp) ---

// Frequencies searched [Hz]. Chosen: lamps at one to six times the mains' 50 Hz, and drivers below.
inline constexpr double kLowest_hz = 20, kHighest_hz = 300;
// Frequencies that are handed to the fit. Chosen: the peak and its strongest aliases.
inline constexpr int kFlickerPeaks = 3;
// Steps of frequency a turn of phase over the whole duration. Chosen: twice critical sampling,
// since peaks are refined afterwards.
inline constexpr int kStepsOfTurn = 4;
// Phases rotated before they are computed from scratch. Chosen: rounding stays below 1e-13.
inline constexpr int kStepsTogether = 512;
// Limit of multiplications, some ten seconds: 40 recordings within four hours.
inline constexpr double kMostProducts = 2e10;
// Peaks nearer than this are one peak [Hz]. Chosen: the width for recordings within two minutes.
inline constexpr double kWidthOfPeak_hz = 0.01;
// Fewest recordings with other light. Derived: mean, modulation and frequency, and one to check.
inline constexpr int kFewestRecordings = 4;

// --- Periodogram over the sensor (screening/fringe_search.cpp) ---

// Fringes that are handed to the fit. Chosen: the peak and its strongest sidelobes.
inline constexpr int kFringePeaks = 4;
// Steps of frequency a turn along the region. Chosen: two are critical sampling.
inline constexpr int kOversampling = 2;
// Frequencies across, from half a turn a row down to half a turn up. Chosen: regions have fewer
// rows.
inline constexpr int kFrequenciesAcross = 256;
// Half width of a peak that is left out of the further search [steps]. Chosen: main lobe and first
// sidelobe at twofold oversampling.
inline constexpr int kWidthOfPeak = 3;

// Refinement of a peak in both periodograms: divisions of a step. Chosen: a 16th of a step is well
// within the range from which a fit converges.
inline constexpr int kFiner = 16;

// --- Further recordings (next_recording.cpp) ---

// Expected gain that justifies a recording [bit]. Chosen: a hundredth of a yes-or-no answer.
inline constexpr double kWorthARecording_bits = 0.01;

}  // namespace sightline::thresholds
