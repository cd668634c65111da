// SPDX-License-Identifier: Apache-2.0
#include "core/shared_errors/shared_errors.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/part/point_index.h"
#include "core/statistics/covariance_root.h"

namespace sightline {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

bool UsesOverlap(RegistrationMethod method) {
  return method == RegistrationMethod::kBestFit || method == RegistrationMethod::kDatumFeatures;
}

}  // namespace

SharedErrors::SharedErrors(SharedErrorsInput input) : input_(std::move(input)) {
  const size_t target_count = input_.positions_m.size();
  std::vector<size_t> count(target_count + 1, 0);
  std::vector<double> sum(target_count, 0);
  for (const ScanShare& scan : input_.scans) {
    place_count_ = std::max(place_count_, scan.place + 1);
    frame_count_ = std::max(frame_count_, scan.frame + 1);
    assert(scan.targets.size() == scan.information.size());
    assert(scan.targets.size() == scan.derivatives.size());
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      if (!(scan.information[i] > 0) || !scan.derivatives[i].allFinite()) continue;
      ++count[scan.targets[i] + 1];
      sum[scan.targets[i]] += scan.information[i];
    }
  }
  for (size_t t = 0; t < target_count; ++t) count[t + 1] += count[t];
  begin_ = count;
  shares_.resize(begin_.back());
  for (size_t s = 0; s < input_.scans.size(); ++s) {
    const ScanShare& scan = input_.scans[s];
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      if (!(scan.information[i] > 0) || !scan.derivatives[i].allFinite()) continue;
      const uint32_t t = scan.targets[i];
      shares_[count[t]++] = {static_cast<uint32_t>(s), static_cast<uint32_t>(i),
                             scan.information[i] / sum[t]};
    }
  }
  place_root_ =
      CovarianceRoot(input_.calibration.topLeftCorner<kPlaceVariables, kPlaceVariables>());
  constexpr int kLens = kCalibrationVariables - kPlaceVariables;
  lens_root_ = CovarianceRoot(input_.calibration.bottomRightCorner<kLens, kLens>());
  Register();
}

std::span<const SharedErrors::Share> SharedErrors::SharesOf(uint32_t target) const {
  if (target + 1 >= begin_.size()) return {};
  return std::span(shares_).subspan(begin_[target], begin_[target + 1] - begin_[target]);
}

SharedErrors::Row6 SharedErrors::PoseRow(uint32_t target) const {
  const Eigen::Vector3d normal = input_.normals[target].cast<double>();
  const Eigen::Vector3d arm = input_.positions_m[target].cast<double>() - centre_m_;
  Row6 row;
  row << (arm.cross(normal) / radius_m_).transpose(), normal.transpose();
  return row;
}

RowVectorXd SharedErrors::PlaceRow(const Share& share) const {
  const ScanShare& scan = input_.scans[share.scan];
  const CalibrationRow derivatives = scan.derivatives[share.index].cast<double>();
  const Index of_place = place_root_.cols(), of_lens = lens_root_.cols();
  RowVectorXd row = RowVectorXd::Zero(static_cast<Index>(place_count_) * of_place + of_lens);
  row.segment(static_cast<Index>(scan.place) * of_place, of_place) =
      derivatives.head<kPlaceVariables>() * place_root_;
  row.tail(of_lens) = derivatives.tail<kCalibrationVariables - kPlaceVariables>() * lens_root_;
  return row;
}

RowVectorXd SharedErrors::CalibrationRowOf(uint32_t target) const {
  const Index columns = static_cast<Index>(place_count_) * place_root_.cols() + lens_root_.cols();
  RowVectorXd row = RowVectorXd::Zero(columns);
  if (columns == 0) return row;
  const Row6 pose = PoseRow(target);
  for (const Share& share : SharesOf(target)) {
    row += share.weight * PlaceRow(share);
    if (response_.size() == 0) continue;
    const auto frame = static_cast<Index>(input_.scans[share.scan].frame);
    row += share.weight * (pose * response_.middleRows<6>(6 * frame));
  }
  return row;
}

RowVectorXd SharedErrors::RegistrationRowOf(uint32_t target) const {
  RowVectorXd row = RowVectorXd::Zero(pose_root_.cols());
  if (row.size() == 0) return row;
  const Row6 pose = PoseRow(target);
  for (const Share& share : SharesOf(target)) {
    const auto frame = static_cast<Index>(input_.scans[share.scan].frame);
    row += share.weight * (pose * pose_root_.middleRows<6>(6 * frame));
  }
  return row;
}

