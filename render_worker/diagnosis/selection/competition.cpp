#include "render_worker/diagnosis/selection/competition.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/random_effect/setup_independence.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"
#include "render_worker/diagnosis/selection/term_selection.h"

namespace sightline {

namespace {

constexpr size_t kFitted = 12;       // candidates fitted with the null model's derivatives
constexpr size_t kFittedAgain = 5;   // with their own
constexpr size_t kFittedAfresh = 4;  // from the nominal description on, if the null model fails:
constexpr double kRejected = 1.5;    // chi squared over numbers above which it does
constexpr double kHopeless = 1000;   // above which it tells nothing of what it lacks
constexpr double kMostlyExplained = 0.05;  // of chi squared left by what brings it near
constexpr double kLeastGain = 1.5;         // [nats] worth a fit
// The null model's deviations may hide an effect that it does not fail for.
constexpr size_t kFittedAfreshAnyway = 2;
constexpr double kPromising = 10;     // [nats]
constexpr double kPairGain = 8;       // [nats] about what a second effect's prior odds cost
constexpr size_t kPairs = 4;          // that are fitted; as many of three
constexpr size_t kScatterBases = 2;   // effects besides which scatter is looked for
constexpr double kMostAmplitude = 3;  // of an added effect, over that at which it was looked at
// Terms that are to be fitted with fewer coefficients: as many, and not farther behind the best.
constexpr int kSelected = 4;
// A model is rejected by recordings not fitted below this probability of them.
constexpr double kRejectedBelow = 0.01;
// What effects must gain in recordings not fitted [nats] to be named: odds of 20.
constexpr double kClearGain = 3;
constexpr double kSelectedBehind = 15;  // [nats]

class Competing {
 public:
  Competing(const SetModel& model, const FitResult& null, const CompetitionSettings& settings,
            const std::function<bool(double)>& progress)
      : model_(model),
        settings_(settings),
        progress_(progress),
        counts_{.effects = static_cast<int>(settings.effects.size()),
                .free_forms = static_cast<int>(settings.free_forms.size())},
        screening_(model, null),
        about_(null) {
    competition_.null = null;
    const auto sort = [&](std::span<const Effect* const> effects) {
      for (const Effect* effect : effects) {
        (IsRecordingScatter(*effect) ? scattering_ : expected_).push_back(effect);
      }
    };
    sort(settings.effects);
    sort(settings.free_forms);
  }

  Competition Run() {
    Screen();
    FitSingles();
    if (stopped_) return Unfinished();
    if (!FollowsVibration()) {
      FitPairs();
      RenewBest();
      AddRecordingScatter();
    }
    if (stopped_) return Unfinished();
    // If scatter explains most, the covariance of the null model is the one it has been compared
    // under; that of another effect may have room for it by chance.
    if (!ScatterLeads()) {
      std::erase_if(candidates_, IsScatter);
      FitUnderOneCovariance();
      AddRecordingScatter();
    }
    AddScatterToBest();
    AddTermsToBest();
    SelectTerms();
    if (stopped_) return Unfinished();
    Rank();
    JudgeByPredictions();
    FindClass();
    return std::move(competition_);
  }

 private:
  void Rank() {
    std::erase_if(candidates_, [](const auto& candidate) { return !EffectsAreThere(candidate); });
    Candidate none;
    none.fit = competition_.null;
    candidates_.push_back(std::move(none));
    RankCandidates(counts_, &candidates_);
    competition_.ranked = std::move(candidates_);
  }

  Competition Unfinished() {
    SortByEvidence();
    Rank();
    competition_.finished = false;
    return std::move(competition_);
  }

  bool Report(double fraction) {
    if (!stopped_ && !progress_(fraction)) stopped_ = true;
    return !stopped_;
  }

  void Screen() {
    const auto count = static_cast<double>(expected_.size());
    for (size_t i = 0; i < expected_.size(); ++i) {
      if (!Report(0.5 * static_cast<double>(i) / count)) return;
      competition_.screened.push_back(screening_.Screen(*expected_[i]));
    }
  }

  void Fit(Candidate& candidate, const FitResult& reference, bool renew, int iterations) const {
    SetParameters start =
        candidate.fit.mean.empty() ? reference.parameters : candidate.fit.parameters;
    start.effects = candidate.effects;
    FitSettings settings;
    settings.rounds.clear();
    settings.renew_jacobian = renew;
    settings.max_iterations = iterations;
    candidate.fit = FitSet(model_, start, candidate.free, settings, &reference);
    candidate.effects = candidate.fit.parameters.effects;
    candidate.log_evidence = LogEvidence(candidate, competition_.null, about_);
  }

