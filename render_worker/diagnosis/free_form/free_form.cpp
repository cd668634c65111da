// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/free_form/free_form.h"

#include <cassert>
#include <cmath>
#include <vector>

#include "render_worker/diagnosis/free_form/free_form_effect.h"

namespace sightline {
namespace {

const std::vector<const FreeFormEffect*>& Terms() {
  static const std::vector<const FreeFormEffect*> terms = [] {
    std::vector<const FreeFormEffect*> all;
    for (const std::vector<const FreeFormEffect*>& of_stage :
         {IlluminationTerms(), SurfaceTerms(), OpticsTerms(), GeometryTerms(), SensorTerms(),
          ReadoutTerms(), TimeTerms()}) {
      all.insert(all.end(), of_stage.begin(), of_stage.end());
    }
    return all;
  }();
  return terms;
}

}  // namespace

std::span<const Effect* const> FreeFormTerms() {
  static const std::vector<const Effect*> effects(Terms().begin(), Terms().end());
  return effects;
}

const Effect* FindFreeFormTerm(std::string_view id) {
  for (const Effect* term : FreeFormTerms()) {
    if (term->description().id == id) return term;
  }
  return nullptr;
}

v1::FreeFormTerm DescribeFreeForm(const Effect& term, std::span<const double> coefficients,
                                  const Eigen::MatrixXd& covariance) {
  const FreeFormEffect* found = nullptr;
  for (const FreeFormEffect* known : Terms()) {
    if (known == &term) found = known;
  }
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
