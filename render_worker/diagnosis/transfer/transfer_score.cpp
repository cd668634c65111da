// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/transfer/transfer_score.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

namespace sightline {
namespace {

// Standard deviations tau of the coefficients that are tried, in units of the columns. Chosen: half
// decades over what priors of the terms allow.
constexpr double kStrengths[] = {0.03, 0.1, 0.3, 1, 3, 10, 30};

// Quadratic forms of a design X = [J Phi] and residuals r of whitened components.
struct Gram {
  Eigen::MatrixXd information;  // X'X
  Eigen::VectorXd gradient;     // X'r
  double squares = 0;           // r'r

  explicit Gram(Eigen::Index columns)
      : information(Eigen::MatrixXd::Zero(columns, columns)),
        gradient(Eigen::VectorXd::Zero(columns)) {}
  void Add(const Eigen::MatrixXd& design, const Eigen::VectorXd& residual) {
    information.noalias() += design.transpose() * design;
    gradient.noalias() += design.transpose() * residual;
    squares += residual.squaredNorm();
  }
};

double LogDeterminant(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return 2 * factor.matrixLLT().diagonal().array().log().sum();
}

// Group of a block: its plate position; below 0 what has none or several.
int GroupOf(const SetModel& model, int block) {
  const int position = PlatePositionOf(model, block);
  if (position >= 0) return position;
  const std::vector<int>& frames = model.FramesOf(block);
  return frames.size() == 1 ? -2 - frames.front() : -1;
}

// Residual, Jacobian and columns of a block that are not whitened.
struct PlainBlock {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd residual;
  Eigen::MatrixXd design;  // [J Phi]
};

PlainBlock MakePlainBlock(const SetModel& model, const FitResult& base, int block,
                          const DiscrepancyColumns& columns) {
  const auto e = static_cast<size_t>(block);
  PlainBlock plain;
  plain.covariance = base.whitening->Covariance(block);
  plain.residual = model.observed()[e] - base.mean[e];
  const Eigen::Index known = base.jacobian[e].cols();
  plain.design.resize(plain.residual.size(), known + static_cast<Eigen::Index>(columns.size()));
  plain.design.leftCols(known) = base.whitening->Coloured(block, base.jacobian[e]);
  for (size_t i = 0; i < base.at_bound.size(); ++i) {
    if (base.at_bound[i]) plain.design.col(static_cast<Eigen::Index>(i)).setZero();
  }
  for (size_t c = 0; c < columns.size(); ++c) {
    plain.design.col(known + static_cast<Eigen::Index>(c)) = columns[c][e];
  }
  return plain;
}

// Adds the components used to `used`, and those held out, whitened given the ones used, to
// `held_out`.
void Divide(const PlainBlock& block, const std::vector<bool>& is_held_out, Gram* used,
            Gram* held_out) {
  std::vector<int> order(is_held_out.size());
  std::iota(order.begin(), order.end(), 0);
  const auto first =
      std::stable_partition(order.begin(), order.end(), [&](int k) { return !is_held_out[k]; });
  const auto count = static_cast<Eigen::Index>(first - order.begin());
  const Eigen::LLT<Eigen::MatrixXd> factor(block.covariance(order, order));
  const Eigen::VectorXd residual = factor.matrixL().solve(block.residual(order));
  const Eigen::MatrixXd design = factor.matrixL().solve(block.design(order, Eigen::all));
  const Eigen::Index rest = residual.size() - count;
  used->Add(design.topRows(count), residual.head(count));
  held_out->Add(design.bottomRows(rest), residual.tail(rest));
}

// The parameters of one candidate given the components used.
class Posterior {
 public:
  // `base` gives the priors of the first parameters, N(0, strength^2) those of the others.
  Posterior(const FitResult& base, const Gram& used, double strength)
      : precision_(used.information) {
    const Eigen::Index known = base.standardised.size();
    const Eigen::Index more = used.gradient.size() - known;
    Eigen::VectorXd weight(used.gradient.size());
    weight << base.prior_weight, Eigen::VectorXd::Constant(more, 1 / (strength * strength));
    precision_.diagonal() += weight;
    factor_.compute(precision_);
    Eigen::VectorXd gradient = used.gradient;
    gradient.head(known) -= base.prior_weight.cwiseProduct(base.standardised);
    for (size_t i = 0; i < base.at_bound.size(); ++i) {
      if (base.at_bound[i]) gradient[static_cast<Eigen::Index>(i)] = 0;
    }
    step_ = factor_.solve(gradient);
    log_evidence_ = 0.5 * gradient.dot(step_) - 0.5 * LogDeterminant(factor_) -
                    static_cast<double>(more) * std::log(strength);
  }

