// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/set_model.h"

#include <algorithm>
#include <atomic>
#include <string_view>

#include "core/parallel/worker_threads.h"
#include "render_worker/diagnosis/statistic/burst_statistic.h"
#include "render_worker/diagnosis/statistic/fixed_pattern_statistic.h"
#include "render_worker/diagnosis/statistic/histogram_statistic.h"
#include "render_worker/diagnosis/statistic/hot_pixels.h"
#include "render_worker/diagnosis/statistic/line_displacement.h"
#include "render_worker/diagnosis/statistic/noise_statistics.h"
#include "render_worker/diagnosis/statistic/profile_statistic.h"
#include "render_worker/diagnosis/statistic/shared_speckle_statistic.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

// Runs work(i) for all i; every i writes to places of its own.
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

template <typename T>
Image<T> Inner(const Image<T>& image, int margin_px) {
  Image<T> inner(image.columns_px - 2 * margin_px, image.rows_px);
  for (int row = 0; row < inner.rows_px; ++row) {
    for (int c = 0; c < inner.columns_px; ++c) inner.At(row, c) = image.At(row, c + margin_px);
  }
  return inner;
}

void CutMargin(ExpectedFrame& strip, int margin_px) {
  for (Image<float>& level : strip.level_dn) level = Inner(level, margin_px);
  strip.mean_dn = Inner(strip.mean_dn, margin_px);
  strip.level_variance_dn2 = Inner(strip.level_variance_dn2, margin_px);
  strip.noise_variance_dn2 = Inner(strip.noise_variance_dn2, margin_px);
  if (!strip.noise_excess_kurtosis.empty()) {
    strip.noise_excess_kurtosis = Inner(strip.noise_excess_kurtosis, margin_px);
  }
  strip.pattern_variance_dn2 = Inner(strip.pattern_variance_dn2, margin_px);
  strip.mean_photo_electrons = Inner(strip.mean_photo_electrons, margin_px);
  strip.frame.roi.column_px += margin_px;
  strip.frame.roi.columns_px -= 2 * margin_px;
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
  statistics_.push_back(std::make_unique<ProfileStatistic>(set, settings.blocks_along_line));
  statistics_.push_back(std::make_unique<TextureStatistic>(set, settings.blocks_along_line));
  statistics_.push_back(std::make_unique<RepeatStatistic>(set));
  statistics_.push_back(std::make_unique<DarkStatistic>(set));
  statistics_.push_back(std::make_unique<SharedSpeckleStatistic>(set));
  statistics_.push_back(std::make_unique<HistogramStatistic>(set));
  statistics_.push_back(std::make_unique<FixedPatternStatistic>(set));
  statistics_.push_back(std::make_unique<BurstStatistic>(set));
  const bool recorded = !set.frames.empty() && !set.frames.front().raw_dn.values.empty();
  const RecordedSet cleaned = recorded ? WithoutHotPixels(set) : RecordedSet{};
  for (size_t s = 0; s < statistics_.size(); ++s) {
    // Hot pixels are a fixed pattern.
    const RecordedSet& seen = statistics_[s]->name() == "fixed pattern" ? set : cleaned;
    for (int entry = 0; entry < statistics_[s]->entries(); ++entry) {
      places_.emplace_back(static_cast<int>(s), entry);
      observed_.push_back(recorded ? statistics_[s]->Observed(seen, entry) : Eigen::VectorXd());
    }
  }
}