  // From the nominal description on: where the null model is far off, so are its deviations.
  void FitAfresh(Candidate& candidate) const {
    SetParameters start;
    start.effects = candidate.effects;
    start.line_shift_px = model_.EstimateLineShifts(start);
    FitSettings settings;
    settings.rounds = {{0.3, 0.3}, {0.1, 0.2}, {0.01, 0.1}, {0, 0.03}, {0, 0}};
    settings.middle_only = true;
    candidate.fit = FitSet(model_, start, candidate.free, settings, nullptr);
    candidate.effects = candidate.fit.parameters.effects;
    candidate.log_evidence = LogEvidence(candidate, competition_.null);
  }

  void SortByEvidence() {
    // A start that leaves no light at all has no number to compare.
    std::erase_if(candidates_, [](const auto& c) { return !std::isfinite(c.log_evidence); });
    std::stable_sort(
        candidates_.begin(), candidates_.end(),
        [](const Candidate& a, const Candidate& b) { return a.log_evidence > b.log_evidence; });
  }

  bool NullIsRejected() const {
    return competition_.null.chi_squared > kRejected * competition_.null.data_count;
  }

  // True if nothing is near the null model, no effect found so far brings it there, recordings of
  // one place show the line at different ones, and a vibration explains them: it is among the
  // candidates then, and what the null model leaves tells nothing of others.
  bool FollowsVibration() {
    const FitResult& null = competition_.null;
    if (null.chi_squared < kHopeless * null.data_count) return false;
    if (std::any_of(candidates_.begin(), candidates_.end(), [&](const Candidate& candidate) {
          return candidate.fit.chi_squared < kMostlyExplained * null.chi_squared;
        })) {
      return false;
    }
    const std::vector<double> displacements = DisplacementsAtPositions(model_, null.parameters);
    if (std::all_of(displacements.begin(), displacements.end(), [](double d) { return d == 0; })) {
      return false;
    }
    std::vector<Candidate> others = std::exchange(candidates_, {});
    AddRecordingScatter();
    const bool follows = !candidates_.empty() && !candidates_.front().phases_rad.empty();
    if (!follows) {
      candidates_ = std::move(others);
      return false;
    }
    // Under the null model's covariance others tell nothing.
    const Candidate& vibration = candidates_.front();
    const double others_offset = vibration.log_evidence - LogEvidence(vibration, competition_.null);
    for (Candidate& other : others) {
      if (other.fit.whitening == null.whitening) continue;
      other.log_evidence = LogEvidence(other, competition_.null) + others_offset;
      candidates_.push_back(std::move(other));
    }
    SortByEvidence();
    return true;
  }

  void FitSingles() {
    const auto promise = [](const ScreenedEffect& screened) {
      return std::max(screened.gain, screened.linear_gain);
    };
    std::vector<const ScreenedEffect*> order;
    for (const ScreenedEffect& screened : competition_.screened) {
      if (promise(screened) > kLeastGain) order.push_back(&screened);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](const auto* a, const auto* b) { return promise(*a) > promise(*b); });
    if (order.size() > kFitted) order.resize(kFitted);
    const bool rejected = NullIsRejected();
    size_t afresh = 0;
    for (size_t i = 0; i < order.size(); ++i) {
      if (!Report(0.5 + 0.25 * static_cast<double>(i) / kFitted)) return;
      const bool displaced =
          order[i]->linear_gain > 10 && order[i]->gain < 0.5 * order[i]->linear_gain;
      const bool promising = i < kFittedAfreshAnyway && promise(*order[i]) > kPromising;
      if ((rejected || displaced || promising) && afresh < kFittedAfresh) {
        ++afresh;
        const ActiveEffect& start = displaced ? order[i]->linear_best : order[i]->strongest;
        candidates_.push_back(MakeCandidate({start}));
        FitAfresh(candidates_.back());
        // With little weight on the data it may have lost its way.
        if (candidates_.back().log_evidence < 0.8 * promise(*order[i])) {
          Candidate near = MakeCandidate({start});
          Fit(near, competition_.null, false, 4);
          if (near.log_evidence > candidates_.back().log_evidence) {
            candidates_.back() = std::move(near);
          }
        }
      } else {
        candidates_.push_back(MakeCandidate({order[i]->strongest}));
        Fit(candidates_.back(), competition_.null, false, 4);
      }
    }
    SortByEvidence();
  }

  // An effect besides those of a candidate: what it gains by the linearised model.
  struct Joint {
    const Candidate* base;
    ActiveEffect added;
    double gain;
  };

