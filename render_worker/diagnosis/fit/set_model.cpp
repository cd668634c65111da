// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/set_model.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <memory>
#include <span>
#include <utility>

#include "core/parallel/worker_threads.h"
#include "render_worker/diagnosis/statistic/burst_statistic.h"
#include "render_worker/diagnosis/statistic/column_parity_statistic.h"
#include "render_worker/diagnosis/statistic/histogram_statistic.h"
#include "render_worker/diagnosis/statistic/hot_pixels.h"
#include "render_worker/diagnosis/statistic/line_displacement.h"
#include "render_worker/diagnosis/statistic/noise/dark_statistic.h"
#include "render_worker/diagnosis/statistic/noise/repeat_statistic.h"
#include "render_worker/diagnosis/statistic/noise/texture_statistic.h"
#include "render_worker/diagnosis/statistic/pattern/fixed_pattern_statistic.h"
#include "render_worker/diagnosis/statistic/profile_statistic.h"
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_statistic.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

// Runs work(i) for all i < count on several threads. Every call writes to memory of its own, so the
// result does not depend on the schedule.
template <typename Work>
void ForAll(int count, int threads, const Work& work) {
  std::atomic<int> next = 0;
  const auto run = [&] {
    for (int i = next++; i < count; i = next++) work(i);
  };
  WorkerThreads workers;
  for (int t = 1; t < threads; ++t) workers.Start(run);
  run();
  workers.Join();
}

// The image without `margin_px` columns on either side.
template <typename T>
Image<T> Inner(const Image<T>& image, int margin_px) {
  Image<T> inner(image.columns_px - 2 * margin_px, image.rows_px);
  for (int row = 0; row < inner.rows_px; ++row) {
    for (int c = 0; c < inner.columns_px; ++c) inner.At(row, c) = image.At(row, c + margin_px);
  }
  return inner;
}

// Removes the margin that ExpectFrame needed to spread charge between columns.
void CutMargin(ExpectedFrame& sample, int margin_px) {
  for (Image<float>& level : sample.level_dn) level = Inner(level, margin_px);
  sample.mean_dn = Inner(sample.mean_dn, margin_px);
  sample.level_variance_dn2 = Inner(sample.level_variance_dn2, margin_px);
  sample.noise_variance_dn2 = Inner(sample.noise_variance_dn2, margin_px);
  if (!sample.noise_excess_kurtosis.empty()) {
    sample.noise_excess_kurtosis = Inner(sample.noise_excess_kurtosis, margin_px);
  }
  sample.pattern_variance_dn2 = Inner(sample.pattern_variance_dn2, margin_px);
  sample.mean_photo_electrons = Inner(sample.mean_photo_electrons, margin_px);
  sample.frame.roi.column_px += margin_px;
  sample.frame.roi.columns_px -= 2 * margin_px;
}

struct SampleSettings {
  int columns_px = 2;
  int speckle_levels = 12;
  int margin_px = 0;  // columns computed on either side and removed
  bool middle_only = false;
};

// Margin of a column sample. On a colour sensor charge that spreads reaches neighbours of another
// colour, which lie beyond the edges of a narrow sample.
int MarginPx(const RecordedSet& set, const std::vector<ActiveEffect>& effects) {
  constexpr int kColourCellMargin_px = 2;  // one cell of the colour filter
  const bool colour =
      !set.frames.empty() && set.frames[0].nominal.sensor.colour_filter != ColourFilter::kMono;
  const bool spreads = std::any_of(effects.begin(), effects.end(), [](const ActiveEffect& active) {
    return active.effect->description().MovesCharge();
  });
  return colour && spreads ? kColourCellMargin_px : 0;
}

// The sample of one frame in the middle of one segment along the line. `imaging`: of a sample of
// the same frame that is known already, or null.
ExpectedFrame ExpectSample(const FrameSetup& setup, int segments, int segment,
                           const SampleSettings& samples, std::span<const ActiveEffect> effects,
                           const Image<double>* previous,
                           std::shared_ptr<const LineImaging> imaging) {
  FrameSetup frame = setup;
  frame.roi = StripRegion(frame.roi, segments, segment, samples.columns_px);
  frame.roi.column_px -= samples.margin_px;
  frame.roi.columns_px += 2 * samples.margin_px;
  const auto [first_column, last_column] = BlockColumns(setup.roi.columns_px, segments, segment);
  ExpectedFrame expected = ExpectFrame(frame, effects, previous, std::move(imaging),
                                       samples.speckle_levels, last_column - first_column);
  if (samples.margin_px > 0) CutMargin(expected, samples.margin_px);
  return expected;
}

