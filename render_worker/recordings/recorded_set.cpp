// SPDX-License-Identifier: Apache-2.0
#include "render_worker/recordings/recorded_set.h"

#include <algorithm>
#include <utility>

#include "render_worker/recordings/plate_frames.h"

namespace sightline {

const char* const kDeviationNames[kDeviations] = {
    "camera_distance_m",           "focus_distance_relative",
    "f_number_relative",           "laser_distance_m",
    "beam_focus_distance_m",       "incidence_angle_deg",
    "divergence_relative",         "power_relative",
    "transmission_relative",       "diffuse_albedo_relative",
    "specular_f0_relative",        "ggx_alpha_relative",
    "quantum_efficiency_relative", "gain_relative",
    "dark_mean_electrons",         "dark_noise_relative",
    "line_position_common_px"};

double& DeviationAt(SetupDeviation& d, int index) {
  double* const fields[kDeviations] = {&d.camera_distance_m,           &d.focus_distance_relative,
                                       &d.f_number_relative,           &d.laser_distance_m,
                                       &d.beam_focus_distance_m,       &d.incidence_angle_rad,
                                       &d.divergence_relative,         &d.power_relative,
                                       &d.transmission_relative,       &d.diffuse_albedo_relative,
                                       &d.specular_f0_relative,        &d.ggx_alpha_relative,
                                       &d.quantum_efficiency_relative, &d.gain_relative,
                                       &d.dark_mean_electrons,         &d.dark_noise_relative,
                                       &d.line_position_common_px};
  return *fields[index];
}

int PrecedingFrame(const RecordedSet& set, int f) {
  if (f < 1 || set.frames[f].nominal.burst_frame_index < 1) return -1;
  const FrameSetup& before = set.frames[f - 1].nominal;
  const FrameSetup& frame = set.frames[f].nominal;
  const bool follows = before.burst_frame_index + 1 == frame.burst_frame_index;
  const RegionOfInterest &a = before.roi, &b = frame.roi;
  const bool same_region = a.column_px == b.column_px && a.row_px == b.row_px &&
                           a.columns_px == b.columns_px && a.rows_px == b.rows_px;
  return follows && same_region ? f - 1 : -1;
}

RecordedSet MakeRecordedSet(RecordingSet description, std::vector<Image<uint16_t>> raw_dn) {
  RecordedSet set;
  set.description = std::move(description);
  for (size_t i = 0; i < set.description.recordings.size(); ++i) {
    const RecordedImage& image = set.description.recordings[i];
    RecordedFrame frame;
    frame.nominal = PlateFrame(set.description, static_cast<int>(i), {});
    frame.plate_position_id =
        image.kind == RecordingKind::kLaser ? image.plate_position_id.value_or(-1) : -1;
    frame.repeat_group = image.repeat_group;
    if (!raw_dn.empty()) frame.raw_dn = std::move(raw_dn[i]);
    set.frames.push_back(std::move(frame));
  }
  return set;
}

double PowerDeviation(const SetupDeviation& uncertainty, double power_relative) {
  constexpr double kNotStated = 1;
  if (uncertainty.power_relative < kNotStated || power_relative >= 0) return power_relative;
  return 1 / (1 - power_relative) - 1;
}

FrameSetup DeviatedFrame(const RecordedSet& set, int index, const SetupDeviation& deviation) {
  constexpr double kLeast = -0.9;
  SetupDeviation cut = deviation;
  cut.power_relative = PowerDeviation(set.description.uncertainty, cut.power_relative);
  for (double* relative :
       {&cut.focus_distance_relative, &cut.f_number_relative, &cut.divergence_relative,
        &cut.power_relative, &cut.transmission_relative, &cut.diffuse_albedo_relative,
        &cut.specular_f0_relative, &cut.ggx_alpha_relative, &cut.quantum_efficiency_relative,
        &cut.gain_relative, &cut.dark_noise_relative}) {
    *relative = std::max(kLeast, *relative);
  }
  const RecordedImage& image = set.description.recordings[index];
  cut.camera_distance_m = std::max(kLeast * image.camera_distance_m, cut.camera_distance_m);
  cut.laser_distance_m = std::max(kLeast * image.laser_distance_m, cut.laser_distance_m);
  cut.line_position_common_px += cut.line_position_each_px;
  cut.line_position_each_px = 0;
  return PlateFrame(set.description, index, {cut});
}

bool SameSpeckle(const RecordedFrame& a, const RecordedFrame& b) {
  const FrameSetup& p = a.nominal;
  const FrameSetup& q = b.nominal;
  return a.plate_position_id >= 0 && a.plate_position_id == b.plate_position_id &&
         p.lens.f_number == q.lens.f_number && p.lens.focus_distance_m == q.lens.focus_distance_m &&
         p.plate.camera_distance_m == q.plate.camera_distance_m &&
         p.plate.laser_distance_m == q.plate.laser_distance_m &&
         p.plate.line_offset_m == q.plate.line_offset_m && p.roi.column_px == q.roi.column_px &&
         p.roi.row_px == q.roi.row_px && p.roi.columns_px == q.roi.columns_px &&
         p.roi.rows_px == q.roi.rows_px;
}

}  // namespace sightline