  static bool Has(const Candidate& candidate, const Effect* effect) {
    return std::any_of(candidate.effects.begin(), candidate.effects.end(),
                       [&](const ActiveEffect& active) { return active.effect == effect; });
  }

  // The shape of an effect that has been found by itself belongs to what others have left out, not
  // to what is left besides them.
  std::vector<ScreenedEffect> ScreenShapesBesides(const Candidate& base) {
    std::vector<ScreenedEffect> found;
    const Screening screening(model_, base.fit);
    for (const Effect* effect : expected_) {
      const std::vector<EffectParameter>& parameters = effect->description().parameters;
      const bool shaped = parameters.size() > 1 || !WholeNumbers(parameters[0]).empty();
      if (IsFreeForm(*effect) || !shaped) continue;
      if (!Report(0.75)) break;
      if (!Has(base, effect)) found.push_back(screening.Screen(*effect));
    }
    return found;
  }

  // `besides`: effects screened about the base, which count instead of those about the null model.
  void AddJoints(const Candidate& base, const std::vector<ScreenedEffect>& besides,
                 std::vector<Joint>& joints) const {
    // What is held at a bound may be so for want of the effect.
    const LinearFit linear(base.fit, {}, LinearFit::Held::kFree);
    const Eigen::VectorXd residual = linear.ResidualAtBest();
    for (const ScreenedEffect& by_itself : competition_.screened) {
      const Effect* effect = by_itself.strongest.effect;
      if (IsFreeForm(*effect) || Has(base, effect)) continue;
      const auto again = std::find_if(besides.begin(), besides.end(), [&](const auto& screened) {
        return screened.strongest.effect == effect;
      });
      const ScreenedEffect& screened = again != besides.end() ? *again : by_itself;
      if (screened.change.size() == 0) continue;
      const double length = linear.Inner(screened.change, screened.change);
      if (length < 1e-6) continue;
      const double slope = residual.dot(screened.change);
      // Where the known parameters do nearly the same, a straight line leads far astray.
      const double amplitude = std::clamp(slope / length, -kMostAmplitude, kMostAmplitude);
      joints.push_back({&base, Scaled(screened.strongest, amplitude),
                        amplitude * (slope - 0.5 * amplitude * length)});
    }
  }

  // By what both are expected to explain together.
  static void SortByTotal(std::vector<Joint>& joints) {
    const auto total = [](const Joint& joint) { return joint.base->log_evidence + joint.gain; };
    std::stable_sort(joints.begin(), joints.end(),
                     [&](const Joint& a, const Joint& b) { return total(a) > total(b); });
  }

  static bool SameEffects(const Candidate& a, const Candidate& b) {
    return a.effects.size() == b.effects.size() &&
           std::all_of(a.effects.begin(), a.effects.end(),
                       [&](const ActiveEffect& active) { return Has(b, active.effect); });
  }

  static ActiveEffect Scaled(ActiveEffect active, double amplitude) {
    const auto& parameters = active.effect->description().parameters;
    for (size_t k = 0; k < parameters.size(); ++k) {
      if (!WholeNumbers(parameters[k]).empty()) continue;
      const double z = StandardisedParameter(parameters[k], active.parameters[k]);
      active.parameters[k] = ParameterFromStandardised(parameters[k], z * amplitude);
    }
    return active;
  }

  void FitPairs() {
    size_t first = 0;
    for (int count = 2; count <= settings_.max_effects; ++count) {
      std::vector<Joint> joints;
      const size_t end = candidates_.size();
      size_t bases = 0;
      for (size_t c = first; c < end && bases < 4; ++c) {
        const Candidate& base = candidates_[c];
        if (IsFreeForm(base) || base.effects.size() + 1 != static_cast<size_t>(count)) continue;
        const bool best = count == 2 && bases == 0 && base.log_evidence > kPromising;
        ++bases;
        AddJoints(base, best ? ScreenShapesBesides(base) : std::vector<ScreenedEffect>(), joints);
      }
      SortByTotal(joints);
      std::vector<Candidate> made;
      for (const Joint& joint : joints) {
        if (made.size() == kPairs) break;
        if (joint.gain < kPairGain) continue;
        if (!Report(0.77 + 0.02 * static_cast<double>(made.size()))) return;
        std::vector<ActiveEffect> effects = joint.base->effects;
        effects.push_back(joint.added);
        Candidate candidate = MakeCandidate(std::move(effects));
        // Once, however they were put together.
        if (std::any_of(made.begin(), made.end(),
                        [&](const Candidate& other) { return SameEffects(other, candidate); })) {
          continue;
        }
        candidate.fit.parameters = joint.base->fit.parameters;
        candidate.fit.mean = joint.base->fit.mean;
        Fit(candidate, competition_.null, false, 4);
        // No base of further effects, if it leaves no light.
        if (std::isfinite(candidate.log_evidence)) made.push_back(std::move(candidate));
      }
      first = end;
      if (made.empty()) break;
      for (Candidate& candidate : made) candidates_.push_back(std::move(candidate));
    }
    SortByEvidence();
  }

