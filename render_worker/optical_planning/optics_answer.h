// SPDX-License-Identifier: Apache-2.0
// Converts chosen settings to messages.
#pragma once

#include <span>

#include "core/inspection/inspection.h"
#include "render_worker/optical_planning/choose_setting.h"
#include "render_worker/optical_planning/detection_noise.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// `height_per_px`: height [m] that corresponds to one pixel of u_px (HeightPerPixel);
// `scan_time_s`: 0 if unknown.
v1::OpticsPoint PointToProto(const JudgedSetting& judged, const JudgedSetting& best,
                             double height_per_px, double scan_time_s);

// Height along the laser's direction that corresponds to a displacement of one pixel: p d / (b sin
// theta), with theta between the directions of camera and laser (cf. thesis eq. 5.9, where the
// surface is perpendicular to the camera and the tangent replaces the sine).
double HeightPerPixel(const FrameSetup& frame, double line_depth_m);

// The choice with its curve, alternatives and statement. The caller fills in frames and numbers of
// the scan.
v1::OpticsChoice ChoiceToProto(const SettingChoice& choice, const Inspection& inspection,
                               const SettingGroup& group, double height_per_px);

v1::LearnedDetection DetectionToProto(const DetectionNoise& noise,
                                      std::span<const DetectedBlock> blocks, int frames);

}  // namespace sightline