ExpectedSet SetModel::ExpectStrips(const SetParameters& parameters, bool middle_only) const {
  const int blocks = settings_.blocks_along_line;
  const int frames = static_cast<int>(set_.frames.size());
  const int bursts = static_cast<int>(bursts_.size());
  ExpectedSet expected;
  expected.effects = parameters.effects;
  expected.model_error = parameters.model_error;
  const bool colour =
      frames > 0 && set_.frames[0].nominal.sensor.colour_filter != ColourFilter::kMono;
  // On a colour sensor charge goes to the neighbours of a narrow strip's edges too.
  const bool spreads = std::any_of(
      parameters.effects.begin(), parameters.effects.end(),
      [](const ActiveEffect& active) { return active.effect->description().MovesCharge(); });
  const int margin_px = colour && spreads ? 2 : 0;
  std::vector<FrameSetup> setups(frames);
  expected.strips.assign(blocks, std::vector<ExpectedFrame>(frames));
  for (int f = 0; f < frames; ++f) {
    const RecordedFrame& recorded = set_.frames[f];
    SetupDeviation deviations = parameters.deviations;
    const auto shift = parameters.line_shift_px.find(recorded.plate_position_id);
    if (shift != parameters.line_shift_px.end()) deviations.line_position_each_px = shift->second;
    setups[f] = DeviatedFrame(set_, f, deviations);
  }
  ForAll(bursts, settings_.threads, [&](int burst) {
    const auto [first, last] = bursts_[burst];
    for (int f = first; f < last; ++f) {
      // The middle first: its optics stand for all where they do not depend on the field.
      std::shared_ptr<const LineImaging> imaging;
      for (int i = 0; i < blocks; ++i) {
        const int block = (i + blocks / 2) % blocks;
        std::vector<ExpectedFrame>& strips = expected.strips[block];
        FrameSetup frame = setups[f];
        frame.roi = StripRegion(frame.roi, blocks, block, settings_.strip_columns_px);
        // Without margin: lag and charge spread together are second order.
        const Image<double>* previous =
            f > first && margin_px == 0 ? &strips[f - 1].mean_photo_electrons : nullptr;
        frame.roi.column_px -= margin_px;
        frame.roi.columns_px += 2 * margin_px;
        const auto [first_column, last_column] =
            BlockColumns(setups[f].roi.columns_px, blocks, block);
        strips[f] = ExpectFrame(frame, parameters.effects, previous, imaging,
                                settings_.speckle_levels, last_column - first_column);
        if (margin_px > 0) CutMargin(strips[f], margin_px);
        imaging = strips[f].imaging;
        if (middle_only) {
          for (std::vector<ExpectedFrame>& other : expected.strips) {
            if (&other != &strips) other[f] = strips[f];
          }
          break;
        }
      }
    }
  });
  return expected;
}

int SetModel::PlatePositionOf(int entry) const {
  int position = -1;
  for (int f : FramesOf(entry)) {
    const int id = set_.frames[f].plate_position_id;
    if (id < 0 || id == position) continue;
    if (position >= 0) return -1;
    position = id;
  }
  return position;
}

std::map<int, double> SetModel::EstimateLineShifts(const SetParameters& parameters) const {
  SetParameters centred = parameters;
  centred.line_shift_px.clear();
  const ExpectedSet expected = ExpectStrips(centred, false);
  std::map<int, std::pair<double, int>> sums;
  for (size_t f = 0; f < set_.frames.size(); ++f) {
    const RecordedFrame& recorded = set_.frames[f];
    if (recorded.plate_position_id < 0) continue;
    auto& [sum, count] = sums[recorded.plate_position_id];
    sum += DisplacementOfLine(set_, expected, static_cast<int>(f)).shift_px;
    ++count;
  }
  std::map<int, double> shifts;
  for (const auto& [id, value] : sums) shifts[id] = value.first / value.second;
  return shifts;
}

SetModel::Expectation SetModel::Expect(const SetParameters& parameters, bool with_covariance,
                                       bool middle_only) const {
  const ExpectedSet expected = ExpectStrips(parameters, middle_only);
  Expectation expectation;
  expectation.mean.resize(entries());
  if (with_covariance) expectation.covariance.resize(entries());
  ForAll(entries(), settings_.threads, [&](int e) {
    const int entry = places_[e].second;
    expectation.mean[e] = StatisticOf(e).Expected(expected, entry);
    if (with_covariance) {
      expectation.covariance[e] = StatisticOf(e).Covariance(expected, entry);
    }
  });
  return expectation;
}

}  // namespace sightline