  // The best of the effects that change what is expected, under its own covariance: where the null
  // model is rejected, that of the null model tells little.
  void RenewBest() {
    if (candidates_.empty() || stopped_ || !NullIsRejected()) return;
    if (!Report(0.84)) return;
    best_renewed_ = FitOfBest();
  }

  FitResult FitOfBest() const {
    const Candidate& best = candidates_.front();
    FitSettings settings;
    settings.rounds = {{0, 0.1}, {0, 0.02}, {0, 0}, {0, 0}};
    settings.max_iterations = 3;
    SetParameters start = best.fit.parameters;
    start.effects = best.effects;
    return FitSet(model_, start, best.free, settings, nullptr);
  }

  bool ScatterLeads() const {
    if (candidates_.empty() || !IsScatter(candidates_.front())) return false;
    return !best_renewed_ || TwiceCost(candidates_.front().fit) < TwiceCost(*best_renewed_);
  }

  // The covariance of the best model is nearer the truth than that of the null model; derivatives
  // with respect to the deviations are renewed too.
  void FitUnderOneCovariance() {
    if (candidates_.empty() || stopped_) return;
    if (!Report(0.85)) return;
    const FitResult reference = best_renewed_ ? *std::move(best_renewed_) : FitOfBest();
    best_renewed_.reset();
    FitSettings settings;
    settings.rounds.clear();
    settings.max_iterations = 8;
    SetParameters null_start = competition_.null.parameters;
    null_start.effects.clear();
    FitResult null = FitSet(model_, null_start, {}, settings, &reference);
    competition_.null = std::move(null);
    about_ = reference;
    if (candidates_.size() > kFitted) candidates_.resize(kFitted);
    for (size_t i = 0; i < candidates_.size(); ++i) {
      if (!Report(0.87 + 0.12 * static_cast<double>(i) / static_cast<double>(candidates_.size())))
        return;
      if (i == 0) {
        candidates_[i].fit.parameters = reference.parameters;
        candidates_[i].effects = reference.parameters.effects;
      }
      Fit(candidates_[i], reference, i < kFittedAgain, i < kFittedAgain ? 6 : 3);
    }
    SortByEvidence();
    FitPartsOfBest(reference);
  }

  // Each effect of several by itself, from where all of them led: by itself it may have been stuck
  // where other parameters made up for it.
  void FitPartsOfBest(const FitResult& reference) {
    const Candidate best = candidates_.front();
    if (best.effects.size() < 2) return;
    for (const ActiveEffect& part : best.effects) {
      Candidate alone = MakeCandidate({part});
      alone.fit.parameters = best.fit.parameters;
      alone.fit.mean = best.fit.mean;
      Fit(alone, reference, true, 8);
      const auto known = std::find_if(candidates_.begin(), candidates_.end(), [&](const auto& c) {
        return c.effects.size() == 1 && c.effects[0].effect == part.effect;
      });
      if (known == candidates_.end()) {
        candidates_.push_back(std::move(alone));
      } else if (alone.log_evidence > known->log_evidence) {
        *known = std::move(alone);
      }
    }
    SortByEvidence();
  }