// Computes the column samples of the frames of one burst. Frames of a burst depend on each other
// (image lag), bursts do not.
void ExpectBurst(const std::vector<FrameSetup>& setups, std::pair<int, int> burst,
                 const SampleSettings& samples, ExpectedSet& expected) {
  const int segments = static_cast<int>(expected.strips.size());
  const auto [first, last] = burst;
  for (int f = first; f < last; ++f) {
    // The middle segment is computed first. Its optics serve all segments where they do not depend
    // on the field.
    std::shared_ptr<const LineImaging> imaging;
    const int computed = samples.middle_only ? std::min(1, segments) : segments;
    for (int i = 0; i < computed; ++i) {
      const int segment = (i + segments / 2) % segments;
      std::vector<ExpectedFrame>& strips = expected.strips[segment];
      // With a margin the previous frame has another size and is left out: image lag of spread
      // charge is a second-order effect.
      const Image<double>* previous =
          f > first && samples.margin_px == 0 ? &strips[f - 1].mean_photo_electrons : nullptr;
      strips[f] =
          ExpectSample(setups[f], segments, segment, samples, expected.effects, previous, imaging);
      imaging = strips[f].imaging;
    }
    if (!samples.middle_only) continue;
    const int middle = segments / 2;
    for (int segment = 0; segment < segments; ++segment) {
      if (segment != middle) expected.strips[segment][f] = expected.strips[middle][f];
    }
  }
}

std::vector<std::shared_ptr<const SetStatistic>> StatisticsFor(const RecordedSet& set,
                                                               const SetModelSettings& settings) {
  return {std::make_shared<ProfileStatistic>(set, settings.blocks_along_line),
          std::make_shared<TextureStatistic>(set, settings.blocks_along_line),
          std::make_shared<RepeatStatistic>(set),
          std::make_shared<DarkStatistic>(set),
          std::make_shared<SharedSpeckleStatistic>(set),
          std::make_shared<HistogramStatistic>(set),
          std::make_shared<FixedPatternStatistic>(set),
          std::make_shared<BurstStatistic>(set),
          std::make_shared<ColumnParityStatistic>(set)};
}

// Hot pixels are part of the fixed pattern; they would dominate every other statistic.
const RecordedSet& ImagesFor(const SetStatistic& statistic, const RecordedSet& images,
                             const RecordedSet& cleaned) {
  return statistic.kind() == StatisticKind::kFixedPattern ? images : cleaned;
}

}  // namespace

SetModel::SetModel(const RecordedSet& set, const SetModelSettings& settings)
    : set_(set), settings_(settings) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& frame = set.frames[f];
    if (bursts_.empty() || frame.nominal.burst_frame_index == 0) {
      bursts_.emplace_back(static_cast<int>(f), static_cast<int>(f));
    }
    bursts_.back().second = static_cast<int>(f) + 1;
    const int id = frame.plate_position_id;
    if (id >= 0 &&
        std::find(position_ids_.begin(), position_ids_.end(), id) == position_ids_.end()) {
      position_ids_.push_back(id);
    }
  }
  statistics_ = StatisticsFor(set, settings);
  for (size_t s = 0; s < statistics_.size(); ++s) {
    for (int block = 0; block < statistics_[s]->blocks(); ++block) {
      places_.emplace_back(static_cast<int>(s), block);
    }
  }
  const bool recorded = !set.frames.empty() && !set.frames.front().raw_dn.values.empty();
  if (!recorded) {
    observed_.resize(places_.size());
    observed_parts_.resize(places_.size());
    return;
  }
  const RecordedSet cleaned = WithoutHotPixels(set);
  for (const auto& [s, block] : places_) {
    const RecordedSet& seen = ImagesFor(*statistics_[s], set, cleaned);
    observed_.push_back(statistics_[s]->Observed(seen, block));
    observed_parts_.push_back(statistics_[s]->ObservedOfParts(seen, block));
  }
}

SetModel::SetModel(const SetModel& model, ExpectationCorrection correction) : SetModel(model) {
  assert(correction.mean.size() == observed_.size());
  assert(correction.covariance.size() == observed_.size());
  correction_ = std::move(correction);
}

BlockVectors SetModel::StatisticsOf(const RecordedSet& images) const {
  const RecordedSet cleaned = WithoutHotPixels(images);
  BlockVectors observed(places_.size());
  ForAll(blocks(), settings_.threads, [&](int e) {
    const auto& [s, block] = places_[e];
    observed[e] = statistics_[s]->Observed(ImagesFor(*statistics_[s], images, cleaned), block);
  });
  return observed;
}

