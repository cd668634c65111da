// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/diagnosis/posed/posed_set.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/recordings/expected_line.h"
#include "core/recordings/reduction/reduce_posed_plates.h"
#include "core/recordings/reduction/start_from_images.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline {
namespace {

constexpr double kFocus_m = 0.3;

double ImageDistance(const RecordingSet& set) {
  return 1 / (1 / set.focal_length_m - 1 / kFocus_m);
}

PosedPlates PosedRig(const RecordingSet& set, bool along_columns) {
  PosedPlates posed;
  const double focal_px = ImageDistance(set) / set.camera.pixel_pitch_m;
  posed.camera = {.fx = focal_px,
                  .fy = focal_px,
                  .cx = set.camera.columns_px / 2 + 7.3,
                  .cy = set.camera.rows_px / 2 - 4.6,
                  .distortion = {-0.08, 0.1, 4e-4, -3e-4, 0}};
  const Eigen::Vector3d middle(0, 0, kFocus_m);
  constexpr double kTriangulation_rad = 0.6;
  Eigen::Vector3d origin = middle + 0.35 * Eigen::Vector3d(0, std::sin(kTriangulation_rad),
                                                           -std::cos(kTriangulation_rad));
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX().cross(origin - middle).normalized();
  if (along_columns) {
    const Eigen::AngleAxisd turn(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
    origin = turn * origin;
    normal = turn * normal;
  }
  posed.sheet = {normal, normal.dot(middle), origin};
  return posed;
}

}  // namespace

RecordingSet PosedSet(const PosedSetOptions& options) {
  RecordingSet set;
  set.format_version = 3;
  set.name = "posed";
  set.camera.columns_px = 640;
  set.camera.rows_px = 480;
  if (options.along_columns) std::swap(set.camera.columns_px, set.camera.rows_px);
  set.camera.pixel_pitch_m = 5.3e-6;
  set.camera.bit_depth_bit = 8;
  set.camera.gain_dn_per_electron = 0.0255;
  set.camera.saturation_capacity_electrons = 10000;
  set.camera.dark_mean_electrons = 150;
  set.camera.dark_noise_electrons = 25;
  set.camera.quantum_efficiency[0] = {{661e-9}, {0.5}};
  set.focal_length_m = 0.016;
  set.transmission = 0.9;
  set.laser.wavelength_m = 661e-9;
  set.laser.power_w = 1e-3;
  set.laser.divergence_rad = 1e-3;
  set.laser.beam_focus_distance_m = 0.2;
  set.laser.fan_angle_rad = 0.6;
  set.surface = {0.5, 0.04, 0.5};
  set.posed = PosedRig(set, options.along_columns);
  set.uncertainty.focus_distance_relative = 0.01;
  set.uncertainty.f_number_relative = 0.02;
  set.uncertainty.beam_focus_distance_m = 0.005;
  set.uncertainty.divergence_relative = 0.03;
  set.uncertainty.power_relative = 0.05;
  set.uncertainty.gain_relative = 0.01;
  set.uncertainty.dark_mean_electrons = 3;
  set.uncertainty.dark_noise_relative = 0.03;
  set.uncertainty.line_position_each_px = 0.5;
  const auto add = [&](RecordingKind kind) {
    RecordedImage image;
    image.file = absl::StrFormat("images/%03d.png", set.recordings.size());
    image.kind = kind;
    image.timestamp_s = static_cast<double>(set.recordings.size());
    image.repeat_group = static_cast<int>(set.recordings.size());
    image.exposure_time_s = 1e-3;
    image.f_number = 8;
    image.focus_distance_m = kFocus_m;
    image.roi_column_px = -(set.camera.columns_px / 2);
    image.roi_row_px = -(set.camera.rows_px / 2);
    image.roi_columns_px = set.camera.columns_px;
    image.roi_rows_px = set.camera.rows_px;
    set.recordings.push_back(image);
    return &set.recordings.back();
  };
  for (int k = 0; k < options.poses; ++k) {
    RecordedImage& image = *add(RecordingKind::kLaser);
    image.plate_position_id = k + 1;
    // Tilts and distances that do not go together.
    const double phase = 2 * std::numbers::pi * k / options.poses;
    const double about_line = 20 * std::cos(phase) * std::numbers::pi / 180;
    const double along_line = 12 * std::sin(3 * phase + 0.5) * std::numbers::pi / 180;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const bool turned = options.along_columns;
    pose.linear() =
        (Eigen::AngleAxisd(turned ? std::numbers::pi / 2 : 0, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(about_line, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(along_line, Eigen::Vector3d::UnitY()))
            .toRotationMatrix();
    pose.translation() = Eigen::Vector3d(0, 0, kFocus_m + 0.015 * std::sin(2 * phase + 1));
    image.plate_in_camera = pose;
  }
  if (options.dark_frames) {
    add(RecordingKind::kDark);
    add(RecordingKind::kDark);
  }
  const auto reduced = ReducePosedPlates(set, {});
  if (!reduced.ok()) std::abort();
  double brightest_dn = 0;
  for (const RecordedImage& image : reduced->set.recordings) {
    if (image.kind != RecordingKind::kLaser) continue;
    brightest_dn = std::max(brightest_dn, ExpectLine(reduced->set, image).CrestDn(set.camera, 0));
  }
  const double factor = options.crest_share * set.camera.largest_dn() / brightest_dn;
  for (RecordedImage& image : set.recordings) image.exposure_time_s *= factor;
  return set;
}

std::vector<Image<uint16_t>> RenderPosedSet(const RecordingSet& set,
                                            const std::vector<ActiveEffect>& effects,
                                            uint64_t seed) {
  std::vector<Image<uint16_t>> images;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    const auto index = static_cast<int>(i);
    auto image = RenderPlateFrame(PlateFrame(set, index, {{}, seed}), effects, nullptr, 2,
                                  PlateOf(set, index));
    if (!image.ok()) std::abort();
    images.push_back(std::move(image->raw_dn));
  }
  return images;
}

Image<double> MeanElectronsOf(const RecordingSet& set, int index) {
  PlateFrameOptions options;
  options.speckle = false;
  auto image =
      RenderPlateFrame(PlateFrame(set, index, options), {}, nullptr, 2, PlateOf(set, index));
  if (!image.ok()) std::abort();
  return std::move(image->mean_photo_electrons);
}

RecordedSet ReducedPosedSet(const RecordingSet& set, const std::vector<ActiveEffect>& effects,
                            uint64_t seed) {
  auto reduced = ReducePosedPlates(set, RenderPosedSet(set, effects, seed));
  if (!reduced.ok()) std::abort();
  StartFromImages(reduced->raw_dn, &reduced->set);
  return MakeRecordedSet(std::move(reduced->set), std::move(reduced->raw_dn));
}

}  // namespace sightline