  // The best effect's law may be near the truth and not it: besides it free-form terms of its
  // stage, which such a law needs and a true one does not.
  void AddTermsToBest() {
    if (stopped_ || candidates_.empty()) return;
    const auto leading = std::find_if(candidates_.begin(), candidates_.end(), [](const auto& c) {
      return c.effects.size() == 1 && !IsFreeForm(c) && !IsScatter(c);
    });
    if (leading == candidates_.end() || leading->log_evidence < kPromising) return;
    const bool rejected = Check(candidates_.front()).p_value < kRejectedBelow;
    if (!rejected && leading != candidates_.begin()) return;
    const Candidate best = *leading;
    const LinearFit linear(best.fit);
    for (const Effect* term : settings_.free_forms) {
      // What the whole vocabulary does not describe may be at any other stage as well.
      const bool near = term->description().stage == best.effects[0].effect->description().stage;
      if (IsRecordingScatter(*term) || (!near && !rejected)) continue;
      if (!Report(0.99)) break;
      const auto& parameters = term->description().parameters;
      const auto n = static_cast<Eigen::Index>(parameters.size());
      Candidate candidate = best;
      candidate.effects.push_back(AtNullValues(*term));
      std::vector<Eigen::VectorXd> slopes;
      Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
      Eigen::VectorXd gradient(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        constexpr double kProbe = 0.5;
        SetParameters moved = best.fit.parameters;
        moved.effects = candidate.effects;
        moved.effects[1].parameters[i] = ParameterFromStandardised(parameters[i], kProbe);
        slopes.push_back(linear.Change(model_.Expect(moved, false).mean) / kProbe);
        gradient[i] = linear.residual().dot(slopes[i]);
        for (Eigen::Index j = 0; j <= i; ++j) {
          const double inner = linear.Inner(slopes[i], slopes[j]);
          information(i, j) += inner;
          if (i != j) information(j, i) += inner;
        }
      }
      const Eigen::VectorXd z = information.llt().solve(gradient);
      if (0.5 * z.dot(gradient) < kPairGain) continue;
      for (Eigen::Index i = 0; i < n; ++i) {
        candidate.effects[1].parameters[i] = ParameterFromStandardised(parameters[i], z[i]);
      }
      candidate.free = FreeParameters(candidate.effects);
      Fit(candidate, best.fit, false, 6);
      candidates_.push_back(std::move(candidate));
    }
    SortByEvidence();
  }

  // Terms hold coefficients for whatever may come; physics that is simple needs few of them.
  void SelectTerms() {
    if (stopped_ || candidates_.empty()) return;
    const double best = candidates_.front().log_evidence;
    int selected = 0;
    for (Candidate& candidate : candidates_) {
      if (!IsFreeForm(candidate) || IsScatter(candidate)) continue;
      std::optional<Candidate> simpler = WithFewerCoefficients(candidate, best - kSelectedBehind);
      if (!simpler) continue;
      if (simpler->log_evidence > candidate.log_evidence) candidate = *std::move(simpler);
      if (++selected == kSelected) break;
    }
    SortByEvidence();
  }

  // Fitted with those coefficients of its term that the recordings ask for; nothing: that is all,
  // or the evidence is not expected to reach `least`.
  std::optional<Candidate> WithFewerCoefficients(const Candidate& candidate, double least) const {
    const auto first =
        candidate.fit.standardised.size() - static_cast<Eigen::Index>(candidate.free.size());
    std::vector<int> coefficients;
    std::vector<size_t> places;  // in `free`
    std::vector<EffectParameter> parameters;
    for (size_t f = 0; f < candidate.free.size(); ++f) {
      const ActiveEffect& active = candidate.effects[candidate.free[f].effect];
      if (!IsFreeForm(*active.effect)) continue;
      coefficients.push_back(static_cast<int>(first) + static_cast<int>(f));
      places.push_back(f);
      parameters.push_back(active.effect->description().parameters[candidate.free[f].parameter]);
    }
    const TermSelection selection =
        SelectCoefficients(candidate.fit.standardised, candidate.fit.covariance,
                           candidate.fit.prior_weight, coefficients, parameters);
    if (selection.log_evidence_gain <= 0 ||
        candidate.log_evidence + selection.log_evidence_gain < least) {
      return std::nullopt;
    }
    Candidate simpler = candidate;
    for (size_t f = 0; f < candidate.free.size(); ++f) {
      const auto [effect, parameter] = candidate.free[f];
      const EffectParameter& described =
          candidate.effects[effect].effect->description().parameters[parameter];
      simpler.effects[effect].parameters[parameter] = ParameterFromStandardised(
          described, selection.standardised[first + static_cast<Eigen::Index>(f)]);
    }
    for (size_t k = places.size(); k-- > 0;) {
      if (!selection.needed[k]) {
        simpler.free.erase(simpler.free.begin() + static_cast<std::ptrdiff_t>(places[k]));
      }
    }
    simpler.fit.parameters =
        AtStandardised(model_, candidate.fit.parameters, selection.standardised);
    Fit(simpler, candidate.fit, false, 4);
    return simpler;
  }

