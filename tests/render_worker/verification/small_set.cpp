// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/verification/small_set.h"

#include <cstdlib>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/recordings/expected_line.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline {

RecordingSet SmallSet(ColourFilter filter) {
  RecordingSet set;
  set.name = "small";
  const bool mono = filter == ColourFilter::kMono;
  set.camera.colour_filter = filter;
  set.camera.pixel_pitch_m = mono ? 5.3e-6 : 5.86e-6;
  set.camera.columns_px = 1280;
  set.camera.rows_px = 1024;
  set.camera.bit_depth_bit = 10;
  set.camera.gain_dn_per_electron = mono ? 0.16 : 0.53;
  set.camera.saturation_capacity_electrons = mono ? 9893 : 33456;
  set.camera.dark_mean_electrons = mono ? 27.57 : 15.06;
  set.camera.dark_noise_electrons = mono ? 6.5 : 3.5;
  if (mono) {
    set.camera.quantum_efficiency[0] = {{661e-9}, {0.53}};
  } else {
    set.camera.quantum_efficiency[kRed] = {{661e-9}, {0.48}};
    set.camera.quantum_efficiency[kGreen] = {{661e-9}, {0.09}};
    set.camera.quantum_efficiency[kBlue] = {{661e-9}, {0.03}};
  }
  set.focal_length_m = 0.016;
  set.transmission = 0.9;
  set.laser.power_w = 0.0006;
  set.laser.divergence_rad = 1e-3;
  set.laser.beam_focus_distance_m = 0.44;
  set.laser.fan_angle_rad = 0.65;
  set.surface = {0.35, 0.6, 0.4};
  set.incidence_angle_rad = 0.7853981633974483;

  double time_s = 10;
  int position = 0;
  const auto add = [&](const char* series, double f_number, double crest_share) {
    RecordedImage image;
    image.file = absl::StrFormat("images/%03d.png", set.recordings.size());
    image.timestamp_s = time_s += 20;
    image.series = series;
    image.plate_position_id = ++position;
    image.f_number = f_number;
    image.camera_distance_m = image.focus_distance_m = 0.33;
    image.laser_distance_m = 0.4;
    image.roi_column_px = -64;
    image.roi_row_px = -48;
    image.roi_columns_px = 128;
    image.roi_rows_px = 96;
    image.repeat_group = static_cast<int>(set.recordings.size());
    image.exposure_time_s = 1;
    image.exposure_time_s = crest_share * set.camera.largest_dn() /
                            ExpectLine(set, image).CrestDn(set.camera, mono ? 0 : kRed);
    set.recordings.push_back(image);
    return static_cast<int>(set.recordings.size()) - 1;
  };
  const auto dark = [&](double exposure_s) {
    RecordedImage& image = set.recordings[add("dark", 8, 0.5)];
    image.kind = RecordingKind::kDark;
    image.plate_position_id.reset();
    --position;
    image.exposure_time_s = exposure_s;
  };
  const auto burst = [&](const char* series, double f_number, std::vector<double> shares) {
    for (size_t k = 0; k < shares.size(); ++k) {
      RecordedImage& image = set.recordings[add(series, f_number, shares[k])];
      if (k == 0) continue;
      image.plate_position_id = --position;
      image.same_speckle = true;
      image.burst_frame_index = static_cast<int>(k);
      image.timestamp_s = time_s -= 19.8;
    }
  };
  add("aperture", 5.6, 0.3);
  dark(0.002);
  burst("exposure", 8, {0.03, 0.1, 0.4, 1.5});
  add("aperture", 16, 0.3);
  dark(0.02);
  burst("noise", 8, {0.5, 0.5});
  set.recordings[add("distance", 5.6, 0.3)].camera_distance_m = 0.36;
  add("aperture", 8, 0.3);
  dark(0.1);
  return set;
}

std::vector<Image<uint16_t>> RenderSet(const RecordingSet& set, uint64_t seed,
                                       const std::vector<ActiveEffect>& effects,
                                       const SetupDeviation& deviation, bool speckle) {
  std::vector<Image<uint16_t>> images;
  Image<double> previous;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    PlateFrameOptions options;
    options.seed = seed;
    options.deviation = deviation;
    options.speckle = speckle;
    const FrameSetup frame = PlateFrame(set, static_cast<int>(i), options);
    auto image =
        RenderPlateFrame(frame, effects, frame.burst_frame_index > 0 ? &previous : nullptr, 1);
    if (!image.ok()) std::abort();
    previous = std::move(image->mean_photo_electrons);
    images.push_back(std::move(image->raw_dn));
  }
  return images;
}

}  // namespace sightline
