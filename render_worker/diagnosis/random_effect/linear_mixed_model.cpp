// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/linear_mixed_model.h"

namespace sightline {

namespace {

// Cholesky decomposition of I + L'AL, whose determinant is that of I + K A.
Eigen::LLT<Eigen::MatrixXd> AmplitudeInformation(const ProjectedModel& model,
                                                 const Eigen::MatrixXd& factor) {
  Eigen::MatrixXd information = factor.transpose() * model.inner * factor;
  information.diagonal().array() += 1;
  return Eigen::LLT<Eigen::MatrixXd>(information);
}

}  // namespace

ProjectedModel ProjectOutNuisance(const LinearMixedModel& model) {
  ProjectedModel projected;
  projected.log_determinant = model.log_determinant;
  Eigen::MatrixXd information = model.nuisance_weight.asDiagonal();
  information.noalias() += model.nuisance.transpose() * model.nuisance;
  projected.information.compute(information);
  const auto project = [&](const Eigen::MatrixXd& v) -> Eigen::MatrixXd {
    return v - model.nuisance * projected.information.solve(model.nuisance.transpose() * v);
  };
  const Eigen::VectorXd residual = project(model.residual);
  const Eigen::MatrixXd change = project(model.change);
  projected.inner.noalias() = model.change.transpose() * change;
  projected.slope = model.change.transpose() * residual;
  projected.length = model.residual.dot(residual);
  if (model.offset_change.size() == 0) return projected;
  const Eigen::MatrixXd offset_change = project(model.offset_change);
  projected.offset_inner.noalias() = model.offset_change.transpose() * offset_change;
  projected.offset_cross.noalias() = model.change.transpose() * offset_change;
  projected.offset_slope = model.offset_change.transpose() * residual;
  return projected;
}

ProjectedData DataAtOffset(const ProjectedModel& model, const Eigen::VectorXd& offset) {
  if (offset.size() == 0) return {model.slope, model.length};
  return {
      model.slope - model.offset_cross * offset,
      model.length - 2 * offset.dot(model.offset_slope) + offset.dot(model.offset_inner * offset)};
}

double LogMarginalLikelihood(const ProjectedModel& model, const Eigen::VectorXd& offset,
                             const Eigen::MatrixXd& factor, double reference) {
  const ProjectedData data = DataAtOffset(model, offset);
  const Eigen::LLT<Eigen::MatrixXd> solver = AmplitudeInformation(model, factor);
  const Eigen::VectorXd gradient = factor.transpose() * data.slope;
  const double nuisance = 2 * model.information.matrixLLT().diagonal().array().log().sum();
  return 0.5 * (reference - data.length + gradient.dot(solver.solve(gradient))) -
         solver.matrixLLT().diagonal().array().log().sum() -
         0.5 * (nuisance + model.log_determinant);
}

MixedModelPosterior PosteriorOf(const LinearMixedModel& model, const ProjectedModel& projected,
                                const Eigen::VectorXd& offset, const Eigen::MatrixXd& factor) {
  MixedModelPosterior posterior;
  const ProjectedData data = DataAtOffset(projected, offset);
  const Eigen::LLT<Eigen::MatrixXd> solver = AmplitudeInformation(projected, factor);
  posterior.standardised_amplitudes = solver.solve(factor.transpose() * data.slope);
  posterior.amplitudes = factor * posterior.standardised_amplitudes;
  Eigen::VectorXd residual = model.residual - model.change * posterior.amplitudes;
  if (offset.size() > 0) residual -= model.offset_change * offset;
  posterior.nuisance = projected.information.solve(model.nuisance.transpose() * residual);
  posterior.log_determinant =
      2 * (solver.matrixLLT().diagonal().array().log().sum() +
           projected.information.matrixLLT().diagonal().array().log().sum());
  return posterior;
}

}  // namespace sightline
