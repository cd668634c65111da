// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/describe_term.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/stage_name.h"

namespace sightline {

v1::FreeFormTerm DescribeFreeForm(const Effect& term, std::span<const double> coefficients,
                                  const Eigen::MatrixXd& covariance) {
  const auto* found = dynamic_cast<const FreeFormEffect*>(&term);
  assert(found != nullptr);
  const auto& parameters = found->description().parameters;
  assert(coefficients.size() == parameters.size());
  assert(covariance.size() == 0 || covariance.rows() == static_cast<int>(parameters.size()));
  v1::FreeFormTerm message;
  message.set_stage(std::string(StageName(found->description().stage)));
  message.set_term(std::string(found->term()));
  FreeFormEffect::Axes axes = found->CurveAxes();
  message.set_abscissa(std::move(axes.abscissa));
  message.set_ordinate(std::move(axes.ordinate));
  std::vector<double> moved(coefficients.begin(), coefficients.end());
  for (const double x : axes.abscissa_values) {
    message.add_abscissa_values(x);
    message.add_values(found->CurveAt(x, coefficients));
    if (covariance.size() == 0) continue;
    Eigen::VectorXd slope(static_cast<int>(parameters.size()));
    for (size_t k = 0; k < parameters.size(); ++k) {
      const double step = 1e-3 * parameters[k].prior_scale;
      moved[k] = coefficients[k] + step;
      const double above = found->CurveAt(x, moved);
      moved[k] = coefficients[k] - step;
      slope[static_cast<int>(k)] = (above - found->CurveAt(x, moved)) / (2 * step);
      moved[k] = coefficients[k];
    }
    message.add_standard_errors(std::sqrt(std::max(0.0, slope.dot(covariance * slope))));
  }
  return message;
}

}  // namespace sightline