  void AddRecordingScatter() {
    if (stopped_) return;
    // An effect that makes recordings of one place agree leaves no strong scatter.
    const bool perhaps_strong =
        candidates_.empty() || IsScatter(candidates_.front()) ||
        ScattersStrongly(model_, best_renewed_ ? *best_renewed_ : candidates_.front().fit);
    for (ScatterCandidate& scatter :
         CompareRecordingScatter(model_, competition_.null, scattering_, perhaps_strong)) {
      Candidate candidate;
      candidate.effects = {{scatter.effect, scatter.parameters}};
      candidate.free = scatter.fit.free;
      candidate.log_evidence = scatter.log_evidence;
      candidate.fit = std::move(scatter.fit);
      candidate.drawn = Drawn(scatter);
      candidate.phases_rad = std::move(scatter.phases_rad);
      // Where the null model is far off, its linearisation is too; at what has been drawn the model
      // itself counts.
      const FitResult& null = competition_.null;
      if (null.chi_squared > kRejected * null.data_count) {
        candidate.log_evidence = std::max(candidate.log_evidence, LogEvidence(candidate, null));
      }
      candidates_.push_back(std::move(candidate));
    }
    SortByEvidence();
  }

  // Strengths, too, that have been found for want of what scatters are not those besides it.
  std::vector<ScreenedEffect> ScreenBesidesScatter(const Candidate& scatter) {
    // What has been drawn is in the residual, not in what is expected of other parameters.
    FitResult about = scatter.fit;
    about.mean = model_.Expect(about.parameters, false).mean;
    return ScreenNamed(Screening(model_, about), 0.96);
  }

  // All effects of the vocabulary that change what is expected. `fraction`: of what is done.
  std::vector<ScreenedEffect> ScreenNamed(const Screening& screening, double fraction) {
    std::vector<ScreenedEffect> found;
    for (const Effect* effect : expected_) {
      if (IsFreeForm(*effect)) continue;
      if (!Report(fraction)) break;
      found.push_back(screening.Screen(*effect));
    }
    return found;
  }

  // The best effects by themselves, or the best besides what scatters if that explains most.
  std::vector<Candidate> BasesOfScatter() {
    std::vector<Candidate> bases;
    const Candidate& best = candidates_.front();
    if (IsScatter(best)) {
      std::vector<Joint> joints;
      AddJoints(best, NullIsRejected() ? ScreenBesidesScatter(best) : std::vector<ScreenedEffect>(),
                joints);
      SortByTotal(joints);
      for (const Joint& joint : joints) {
        if (bases.size() == kScatterBases) break;
        if (joint.gain < kPairGain) continue;
        bases.push_back(MakeCandidate({joint.added}));
        Fit(bases.back(), competition_.null, false, 4);
        if (!std::isfinite(bases.back().log_evidence)) bases.pop_back();
      }
      return bases;
    }
    for (const Candidate& candidate : candidates_) {
      if (bases.size() == kScatterBases || candidate.log_evidence < kPairGain) break;
      const bool single = candidate.effects.size() == 1;
      if (single && !IsFreeForm(candidate) && !IsScatter(candidate)) bases.push_back(candidate);
    }
    return bases;
  }

  // Pairs of an effect and of what scatters besides it.
  void AddScatterToBest() {
    if (stopped_ || settings_.max_effects < 2 || candidates_.empty()) return;
    if (!candidates_.front().phases_rad.empty()) {
      AddToVibration();
      return;
    }
    // What explains most is part of every pair.
    std::span<const Effect* const> effects = settings_.effects;
    const Effect* const only =
        IsScatter(candidates_.front()) ? candidates_.front().effects[0].effect : nullptr;
    if (only != nullptr) effects = {&only, 1};
    const std::vector<Candidate> bases = BasesOfScatter();
    // Where recordings of one place agree about the best base, others scatter for want of it.
    const bool perhaps_strong = !bases.empty() && ScattersStrongly(model_, bases.front().fit);
    for (const Candidate& base : bases) {
      for (ScatterCandidate& scatter :
           CompareRecordingScatter(model_, base.fit, effects, perhaps_strong)) {
        if (scatter.log_evidence < kPairGain) continue;
        Candidate pair;
        pair.effects = scatter.fit.parameters.effects;
        pair.free = scatter.fit.free;
        pair.log_evidence = base.log_evidence + scatter.log_evidence;
        pair.drawn = Drawn(scatter);
        pair.fit = std::move(scatter.fit);
        candidates_.push_back(std::move(pair));
      }
    }
    SortByEvidence();
  }

