// SPDX-License-Identifier: Apache-2.0
// A linear mixed model of whitened data r (n numbers of unit variance):
//
//   r = J z + V a + U c + e,   z ~ N(0, diag(w)^-1),   a ~ N(0, K),   e ~ N(0, I)
//
// with nuisance parameters z (k of them), random amplitudes a (m) and an offset c (q) that is
// given. Nuisance parameters and amplitudes are integrated out analytically (Bishop, Pattern
// Recognition and Machine Learning (2006), 2.3.3 and 3.5.1; Searle, Casella and McCulloch, Variance
// Components (1992), chapter 6). With
//
//   H = J'J + diag(w),   P = I - J H^-1 J',   A = V'PV,   b = V'P(r - U c),
//
// the logarithm of the marginal likelihood over that of the model without amplitudes is
//
//   1/2 b' (K^-1 + A)^-1 b - 1/2 log |I + K A|.
//
// K enters by a factor L, K = L L', and need not be invertible. The projection by P is computed
// once; many K can be compared with it.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace sightline {

struct LinearMixedModel {
  Eigen::VectorXd residual;         // r, n
  Eigen::MatrixXd nuisance;         // J, n x k
  Eigen::VectorXd nuisance_weight;  // w, k; inverse prior variances, > 0
  Eigen::MatrixXd change;           // V, n x m
  Eigen::MatrixXd offset_change;    // U, n x q; of size 0 where there is no offset
  // log |Sigma| of the data's covariance over that of the model compared with. It is not 0 if the
  // two have different covariances.
  double log_determinant = 0;
};

// The model with its nuisance parameters taken off.
struct ProjectedModel {
  Eigen::LLT<Eigen::MatrixXd> information;  // of H
  Eigen::MatrixXd inner;                    // A = V'PV, m x m
  Eigen::VectorXd slope;                    // V'Pr, m
  double length = 0;                        // r'Pr
  Eigen::MatrixXd offset_inner;             // U'PU, q x q
  Eigen::MatrixXd offset_cross;             // V'PU, m x q
  Eigen::VectorXd offset_slope;             // U'Pr, q
  double log_determinant = 0;               // LinearMixedModel::log_determinant
};
ProjectedModel ProjectOutNuisance(const LinearMixedModel& model);

// The rest that the amplitudes have to explain at the offset c.
struct ProjectedData {
  Eigen::VectorXd slope;  // b = V'P(r - U c), m
  double length = 0;      // (r - U c)'P(r - U c)
};
// `offset`: c, q numbers, or empty for none.
ProjectedData DataAtOffset(const ProjectedModel& model, const Eigen::VectorXd& offset);

// Logarithm of the marginal likelihood of r over that of a reference model [nats]:
//
//   1/2 (R - (r - U c)'P(r - U c) + b' (K^-1 + A)^-1 b) - 1/2 log |I + K A|
//     - 1/2 (log |H| + log |Sigma|).
//
// `reference`, R: twice the negative log marginal likelihood of the reference model without the
// terms n log 2 pi and -log |diag(w)|, which cancel; 0 gives the log marginal likelihood itself but
// for these terms. `factor`: L, m x m.
double LogMarginalLikelihood(const ProjectedModel& model, const Eigen::VectorXd& offset,
                             const Eigen::MatrixXd& factor, double reference);

// Joint posterior of amplitudes and nuisance parameters, which is normal.
struct MixedModelPosterior {
  Eigen::VectorXd amplitudes;               // mean of a = L s, m
  Eigen::VectorXd standardised_amplitudes;  // mean of s, whose prior is standard normal, m
  Eigen::VectorXd nuisance;                 // mean of z, k
  // log |I + K A| + log |H|: of the posterior information of (z, s).
  double log_determinant = 0;
};
// `projected`: ProjectOutNuisance(model). `offset`, `factor`: as above.
MixedModelPosterior PosteriorOf(const LinearMixedModel& model, const ProjectedModel& projected,
                                const Eigen::VectorXd& offset, const Eigen::MatrixXd& factor);

}  // namespace sightline
