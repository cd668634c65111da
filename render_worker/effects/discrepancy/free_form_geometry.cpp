// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of the geometry: where camera, projector and line are, how the sensor
// lies to them. The scale of the image belongs to the lens.
#include <algorithm>
#include <array>
#include <cmath>

#include "render_worker/effects/discrepancy/free_form_effect.h"

namespace sightline {
namespace {

// The stated distances and angles of the rig may be off by more than their uncertainties.
class SetupTerm final : public FreeFormEffect {
 public:
  SetupTerm()
      : FreeFormEffect("geometry",
                       {.id = "unknown.setup",
                        .stage = Stage::kGeometry,
                        .summary = "camera and projector farther from the plate by a and b, sheet "
                                   "more inclined by c",
                        .reference = "thesis eq. 1.1-1.5 (triangulation)",
                        .parameters = {Coefficient("camera_distance_m", 0.1, 5e-3),
                                       Coefficient("laser_distance_m", 0.1, 1e-2),
                                       Coefficient("incidence_angle_rad", 0.35, 0.03)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    PlateGeometry& plate = frame.plate;
    plate.camera_distance_m =
        std::max(0.1 * plate.camera_distance_m, plate.camera_distance_m + p[0]);
    plate.laser_distance_m = std::max(0.1 * plate.laser_distance_m, plate.laser_distance_m + p[1]);
    plate.incidence_angle_rad += p[2];
  }
};

class LinePlaceTerm final : public FreeFormEffect {
 public:
  LinePlaceTerm()
      : FreeFormEffect(
            "geometry",
            {.id = "unknown.line_place",
             .stage = Stage::kGeometry,
             .summary = "line on the plate shifted by a X + b X^2 + c X^3 + d time + e "
                        "(laser distance - 0.4 m) + f X (camera distance - 0.4 m)",
             .reference = "thesis eq. 1.1-1.5 (triangulation)",
             .parameters = {Coefficient("slope", 0.5, 0.01), Coefficient("square_per_m", 10, 0.1),
                            Coefficient("cube_per_m2", 100, 1),
                            Coefficient("drift_m_per_s", 1e-5, 1e-7),
                            Coefficient("with_laser_distance", 0.1, 2e-3),
                            Coefficient("slope_with_camera_distance_per_m", 5, 0.1)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;
    const double shift = p[3] * frame.timestamp_s + p[4] * (frame.plate.laser_distance_m - 0.4);
    // A guideway that rolls turns the camera, and so the line's slope, with the distance (ISO
    // 230-1).
    const std::array<double, 3> c = {p[0] + p[5] * (frame.plate.camera_distance_m - 0.4), p[1],
                                     p[2]};
    if (!IsNull(c)) scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      return before(x_m, s_m - shift - x_m * (c[0] + x_m * (c[1] + x_m * c[2])));
    };
  }

  Axes CurveAxes() const override {
    return {"place_along_line_m", "shift_of_line_m", EvenlySpaced(-0.12, 0.12, 49)};
  }
  double CurveAt(double x_m, Parameters p) const override {
    return x_m * (p[0] + x_m * (p[1] + x_m * p[2]));
  }
};

class KeystoneTerm final : public FreeFormEffect {
 public:
  KeystoneTerm()
      : FreeFormEffect("geometry",
                       {.id = "unknown.keystone",
                        .stage = Stage::kGeometry,
                        .summary = "place on the sensor times 1 + a u + b v, in 5 mm",
                        .reference = "Hartley and Zisserman, Multiple View Geometry, 2nd ed., "
                                     "section 2.3 (projective transformations)",
                        .parameters = {Coefficient("keystone_u", 0.5, 0.02),
                                       Coefficient("keystone_v", 0.5, 0.02)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;  // an empty mapping stays empty
    const std::array<double, 2> c = {p[0], p[1]};
    scene.image_mapping = [c, before = std::move(scene.image_mapping)](SensorPoint point) {
      if (before) point = before(point);
      const double u = point.u_m / kImageHeight_m, v = point.v_m / kImageHeight_m;
      // The sensor point of a larger image looks nearer to the axis.
      const double factor = 1 / (1 + c[0] * u + c[1] * v);
      return SensorPoint{factor * point.u_m, factor * point.v_m};
    };
  }
};

// A plane sensor or a plate that is tilted. A curved field belongs to the lens
// (`unknown.focus_curvature`).
class FocusFieldTerm final : public FreeFormEffect {
 public:
  FocusFieldTerm()
      : FreeFormEffect("geometry",
                       {.id = "unknown.focus_field",
                        .stage = Stage::kGeometry,
                        .summary = "defocus changed by a u + b v over 5 mm",
                        .reference = "Scheimpflug, GB patent 1196 (1904); thesis eq. 5.6",
                        .parameters = {Coefficient("slope_u_per_m", 10, 0.2),
                                       Coefficient("slope_v_per_m", 10, 0.2)}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;  // the field stays the same everywhere
    const std::array<double, 2> c = {p[0], p[1]};
    optics.field_dependent = true;
    optics.curvature = [c, before = std::move(optics.curvature)](double depth_m, double u_m,
                                                                 double v_m) {
      const double u = u_m / kImageHeight_m, v = v_m / kImageHeight_m;
      return before(depth_m, u_m, v_m) + c[0] * u + c[1] * v;
    };
  }

  Axes CurveAxes() const override {
    return {"u_m", "change_of_wavefront_curvature_per_m", EvenlySpaced(-6e-3, 6e-3, 25)};
  }
  double CurveAt(double u_m, Parameters p) const override { return p[0] * u_m / kImageHeight_m; }
};

}  // namespace

std::vector<const FreeFormEffect*> GeometryTerms() {
  static const SetupTerm setup;
  static const LinePlaceTerm line_place;
  static const KeystoneTerm keystone;
  static const FocusFieldTerm focus_field;
  return {&setup, &line_place, &keystone, &focus_field};
}

}  // namespace sightline
