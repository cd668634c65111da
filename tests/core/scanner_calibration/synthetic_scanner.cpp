// SPDX-License-Identifier: Apache-2.0
#include "tests/core/scanner_calibration/synthetic_scanner.h"

#include <limits>
#include <random>

namespace sightline {
namespace {

constexpr int kSamples = 60;

// The laser line on the target: samples between the board's lower and upper edge.
LineInFrame LineOnTarget(const SyntheticScanner& scanner, const Eigen::Isometry3d& motion,
                         const SyntheticErrors& errors, std::mt19937* random) {
  std::normal_distribution<double> normal;
  const TargetCamera camera = CameraOf(scanner.shared);
  const Eigen::Vector3d plane = scanner.shared.segment<3>(kPlaneX);
  // The point x of the target with plane . (motion x) = 1, for given y.
  const Eigen::Vector3d a = motion.linear().transpose() * plane;
  const double b = plane.dot(motion.translation());
  const auto image_of = [&](double y) {
    return camera.Project(motion * Eigen::Vector3d((1 - b - a.y() * y) / a.x(), y, 0));
  };
  LineInFrame line;
  const double half = 0.5 * scanner.board.inner_corners_y * scanner.board.square_m;
  const Eigen::Vector2d way = image_of(half) - image_of(-half);
  line.across = Eigen::Vector2d(-way.y(), way.x()).normalized();
  line.crossing_sd_px = line.sample_sd_px = errors.sample_px;
  const double shift = errors.line_shift_px * normal(*random);
  const double turn = errors.line_turn_px * normal(*random);
  for (int i = 0; i < kSamples; ++i) {
    const double at = 2.0 * (i + 0.5) / kSamples - 1;
    const Eigen::Vector2d image_px =
        image_of(half * at) +
        line.across * (shift + turn * at + errors.sample_px * normal(*random));
    line.samples.push_back({image_px, image_px.y()});
  }
  return line;
}

}  // namespace

SyntheticScanner MakeSyntheticScanner(int frames, const SyntheticErrors& errors, uint32_t seed) {
  SyntheticScanner scanner;
  scanner.shared = Eigen::VectorXd::Zero(kSharedParameters);
  scanner.shared.head<7>() << 1370, 1372, 630, 500, -0.05, 0.08, 0.001;
  const double angle = 37 * 3.14159265358979 / 180;
  const Eigen::Vector3d normal_of_plane(std::cos(angle), 0.03, std::sin(angle));
  scanner.shared.segment<3>(kPlaneX) = normal_of_plane / (0.3 * normal_of_plane.z());

  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  const TargetCamera camera = CameraOf(scanner.shared);
  for (int k = 0; k < frames; ++k) {
    CalibrationFrame frame;
    frame.name = "frame" + std::to_string(k + 1);
    Eigen::VectorXd pose(6);
    pose << 0.45 * uniform(random), 0.45 * uniform(random), 0.3 * uniform(random),
        0.012 * uniform(random), 0.012 * uniform(random), 0.3 + 0.03 * uniform(random);
    const Eigen::Isometry3d motion = MotionOf(pose);
    const double bend = errors.bend_m * normal(random);
    const double far = scanner.board.Corner(0).squaredNorm();
    for (int i = 0; i < scanner.board.corner_count(); ++i) {
      const Eigen::Vector2d at = scanner.board.Corner(i);
      const double height = bend * at.squaredNorm() / far + errors.twist_per_m * at.x() * at.y();
      const Eigen::Vector3d on_board(at.x(), at.y(), height);
      frame.corners_px.push_back(camera.Project(motion * on_board) +
                                 errors.corner_px *
                                     Eigen::Vector2d(normal(random), normal(random)));
    }
    frame.line = LineOnTarget(scanner, motion, errors, &random);
    scanner.poses.push_back(pose);
    frame.pose = pose;
    frame.pose.array() += 1e-3;
    scanner.frames.push_back(std::move(frame));
  }
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  scanner.open.camera = {.fx = 1350, .fy = 1350, .cx = 640, .cy = 512, .distortion = {}};
  scanner.open.standard_deviation = {kOpen, kOpen, kOpen, kOpen, 1, 1, 1, 1, 0};
  return scanner;
}

}  // namespace sightline
