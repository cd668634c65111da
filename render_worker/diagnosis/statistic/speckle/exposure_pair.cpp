// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/speckle/exposure_pair.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Edges of the bins: levels of the longer exposure as fractions of the range from dark to the
// largest raw value. Chosen: narrow where dark noise ends, then even up to where pixels saturate.
constexpr double kEdges[] = {0.02, 0.04, 0.07, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
// A pixel of the shorter exposure means a saturated one of the longer exposure if its prediction
// exceeds the range by this factor and this many standard deviations of noise. Chosen: a tenth for
// errors of gain and exposure, six deviations so that no pixel is wrongly included.
constexpr double kBeyondRange = 1.1;
constexpr double kBeyondNoise = 6;
// Variance of rounding [DN^2]: that of a uniform distribution over one raw value.
constexpr double kRoundingVariance_dn2 = 1.0 / 12;

ExposurePair MakeExposurePair(const RecordedSet& set, int first, int second, const Sensor& sensor) {
  const double gain = sensor.gain_dn_per_electron;
  const double offset = DarkMeanDn(sensor);
  const double span = sensor.largest_dn() - offset;
  const double dark = std::pow(gain * sensor.dark_noise_electrons, 2) + kRoundingVariance_dn2;
  ExposurePair pair;
  pair.first = first;
  pair.second = second;
  pair.ratio =
      set.frames[second].nominal.exposure_time_s / set.frames[first].nominal.exposure_time_s;
  pair.offset_dn = offset;
  pair.gain_dn = gain;
  pair.dark_noise = (1 + pair.ratio * pair.ratio) * dark;
  for (double edge : kEdges) {
    pair.edges_dn.push_back(2 * offset + edge * span * (1 + pair.ratio) / pair.ratio);
  }
  const double margin = kBeyondNoise * std::sqrt(gain * span / pair.ratio + dark);
  pair.saturated_dn = offset + kBeyondRange * span / pair.ratio + margin;
  return pair;
}

// Pixels of each component of a pair.
std::vector<double> CountPixels(const RecordedSet& set, const ExposurePair& pair) {
  std::vector<double> count(pair.size(), 0);
  const std::vector<uint16_t>& a = set.frames[pair.first].raw_dn.values;
  const std::vector<uint16_t>& b = set.frames[pair.second].raw_dn.values;
  for (size_t p = 0; p < a.size(); ++p) {
    const int bin = pair.BinOf(static_cast<double>(a[p]) + b[p]);
    if (bin >= 0) {
      ++count[bin];
      ++count[pair.variance_ratio()];
    }
    if (a[p] >= pair.saturated_dn) ++count[pair.saturated()];
  }
  return count;
}

}  // namespace

int ExposurePair::BinOf(double sum_dn) const {
  const auto edge = std::upper_bound(edges_dn.begin(), edges_dn.end(), sum_dn);
  if (edge == edges_dn.begin() || edge == edges_dn.end()) return -1;
  return static_cast<int>(edge - edges_dn.begin()) - 1;
}

double ExposurePair::NominalVariance(double sum_dn) const {
  const double signal_dn = std::max(0.0, (sum_dn - 2 * offset_dn) * ratio / (1 + ratio));
  return (1 + ratio) * gain_dn * signal_dn + dark_noise;
}

std::vector<SharedSpeckleBlock> MakeSharedSpeckleBlocks(const RecordedSet& set) {
  std::map<int, std::vector<int>> of_position;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const int id = set.frames[f].plate_position_id;
    if (id >= 0) of_position[id].push_back(static_cast<int>(f));
  }
  std::vector<SharedSpeckleBlock> blocks;
  for (const auto& [id, all] : of_position) {
    SharedSpeckleBlock block;
    for (int f : all) {
      if (SameSpeckle(set.frames[all.front()], set.frames[f])) block.frames.push_back(f);
    }
    if (block.frames.size() < 2) continue;
    std::vector<int> order = block.frames;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return set.frames[a].nominal.exposure_time_s < set.frames[b].nominal.exposure_time_s;
    });
    const FrameSetup& front = set.frames[all.front()].nominal;
    block.columns_px = front.roi.columns_px;
    for (size_t i = 0; i + 1 < order.size(); ++i) {
      block.pairs.push_back(MakeExposurePair(set, order[i], order[i + 1], front.sensor));
      block.size += block.pairs.back().size();
    }
    if (!set.frames[order.front()].raw_dn.empty()) {
      for (const ExposurePair& pair : block.pairs) {
        const std::vector<double> count = CountPixels(set, pair);
        block.observed_count.insert(block.observed_count.end(), count.begin(), count.end());
      }
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

}  // namespace sightline