  // Effects besides a vibration that has been followed. Its speckle, which moves during exposures,
  // is modelled to a part only, and another effect might seem to explain the rest: what is about
  // speckle is left out.
  void AddToVibration() {
    const Candidate best = candidates_.front();
    const ActiveEffect vibration = best.effects.back();
    const std::unique_ptr<const Effect> phased =
        VibrationAtPhases(*vibration.effect, best.phases_rad);
    std::vector<bool> used;
    Candidate base = best;
    for (int e = 0; e < model_.entries(); ++e) {
      used.push_back(!model_.ComparesSpeckle(e) && model_.StatisticOf(e).name() != "texture");
      if (used.back()) continue;
      base.fit.residual[e].setZero();
      base.fit.jacobian[e].setZero();
    }
    base.fit.parameters.effects.back().effect = phased.get();
    const std::vector<ScreenedEffect> found = ScreenNamed(Screening(model_, base.fit, used), 0.97);
    if (stopped_) return;
    std::vector<Joint> joints;
    AddJoints(base, found, joints);
    SortByTotal(joints);
    // What the evidence takes from the data, of the entries used.
    struct DataPart {
      double chi_squared = 0, log_determinant = 0;
    };
    const auto of_used = [&](const FitResult& fit) {
      DataPart part;
      for (size_t e = 0; e < used.size(); ++e) {
        if (!used[e]) continue;
        part.chi_squared += fit.residual[e].squaredNorm();
        part.log_determinant += fit.whitening->LogDeterminant(static_cast<int>(e));
      }
      return part;
    };
    const auto exchange_data = [](FitResult& fit, const DataPart& part) {
      return DataPart{std::exchange(fit.chi_squared, part.chi_squared),
                      std::exchange(fit.data_log_determinant, part.log_determinant)};
    };
    exchange_data(base.fit, of_used(base.fit));
    const auto follow = [&](const std::vector<ActiveEffect>& besides, const Candidate& from) {
      SetParameters start = from.fit.parameters;
      start.effects = besides;
      FollowedVibration followed =
          FollowVibration(model_, start, FreeParameters(besides), *vibration.effect,
                          from.effects.back().parameters, from.phases_rad);
      Candidate candidate;
      candidate.effects = followed.fit.parameters.effects;
      candidate.free = followed.fit.free;
      candidate.fit = std::move(followed.fit);
      candidate.phases_rad = std::move(followed.phases_rad);
      const DataPart whole = exchange_data(candidate.fit, of_used(candidate.fit));
      candidate.log_evidence =
          best.log_evidence + LogEvidence(candidate, base.fit) - LogEvidence(base, base.fit);
      exchange_data(candidate.fit, whole);
      return candidate;
    };
    std::vector<Candidate> pairs;
    for (const Joint& joint : joints) {
      if (pairs.size() == kScatterBases || joint.gain < kPairGain) break;
      if (!Report(0.98)) return;
      Candidate pair = follow({joint.added}, best);
      if (!std::isfinite(pair.log_evidence)) break;
      pairs.push_back(std::move(pair));
    }
    if (pairs.empty()) return;
    // The vibration by itself from where the best pair led: its phases may not have been the best.
    const Candidate& leading = *std::max_element(
        pairs.begin(), pairs.end(),
        [](const auto& a, const auto& b) { return a.log_evidence < b.log_evidence; });
    if (leading.log_evidence > best.log_evidence) {
      Candidate alone = follow({}, leading);
      if (alone.log_evidence > best.log_evidence) candidates_.front() = std::move(alone);
    }
    for (Candidate& pair : pairs) candidates_.push_back(std::move(pair));
    SortByEvidence();
  }

  PredictiveCheck Check(const Candidate& candidate) const {
    PredictiveCheck check =
        CheckPredictions(model_, candidate.fit, competition_.null, settings_.seed);
    if (candidate.drawn.empty()) return check;
    // What was drawn is predicted with all the width of its law; that it does not follow the set-up
    // is what the law says more.
    PredictedGroup independence;
    independence.name = "independence of the set-up";
    independence.p_value = SetupIndependencePValue(model_.set(), candidate.drawn, settings_.seed);
    AddTest(independence, &check);
    return check;
  }

  static std::vector<double> Drawn(const ScatterCandidate& scatter) {
    const bool light = std::any_of(scatter.light_relative.begin(), scatter.light_relative.end(),
                                   [](double drawn) { return drawn != 0; });
    return light ? scatter.light_relative : scatter.shift_px;
  }

  // The best score of what a candidate's effects must improve on: the null model's, or that of
  // fewer of its effects.
  double ScoreWithout(const Candidate& candidate, const std::vector<double>& scores) const {
    double best = competition_.null_check.log_score;
    for (size_t c = 0; c < competition_.ranked.size(); ++c) {
      const Candidate& part = competition_.ranked[c];
      if (part.effects.empty() || part.effects.size() >= candidate.effects.size()) continue;
      const bool among = std::all_of(part.effects.begin(), part.effects.end(),
                                     [&](const auto& a) { return Has(candidate, a.effect); });
      if (among) best = std::max(best, scores[c]);
    }
    return best;
  }