// Sum of the correlations of each target's estimate with those of its neighbours and itself.
std::vector<double> SharedErrors::NeighbourCounts() const {
  const size_t count = input_.positions_m.size();
  std::vector<double> neighbours(count, 1);
  const double length_m = input_.correlation_length_m;
  if (!(length_m > 0)) return neighbours;
  const auto counts = [&](uint32_t t) { return input_.used.empty() || input_.used[t]; };
  const PointIndex<3> index({input_.positions_m.begin(), input_.positions_m.end()});
  for (uint32_t t = 0; t < count; ++t) {
    if (!counts(t) || SharesOf(t).empty()) continue;
    // Beyond three lengths less than 1.2 % of a target is left.
    for (const uint32_t other : index.Within(input_.positions_m[t], 3 * length_m)) {
      if (other == t || !counts(other) || SharesOf(other).empty()) continue;
      const double squared_m2 = (input_.positions_m[other] - input_.positions_m[t]).squaredNorm();
      neighbours[t] += std::exp(-0.5 * squared_m2 / (length_m * length_m));
    }
  }
  return neighbours;
}

void SharedErrors::Register() {
  frames_.assign(frame_count_, FrameRegistration{});
  if (input_.method == RegistrationMethod::kNone || frame_count_ == 0) return;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : input_.positions_m) box.extend(p.cast<double>());
  centre_m_ = box.center();
  radius_m_ = std::max(0.5 * box.diagonal().norm(), 1e-9);
  const auto unknowns = static_cast<Index>(6 * frame_count_);
  VectorXd prior_m(unknowns);  // standard deviations of the scaled poses
  for (Index f = 0; f < static_cast<Index>(frame_count_); ++f) {
    prior_m.segment<3>(6 * f).setConstant(input_.pose.angle_rad * radius_m_);
    prior_m.segment<3>(6 * f + 3).setConstant(input_.pose.position_m);
  }
  MatrixXd covariance = prior_m.cwiseAbs2().asDiagonal();
  if (UsesOverlap(input_.method)) {
    assert(input_.independent_m2.size() == input_.positions_m.size());
    const Index columns = static_cast<Index>(place_count_) * place_root_.cols() + lens_root_.cols();
    MatrixXd normal = MatrixXd::Zero(unknowns, unknowns);  // N
    MatrixXd pull = MatrixXd::Zero(unknowns, columns);     // B
    MatrixXd moved = MatrixXd::Zero(6, columns);           // sum l a' e of the calibration
    MatrixXd motion = MatrixXd::Zero(6, unknowns);         // sum l a'a of each frame
    const std::vector<double> neighbours = NeighbourCounts();
    struct InFrame {
      Index frame;
      double weight = 0;
      RowVectorXd calibration;
    };
    std::vector<InFrame> seen;
    for (uint32_t t = 0; t < input_.positions_m.size(); ++t) {
      if (!input_.used.empty() && !input_.used[t]) continue;
      const std::span<const Share> shares = SharesOf(t);
      if (shares.empty() || !(input_.independent_m2[t] > 0)) continue;
      seen.clear();
      for (const Share& share : shares) {
        const auto frame = static_cast<Index>(input_.scans[share.scan].frame);
        auto found = std::find_if(seen.begin(), seen.end(),
                                  [&](const InFrame& f) { return f.frame == frame; });
        if (found == seen.end()) {
          found = seen.insert(seen.end(), {frame, 0, RowVectorXd::Zero(columns)});
        }
        found->weight += share.weight;
        if (columns > 0) found->calibration += share.weight * PlaceRow(share);
      }
      for (InFrame& f : seen) f.calibration /= f.weight;
      const Row6 a = PoseRow(t);
      const Eigen::Matrix<double, 6, 6> outer = a.transpose() * a;
      const double information = 1 / (input_.independent_m2[t] * neighbours[t]);
      for (const InFrame& f : seen)
        motion.middleCols<6>(6 * f.frame) += information * f.weight * outer;
      RowVectorXd mean = RowVectorXd::Zero(columns);
      for (const InFrame& f : seen) mean += f.weight * f.calibration;
      moved += information * a.transpose() * mean;
      if (seen.size() == 1) continue;
      for (const InFrame& f : seen) {
        ++frames_[static_cast<size_t>(f.frame)].overlap_targets;
        for (const InFrame& other : seen) {
          const double m = (&f == &other ? f.weight : 0) - f.weight * other.weight;
          normal.block<6, 6>(6 * f.frame, 6 * other.frame) += information * m * outer;
        }
        pull.middleRows<6>(6 * f.frame) +=
            information * f.weight * a.transpose() * (f.calibration - mean);
      }
    }
    // C = S (1 + S N S)^-1 S with S = P^1/2 needs no inverse of a prior that may be zero.
    const MatrixXd scaled = prior_m.asDiagonal() * normal * prior_m.asDiagonal();
    const MatrixXd identity = MatrixXd::Identity(unknowns, unknowns);
    const MatrixXd posterior = prior_m.asDiagonal() *
                               MatrixXd((identity + scaled).llt().solve(identity)) *
                               prior_m.asDiagonal();
    // Takes off the common motion: the identity less (sum of the frames' K)^-1 K in every frame.
    MatrixXd total = MatrixXd::Zero(6, 6);
    for (Index f = 0; f < unknowns / 6; ++f) total += motion.middleCols<6>(6 * f);
    const Eigen::CompleteOrthogonalDecomposition<MatrixXd> fit(total);
    const MatrixXd common = fit.solve(motion);
    MatrixXd relative = identity;
    for (Index f = 0; f < unknowns / 6; ++f) relative.middleRows<6>(6 * f) -= common;
    covariance = relative * posterior * relative.transpose();
    if (columns > 0) {
      response_ = -relative * (posterior * pull);
      const MatrixXd of_calibration = fit.solve(moved);
      for (Index f = 0; f < unknowns / 6; ++f) response_.middleRows<6>(6 * f) -= of_calibration;
    }
  }
  pose_root_ = CovarianceRoot(covariance);

  for (uint32_t t = 0; t < input_.positions_m.size(); ++t) {
    const Row6 a = PoseRow(t);
    const FrameRegistration* last = nullptr;
    for (const Share& share : SharesOf(t)) {
      const size_t f = input_.scans[share.scan].frame;
      if (&frames_[f] == last) continue;  // scans of a frame follow one another
      last = &frames_[f];
      ++frames_[f].targets;
      const auto block =
          covariance.block<6, 6>(6 * static_cast<Index>(f), 6 * static_cast<Index>(f));
      frames_[f].standard_uncertainty_m += std::max(0.0, (a * block).dot(a));
    }
  }
  for (size_t f = 0; f < frame_count_; ++f) {
    FrameRegistration& frame = frames_[f];
    if (frame.targets > 0) {
      frame.standard_uncertainty_m =
          std::sqrt(frame.standard_uncertainty_m / static_cast<double>(frame.targets));
    }
    if (!UsesOverlap(input_.method)) continue;
    const auto first = 6 * static_cast<Index>(f);
    const VectorXd inverse =
        prior_m.segment<6>(first).unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(
        inverse.asDiagonal() * covariance.block<6, 6>(first, first) * inverse.asDiagonal(),
        Eigen::EigenvaluesOnly);
    frame.joined = frame_count_ == 1 || frame.overlap_targets > 0;
    frame.determined = frame.joined && eigen.eigenvalues().maxCoeff() <= 0.25;
  }
}

MatrixXd SharedErrors::CalibrationDeviations(std::span<const uint32_t> targets) const {
  MatrixXd deviations(static_cast<Index>(targets.size()),
                      static_cast<Index>(place_count_) * place_root_.cols() + lens_root_.cols());
  if (deviations.cols() == 0) return deviations;
  for (size_t i = 0; i < targets.size(); ++i) {
    deviations.row(static_cast<Index>(i)) = CalibrationRowOf(targets[i]);
  }
  return deviations;
}

MatrixXd SharedErrors::RegistrationDeviations(std::span<const uint32_t> targets) const {
  MatrixXd deviations(static_cast<Index>(targets.size()), pose_root_.cols());
  if (deviations.cols() == 0) return deviations;
  for (size_t i = 0; i < targets.size(); ++i) {
    deviations.row(static_cast<Index>(i)) = RegistrationRowOf(targets[i]);
  }
  return deviations;
}

bool SharedErrors::Evaluate(uint32_t target, AtTarget* result) const {
  if (SharesOf(target).empty()) return false;
  result->calibration_m = CalibrationRowOf(target).norm();
  result->registration_m = RegistrationRowOf(target).norm();
  return true;
}

}  // namespace sightline
