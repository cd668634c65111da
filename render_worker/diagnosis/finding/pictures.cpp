// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/pictures.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/statistic/noise/bin_moments.h"
#include "render_worker/recordings/profile_bins.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

const char* PlaneName(const Sensor& sensor, int plane) {
  if (sensor.colour_filter == ColourFilter::kMono) return "mono";
  constexpr const char* kNames[] = {"red", "green", "green", "blue"};
  return kNames[plane];
}

std::vector<double> FrameChiSquared(const SetModel& model, const FitResult& fit) {
  std::vector<double> sum(model.set().frames.size(), 0);
  for (int e = 0; e < model.blocks(); ++e) {
    for (int row = 0; row < static_cast<int>(fit.residual[e].size()); ++row) {
      sum[model.FrameOfComponent(e, row)] += fit.residual[e][row] * fit.residual[e][row];
    }
  }
  return sum;
}

}  // namespace

std::vector<int> TellingRecordings(const SetModel& model, const FitResult& null,
                                   const FitResult& best, int count) {
  const std::vector<double> before = FrameChiSquared(model, null);
  const std::vector<double> after = FrameChiSquared(model, best);
  std::vector<int> order;
  for (size_t f = 0; f < before.size(); ++f) {
    if (model.set().frames[f].plate_position_id >= 0) order.push_back(static_cast<int>(f));
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return before[a] - after[a] > before[b] - after[b]; });
  if (static_cast<int>(order.size()) > count) order.resize(count);
  return order;
}

v1::ProfileComparison CompareProfiles(const SetModel& model, const FitResult& null,
                                      const FitResult& best, int recording) {
  const RecordedFrame& frame = model.set().frames[recording];
  const Sensor& sensor = frame.nominal.sensor;
  const std::vector<PixelPlane> planes = PixelPlanes(sensor);
  const ExpectedSet before = model.ExpectStrips(null.parameters, false);
  const ExpectedSet after = model.ExpectStrips(ParametersWithRandomEffect(best), false);
  const int blocks = model.blocks_along_line();
  v1::ProfileComparison chosen;
  double most = -1;
  for (size_t p = 0; p < planes.size(); ++p) {
    const PixelPlane& plane = planes[p];
    v1::ProfileComparison profile;
    profile.set_recording(recording);
    profile.set_channel(PlaneName(sensor, static_cast<int>(p)));
    double telling = 0;
    for (int row = plane.first_row; row < frame.raw_dn.rows_px; row += plane.step) {
      double sum = 0, count = 0, null_dn = 0, model_dn = 0, of_pixel = 0, of_row = 0;
      for (int c = plane.first_column; c < frame.raw_dn.columns_px; c += plane.step) {
        sum += frame.raw_dn.At(row, c);
        ++count;
      }
      for (int b = 0; b < blocks; ++b) {
        const ExpectedFrame& strip = after.strips[b][recording];
        null_dn += MeanOfColumns(before.strips[b][recording].mean_dn, row, plane) / blocks;
        const double mean = MeanOfColumns(strip.mean_dn, row, plane);
        model_dn += mean / blocks;
        double speckle = 0;
        for (const Image<float>& level : strip.level_dn) {
          speckle += std::pow(level.At(row, plane.first_column) - mean, 2) /
                     static_cast<double>(strip.level_dn.size());
        }
        // Neighbouring columns share some speckle: two columns per independent one.
        of_pixel += (2 * speckle + strip.noise_variance_dn2.At(row, plane.first_column) +
                     strip.pattern_variance_dn2.At(row, plane.first_column) +
                     std::pow(strip.column_scatter_dn, 2)) /
                    blocks;
        of_row += std::pow(strip.row_scatter_dn, 2) / blocks;
      }
      const double observed = sum / count;
      const double deviation = std::sqrt(of_pixel / count + of_row);
      profile.add_row_px(frame.nominal.roi.row_px + row);
      profile.add_observed_dn(observed);
      profile.add_null_dn(null_dn);
      profile.add_model_dn(model_dn);
      profile.add_standard_deviation_dn(deviation);
      telling += std::pow((observed - null_dn) / deviation, 2);
    }
    if (telling > most) {
      most = telling;
      chosen = std::move(profile);
    }
  }
  return chosen;
}

v1::RegionMap MapRegions(const SetModel& model, const FitResult& null, const FitResult& best,
                         int recording) {
  const RecordedFrame& frame = model.set().frames[recording];
  const std::vector<PixelPlane> planes = PixelPlanes(frame.nominal.sensor);
  const int plane = planes.size() > 1 ? 1 : 0;
  const int blocks = model.blocks_along_line();
  std::vector<ProfileBin> bins = MakeProfileBins(frame, planes);
  v1::RegionMap map;
  map.set_recording(recording);
  map.set_columns(blocks);
  for (int b = 0; b < blocks; ++b) {
    map.add_column_edges_px(frame.nominal.roi.column_px +
                            BlockColumns(frame.nominal.roi.columns_px, blocks, b).first);
  }
  map.add_column_edges_px(frame.nominal.roi.column_px + frame.nominal.roi.columns_px);
  const SetModel::Expectation expectation = model.Expect(best.parameters, true);
  std::vector<std::vector<float>> before(blocks), after(blocks);
  int block = 0;
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.StatisticOf(e).kind() != StatisticKind::kProfile) continue;
    bool here = false;
    size_t bin = 0;
    for (int row = 0; row < static_cast<int>(null.mean[e].size()); ++row) {
      if (model.FrameOfComponent(e, row) != recording) continue;
      here = true;
      if (bins[bin++].plane != plane) continue;
      const double deviation = std::sqrt(expectation.covariance[e](row, row));
      const double observed = model.observed()[e][row];
      before[block].push_back(static_cast<float>((observed - null.mean[e][row]) / deviation));
      after[block].push_back(static_cast<float>((observed - best.mean[e][row]) / deviation));
    }
    if (here) ++block;
  }
  if (block != blocks) return {};
  std::erase_if(bins, [&](const ProfileBin& bin) { return bin.plane != plane; });
  map.set_rows(static_cast<int>(bins.size()));
  for (const ProfileBin& bin : bins) {
    map.add_row_edges_px(frame.nominal.roi.row_px +
                         *std::min_element(bin.rows.begin(), bin.rows.end()));
  }
  map.add_row_edges_px(frame.nominal.roi.row_px + frame.nominal.roi.rows_px);
  for (size_t row = 0; row < bins.size(); ++row) {
    for (int b = 0; b < blocks; ++b) {
      map.add_null_z(before[b][row]);
      map.add_model_z(after[b][row]);
    }
  }
  return map;
}

}  // namespace sightline
