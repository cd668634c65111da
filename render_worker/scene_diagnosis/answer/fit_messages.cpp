// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/fit_messages.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <cstddef>

namespace sightline {
namespace {

// Chi squared of the blocks of one recording, either of the fit or held out.
void AddRecordingFit(const BlockGrid& grid, const PathFit& fit, int recording, bool held_out,
                     v1::ModelFit* message) {
  const int per_recording = grid.rows * grid.columns;
  double chi_squared = 0;
  int count = 0;
  for (int b = recording * per_recording; b < (recording + 1) * per_recording; ++b) {
    if (grid.HeldOut(b) != held_out) continue;
    chi_squared += fit.residuals[b] * fit.residuals[b];
    ++count;
  }
  v1::RecordingFit* added = message->add_recordings();
  added->set_recording(recording);
  added->set_held_out(held_out);
  added->set_chi_squared(chi_squared);
  added->set_degrees_of_freedom(count);
}

}  // namespace

v1::ModelFit PathFitMessage(const BlockGrid& grid, const PathFit& fit) {
  v1::ModelFit message;
  message.set_chi_squared(fit.held_out_chi_squared);
  message.set_degrees_of_freedom(fit.held_out_count);
  message.set_p_value(boost::math::cdf(boost::math::complement(
      boost::math::chi_squared(fit.held_out_count), fit.held_out_chi_squared)));
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    if (!path.nominal) continue;
    v1::FittedDeviation* deviation = message.add_deviations();
    deviation->set_name(path.parameter);
    deviation->set_standard_uncertainty(path.prior_standard_deviation);
    const auto i = static_cast<Eigen::Index>(k);
    deviation->set_value(fit.factors[i] - path.prior_mean);
    deviation->set_standard_error(std::sqrt(fit.covariance(i, i)));
  }
  for (int r = 0; r < grid.recordings; ++r) {
    for (const bool held_out : {false, true}) AddRecordingFit(grid, fit, r, held_out, &message);
  }
  return message;
}

v1::HeldOutImprovement HeldOutImprovementOf(const BlockGrid& grid, const PathFit& null_fit,
                                            const PathFit& model_fit) {
  v1::HeldOutImprovement improvement;
  improvement.set_measure("chi^2 per degree of freedom of held-out tiles");
  improvement.set_null(null_fit.HeldOutChiSquaredPerDegree());
  improvement.set_with_effect(model_fit.HeldOutChiSquaredPerDegree());
  for (int r = 0; r < grid.recordings; ++r) improvement.add_recordings(r);
  return improvement;
}

void AddResidualMaps(const BlockGrid& grid, const PathFit& null_fit, const PathFit& model_fit,
                     v1::Diagnosis* diagnosis) {
  for (int r = 0; r < grid.recordings; ++r) {
    v1::RegionMap* map = diagnosis->add_region_maps();
    map->set_recording(r);
    map->set_rows(grid.rows);
    map->set_columns(grid.columns);
    for (int i = 0; i <= grid.rows; ++i) map->add_row_edges_px(i * grid.block_px);
    for (int j = 0; j <= grid.columns; ++j) map->add_column_edges_px(j * grid.block_px);
    for (int i = 0; i < grid.rows; ++i) {
      for (int j = 0; j < grid.columns; ++j) {
        const int block = grid.Index(r, i, j);
        map->add_null_z(static_cast<float>(null_fit.residuals[block]));
        map->add_model_z(static_cast<float>(model_fit.residuals[block]));
      }
    }
  }
}

}  // namespace sightline