  // Up to a constant of the components used.
  double log_evidence() const { return log_evidence_; }

  // Log predictive density of held-out components, up to a constant of these.
  double Score(const Gram& held_out) const {
    const Eigen::VectorXd gradient = held_out.gradient - held_out.information * step_;
    const double squares = held_out.squares - 2 * step_.dot(held_out.gradient) +
                           step_.dot(held_out.information * step_);
    const Eigen::LLT<Eigen::MatrixXd> together(precision_ + held_out.information);
    return -0.5 * (squares - gradient.dot(together.solve(gradient)) + LogDeterminant(together) -
                   LogDeterminant(factor_));
  }

 private:
  Eigen::MatrixXd precision_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd step_;
  double log_evidence_ = 0;
};

// The posterior at the strength of largest evidence.
Posterior BestPosterior(const FitResult& base, const Gram& used) {
  Posterior best(base, used, kStrengths[0]);
  if (used.gradient.size() == base.standardised.size()) return best;
  for (const double strength : kStrengths) {
    Posterior other(base, used, strength);
    if (other.log_evidence() > best.log_evidence()) best = std::move(other);
  }
  return best;
}

// Rows and columns of the known parameters and of the columns `first` ... `first + count - 1` of
// Phi.
Gram Part(const Gram& all, Eigen::Index known, int first, size_t count) {
  std::vector<int> kept(static_cast<size_t>(known) + count);
  std::iota(kept.begin(), kept.begin() + known, 0);
  std::iota(kept.begin() + known, kept.end(), static_cast<int>(known) + first);
  Gram part(static_cast<Eigen::Index>(kept.size()));
  part.information = all.information(kept, kept);
  part.gradient = all.gradient(kept);
  part.squares = all.squares;
  return part;
}

// Components used and held out in one half of a split, with the columns of all candidates.
struct DividedSet {
  Gram used;
  std::map<int, Gram> held_out;  // by group
};

DividedSet DivideSet(const SetModel& model, const std::vector<PlainBlock>& blocks,
                     const std::vector<std::vector<bool>>& is_held_out) {
  const Eigen::Index columns = blocks.front().design.cols();
  DividedSet set{Gram(columns), {}};
  for (int e = 0; e < model.blocks(); ++e) {
    Divide(blocks[e], is_held_out[e], &set.used,
           &set.held_out.try_emplace(GroupOf(model, e), columns).first->second);
  }
  return set;
}

}  // namespace

double TransferScore::Total() const {
  return std::accumulate(of_group.begin(), of_group.end(), 0.0);
}

std::vector<TransferScore> ScoreTransfer(const SetModel& model, const FitResult& base,
                                         const std::vector<SettingSplit>& splits,
                                         const std::vector<DiscrepancyColumns>& candidates) {
  DiscrepancyColumns all;
  for (const DiscrepancyColumns& columns : candidates) {
    all.insert(all.end(), columns.begin(), columns.end());
  }
  std::vector<PlainBlock> blocks;
  std::map<int, double> none;
  for (int e = 0; e < model.blocks(); ++e) {
    blocks.push_back(MakePlainBlock(model, base, e, all));
    none[GroupOf(model, e)] = 0;
  }
  std::vector<std::map<int, double>> scores(candidates.size(), none);
  const Eigen::Index known = base.standardised.size();
  for (const SettingSplit& split : splits) {
    for (const auto& half : split.held_out) {
      const DividedSet set = DivideSet(model, blocks, half);
      int first = 0;
      for (size_t c = 0; c < candidates.size(); ++c) {
        const size_t count = candidates[c].size();
        const Posterior posterior = BestPosterior(base, Part(set.used, known, first, count));
        for (const auto& [group, held_out] : set.held_out) {
          scores[c][group] += posterior.Score(Part(held_out, known, first, count)) /
                              static_cast<double>(splits.size());
        }
        first += static_cast<int>(count);
      }
    }
  }
  std::vector<TransferScore> totals(candidates.size());
  for (size_t c = 0; c < candidates.size(); ++c) {
    for (const auto& [group, nats] : scores[c]) totals[c].of_group.push_back(nats);
  }
  return totals;
}

ScoreDifference Difference(const TransferScore& a, const TransferScore& b) {
  const auto n = static_cast<double>(a.of_group.size());
  ScoreDifference difference{.nats = a.Total() - b.Total(), .standard_error = 0};
  double squares = 0;
  for (size_t g = 0; g < a.of_group.size(); ++g) {
    const double deviation = a.of_group[g] - b.of_group[g] - difference.nats / n;
    squares += deviation * deviation;
  }
  if (n > 1) difference.standard_error = std::sqrt(n / (n - 1) * squares);
  return difference;
}

}  // namespace sightline