std::vector<ActiveEffect> SetModel::EffectsOf(const SetParameters& parameters) const {
  std::vector<ActiveEffect> effects = parameters.effects;
  const std::vector<ActiveEffect>& present = settings_.present_effects;
  effects.insert(effects.end(), present.begin(), present.end());
  return effects;
}

ExpectedSet SetModel::ExpectStrips(const SetParameters& parameters, bool middle_only,
                                   const ChangedRecordings* changed) const {
  const int frames = static_cast<int>(set_.frames.size());
  ExpectedSet expected;
  expected.effects = EffectsOf(parameters);
  expected.model_error = parameters.model_error;
  if (changed != nullptr) {
    expected.strips = changed->before.strips;
  } else {
    expected.strips.assign(settings_.blocks_along_line, std::vector<ExpectedFrame>(frames));
  }
  std::vector<FrameSetup> setups(frames);
  for (int f = 0; f < frames; ++f) {
    const RecordedFrame& recorded = set_.frames[f];
    SetupDeviation deviations = parameters.deviations;
    const auto shift = parameters.line_shift_px.find(recorded.plate_position_id);
    if (shift != parameters.line_shift_px.end()) deviations.line_position_each_px = shift->second;
    setups[f] = DeviatedFrame(set_, f, deviations);
  }
  const SampleSettings samples = {settings_.strip_columns_px, settings_.speckle_levels,
                                  MarginPx(set_, expected.effects), middle_only};
  ForAll(static_cast<int>(bursts_.size()), settings_.threads, [&](int burst) {
    const auto [first, last] = bursts_[burst];
    const bool computed = changed == nullptr ||
                          std::any_of(changed->changed.begin() + first,
                                      changed->changed.begin() + last, [](bool c) { return c; });
    if (computed) ExpectBurst(setups, bursts_[burst], samples, expected);
  });
  return expected;
}

BlockVectors SetModel::MeanOf(const ExpectedSet& expected, const std::vector<bool>& use) const {
  BlockVectors mean(blocks());
  ForAll(blocks(), settings_.threads, [&](int e) {
    if (use.empty() || use[e]) mean[e] = MeanOfBlock(expected, e);
  });
  return mean;
}

Eigen::VectorXd SetModel::MeanOfBlock(const ExpectedSet& expected, int block) const {
  Eigen::VectorXd mean = StatisticOf(block).Expected(expected, places_[block].second);
  if (is_corrected()) mean += correction_.mean[block];
  return mean;
}

SetModel::Expectation SetModel::Expect(const SetParameters& parameters, bool with_covariance,
                                       bool middle_only) const {
  const ExpectedSet expected = ExpectStrips(parameters, middle_only);
  Expectation expectation;
  expectation.mean.resize(blocks());
  if (with_covariance) expectation.covariance.resize(blocks());
  ForAll(blocks(), settings_.threads, [&](int e) {
    expectation.mean[e] = MeanOfBlock(expected, e);
    if (!with_covariance) return;
    expectation.covariance[e] = StatisticOf(e).Covariance(expected, places_[e].second);
    if (is_corrected()) expectation.covariance[e] += correction_.covariance[e];
  });
  return expectation;
}

int PlatePositionOf(const SetModel& model, int block) {
  int position = -1;
  for (int f : model.FramesOf(block)) {
    const int id = model.set().frames[f].plate_position_id;
    if (id < 0 || id == position) continue;
    if (position >= 0) return -1;
    position = id;
  }
  return position;
}

std::map<int, double> EstimateLineShifts(const SetModel& model, const SetParameters& parameters) {
  SetParameters centred = parameters;
  centred.line_shift_px.clear();
  const ExpectedSet expected = model.ExpectStrips(centred, false);
  std::map<int, std::pair<double, int>> sums;
  for (size_t f = 0; f < model.set().frames.size(); ++f) {
    const RecordedFrame& recorded = model.set().frames[f];
    if (recorded.plate_position_id < 0) continue;
    auto& [sum, count] = sums[recorded.plate_position_id];
    sum += DisplacementOfLine(model.set(), expected, static_cast<int>(f)).shift_px;
    ++count;
  }
  std::map<int, double> shifts;
  for (const auto& [id, value] : sums) shifts[id] = value.first / value.second;
  return shifts;
}

}  // namespace sightline