  // Names are given to what predicts recordings that were not fitted; the rest is unknown physics.
  void JudgeByPredictions() {
    std::vector<Candidate>& ranked = competition_.ranked;
    Candidate none;
    none.fit = competition_.null;
    competition_.null_check = Check(none);
    competition_.named_check = competition_.null_check;
    EraseWhatDoesNotPredict();
    const auto leading = std::find_if(ranked.begin(), ranked.end(),
                                      [](const auto& candidate) { return !IsFreeForm(candidate); });
    if (leading->effects.empty()) {
      competition_.named = std::move(none);
    } else {
      competition_.named = *leading;
      competition_.named_check = Check(*leading);
    }
    // Odds of unknown physics over what the vocabulary says.
    const double odds =
        kUnknownPrior / (1 - kUnknownPrior) * BayesFactorBound(competition_.named_check.p_value);
    double unknown = 0;
    for (const Candidate& candidate : ranked) {
      if (IsFreeForm(candidate)) unknown += candidate.probability;
    }
    const double share = odds / (1 + odds);
    if (competition_.named_check.p_value < kRejectedBelow && unknown < share) {
      ShareWithUnknown(share);
    }
  }

  void EraseWhatDoesNotPredict() {
    std::vector<Candidate>& ranked = competition_.ranked;
    std::vector<double> scores(ranked.size(), -1e300);
    for (size_t c = 0; c < ranked.size(); ++c) {
      if (!IsFreeForm(ranked[c])) scores[c] = Check(ranked[c]).log_score;
    }
    std::vector<Candidate> predicting;
    for (size_t c = 0; c < ranked.size(); ++c) {
      const bool named = !ranked[c].effects.empty() && !IsFreeForm(ranked[c]);
      if (named && !(scores[c] - ScoreWithout(ranked[c], scores) > kClearGain)) continue;
      predicting.push_back(ranked[c]);
    }
    ranked = std::move(predicting);
    RankCandidates(counts_, &ranked);
  }

  // Gives unknown physics that probability. If no term of it has been worth a fit, the one that
  // promised most stands for it, without a strength, so that it has a stage.
  void ShareWithUnknown(double share) {
    std::vector<Candidate> known, unknown;
    for (Candidate& candidate : competition_.ranked) {
      (IsFreeForm(candidate) ? unknown : known).push_back(std::move(candidate));
    }
    if (unknown.empty()) {
      const ScreenedEffect* best = nullptr;
      for (const ScreenedEffect& screened : competition_.screened) {
        if (!IsFreeForm(*screened.strongest.effect)) continue;
        if (best == nullptr || screened.gain > best->gain) best = &screened;
      }
      if (best != nullptr) {
        unknown.push_back(MakeCandidate({AtNullValues(*best->strongest.effect)}));
        unknown.back().free.clear();
        unknown.back().fit = competition_.null;
        unknown.back().fit.parameters.effects = unknown.back().effects;
      }
    }
    std::vector<Candidate>& ranked = competition_.ranked;
    ranked.clear();
    if (unknown.empty()) share = 0;
    const auto add = [&](std::vector<Candidate>& candidates, double probability) {
      if (candidates.empty()) return;
      RankCandidates(counts_, &candidates);
      for (Candidate& candidate : candidates) {
        candidate.probability *= probability;
        ranked.push_back(std::move(candidate));
      }
    };
    add(known, 1 - share);
    add(unknown, share);
    std::stable_sort(ranked.begin(), ranked.end(), [](const Candidate& a, const Candidate& b) {
      return a.probability > b.probability;
    });
  }

  void FindClass() {
    const Candidate& best = competition_.ranked.front();
    if (best.effects.empty() || IsFreeForm(best)) return;
    const LinearFit& linear = screening_.linear();
    const Eigen::VectorXd change = screening_.ChangeOf(best.effects.front());
    const double length = linear.Inner(change, change);
    for (const ScreenedEffect& other : competition_.screened) {
      const Effect* effect = other.strongest.effect;
      if (effect == best.effects.front().effect || other.change.size() == 0) continue;
      if (IsFreeForm(*effect)) continue;
      const double product = linear.Inner(change, other.change);
      const double other_length = linear.Inner(other.change, other.change);
      if (other_length > 1e-9 && product * product > 0.98 * length * other_length) {
        competition_.same_class.push_back(effect);
      }
    }
  }

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

}  // namespace

Competition Compete(const SetModel& model, const FitResult& null,
                    const CompetitionSettings& settings,
                    const std::function<bool(double)>& progress) {
  return Competing(model, null, settings, progress).Run();
}

}  // namespace sightline
