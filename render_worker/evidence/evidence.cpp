// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/evidence.h"

namespace sightline {

Evidence operator-(const Evidence& a, const Evidence& b) {
  return {.fit = a.fit - b.fit,
          .covariance = a.covariance - b.covariance,
          .curvature = a.curvature - b.curvature,
          .parameter_prior = a.parameter_prior - b.parameter_prior,
          .model_prior = a.model_prior - b.model_prior};
}

Evidence operator+(const Evidence& a, const Evidence& b) {
  return {.fit = a.fit + b.fit,
          .covariance = a.covariance + b.covariance,
          .curvature = a.curvature + b.curvature,
          .parameter_prior = a.parameter_prior + b.parameter_prior,
          .model_prior = a.model_prior + b.model_prior};
}

v1::Evidence EvidenceToProto(const Evidence& evidence) {
  v1::Evidence message;
  message.set_fit_nats(evidence.fit);
  message.set_covariance_nats(evidence.covariance);
  message.set_curvature_nats(evidence.curvature);
  message.set_parameter_prior_nats(evidence.parameter_prior);
  message.set_model_prior_nats(evidence.model_prior);
  return message;
}

}  // namespace sightline
