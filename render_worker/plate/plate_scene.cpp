// SPDX-License-Identifier: Apache-2.0
#include "render_worker/plate/plate_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "core/physics/constants.h"
#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

using std::numbers::pi;

// Photons per joule, lambda / (h c).
double PhotonsPerJoule(double wavelength_m) {
  return wavelength_m / (kPlanck_j_s * kSpeedOfLight_m_per_s);
}

// The point of the plate that a point of the sensor sees.
struct PlatePoint {
  double x_m, s_m, height_m;
};

// From sensor to plate.
class PlateView {
 public:
  PlateView(const PlateScene& scene, const FrameSetup& frame)
      : scene_(scene),
        image_distance_m_(frame.ImageDistance()),
        camera_distance_m_(frame.plate.camera_distance_m) {
    const double ratio = frame.PupilDiameter() / image_distance_m_;
    irradiance_per_radiance_sr_ = pi / 4 * frame.lens.transmission * ratio * ratio;
  }

  // pi/4 T (D/b)^2 cos^4(phi), tan(phi) = sqrt(u^2 + v^2)/b.
  double IrradiancePerRadiance(double u_m, double v_m) const {
    const double b = image_distance_m_;
    const double cos_squared = 1 / (1 + (u_m * u_m + v_m * v_m) / (b * b));
    return irradiance_per_radiance_sr_ * cos_squared * cos_squared;
  }

  PlatePoint At(double u_m, double v_m) const {
    SensorPoint point = {u_m, v_m};
    if (scene_.image_mapping) point = scene_.image_mapping(point);
    double height = 0;
    double per_magnification = camera_distance_m_ / image_distance_m_;
    if (scene_.height_m) {
      // The ray meets the surface where the height found is the height assumed; plates are flat
      // enough for this to converge at once.
      for (int i = 0; i < 4; ++i) {
        height = scene_.height_m(point.u_m * per_magnification, point.v_m * per_magnification);
        per_magnification = (camera_distance_m_ - height) / image_distance_m_;
      }
    }
    return {point.u_m * per_magnification, point.v_m * per_magnification, height};
  }

 private:
  const PlateScene& scene_;
  double image_distance_m_, camera_distance_m_, irradiance_per_radiance_sr_;
};

double Radiance(const PlateScene& scene, const PlatePoint& point) {
  const double irradiance = scene.laser_irradiance_w_m2(point.x_m, point.s_m);
  return irradiance > 0 ? irradiance * scene.brdf_per_sr(point.x_m, point.s_m) : 0;
}

void RenderAmbient(const PlateScene& scene, const FrameSetup& frame, const PlateView& view,
                   IdealImage& image) {
  // Ambient light is smooth over a pixel; a few pixels of margin keep the point spread's bulk.
  image.incoherent_grid = {frame.roi, 1, 8, frame.sensor.pixel_pitch_m};
  const SubPixelGrid& grid = image.incoherent_grid;
  Image<float>& light = image.incoherent_irradiance_w_m2;
  light = Image<float>(grid.columns(), grid.rows());
  for (int i = 0; i < grid.rows(); ++i) {
    for (int j = 0; j < grid.columns(); ++j) {
      const double u = grid.U(j), v = grid.V(i);
      const PlatePoint point = view.At(u, v);
      light.At(i, j) = static_cast<float>(view.IrradiancePerRadiance(u, v) *
                                          scene.ambient_radiance_w_m2_sr(point.x_m, point.s_m));
    }
  }
  for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
    const double electrons = frame.sensor.quantum_efficiency[channel].At(frame.laser.wavelength_m) *
                             PhotonsPerJoule(frame.laser.wavelength_m) *
                             scene.ambient_channel_factor[channel];
    image.incoherent_wavelength_m[channel] = frame.laser.wavelength_m;
    Image<float>& flux = image.incoherent_electron_flux_m2_s[channel];
    flux = light;
    for (float& value : flux.values) value = static_cast<float>(value * electrons);
  }
}

// Pixels of the grid with laser light at any corner. Lines are wider than a pixel, so the samples
// of all other pixels can be skipped.
Image<uint8_t> FindLitPixels(const PlateScene& scene, const PlateView& view,
                             const SubPixelGrid& grid, int threads) {
  constexpr double kDarkShare = 1e-12;
  const int columns = grid.roi.columns_px + 2 * grid.margin_px;
  const int rows = grid.roi.rows_px + 2 * grid.margin_px;
  Image<double> corner(columns + 1, rows + 1);
  std::vector<double> brightest(static_cast<size_t>(rows) + 1);
  ForIndexRanges(threads, rows + 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const double v = grid.V(i * grid.sub_pixels - 0.5);
      for (int j = 0; j <= columns; ++j) {
        const PlatePoint point = view.At(grid.U(j * grid.sub_pixels - 0.5), v);
        corner.At(i, j) = scene.laser_irradiance_w_m2(point.x_m, point.s_m);
        brightest[i] = std::max(brightest[i], corner.At(i, j));
      }
    }
  });
  const double dark = kDarkShare * *std::max_element(brightest.begin(), brightest.end());
  Image<uint8_t> lit(columns, rows);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      lit.At(i, j) = corner.At(i, j) > dark || corner.At(i, j + 1) > dark ||
                     corner.At(i + 1, j) > dark || corner.At(i + 1, j + 1) > dark;
    }
  }
  return lit;
}

}  // namespace

double BeamRadius(const Laser& laser, double distance_m) {
  const double waist = laser.beam_quality_m2 * laser.wavelength_m / (pi * laser.divergence_rad);
  return std::hypot(waist, laser.divergence_rad * (distance_m - laser.beam_focus_distance_m));
}

double PeakIrradiance(const Laser& laser, double distance_m) {
  const double length = 2 * distance_m * std::tan(laser.fan_angle_rad / 2);
  return 2 * laser.power_w / (std::sqrt(2 * pi) * BeamRadius(laser, distance_m) * length);
}

double PlateBrdf(const PlateSurface& surface, double incidence_angle_rad) {
  const double cosine = std::cos(incidence_angle_rad);
  const double half = std::cos(incidence_angle_rad / 2);
  const double tangent = std::tan(incidence_angle_rad);
  const double alpha2 = surface.ggx_alpha * surface.ggx_alpha;
  const double base = half * half * (alpha2 - 1) + 1;
  const double distribution = alpha2 / (pi * base * base);
  const double fresnel = surface.specular_f0 + (1 - surface.specular_f0) * std::pow(1 - half, 5);
  const double shadowing = 2 / (1 + std::sqrt(1 + alpha2 * tangent * tangent));
  return surface.diffuse_albedo / pi + distribution * fresnel * shadowing / (4 * cosine);
}

PlateScene MakePlateScene(const FrameSetup& frame) {
  const double cosine = std::cos(frame.plate.incidence_angle_rad);
  const double peak = PeakIrradiance(frame.laser, frame.plate.laser_distance_m) * cosine;
  const double radius = BeamRadius(frame.laser, frame.plate.laser_distance_m);
  const double offset = frame.plate.line_offset_m;
  const double brdf = PlateBrdf(frame.surface, frame.plate.incidence_angle_rad);
  PlateScene scene;
  scene.laser_irradiance_w_m2 = [=](double, double s_m) {
    const double x = (s_m - offset) * cosine / radius;
    // Beyond 18 radii nothing is left, and exp() is slow where it underflows.
    return x * x < 350 ? peak * std::exp(-2 * x * x) : 0.0;
  };
  scene.brdf_per_sr = [=](double, double) { return brdf; };
  return scene;
}

IdealImage RenderPlate(const PlateScene& scene, const FrameSetup& frame, const SubPixelGrid& grid,
                       int threads) {
  const PlateView view(scene, frame);
  IdealImage image;
  image.grid = grid;
  image.constant_depth_m = frame.plate.camera_distance_m;
  if (scene.ambient_radiance_w_m2_sr) RenderAmbient(scene, frame, view, image);
  image.laser_irradiance_w_m2 = Image<float>(grid.columns(), grid.rows());
  if (scene.constant_along_line && !scene.height_m && !scene.image_mapping) {
    ForIndexRanges(threads, grid.rows(), [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const double v = grid.V(i);
        const double radiance = Radiance(scene, view.At(0, v));
        if (!(radiance > 0)) continue;
        for (int j = 0; j < grid.columns(); ++j) {
          image.laser_irradiance_w_m2.At(i, j) =
              static_cast<float>(radiance * view.IrradiancePerRadiance(grid.U(j), v));
        }
      }
    });
    return image;
  }
  if (scene.height_m) {
    image.depth_m = Image<float>(grid.columns(), grid.rows(),
                                 static_cast<float>(frame.plate.camera_distance_m));
  }
  const Image<uint8_t> lit = FindLitPixels(scene, view, grid, threads);
  ForIndexRanges(threads, grid.rows(), [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const double v = grid.V(i);
      for (int j = 0; j < grid.columns(); ++j) {
        if (lit.At(i / grid.sub_pixels, j / grid.sub_pixels) == 0) continue;
        const double u = grid.U(j);
        const PlatePoint point = view.At(u, v);
        const double radiance = Radiance(scene, point);
        if (scene.height_m) {
          image.depth_m.At(i, j) =
              static_cast<float>(frame.plate.camera_distance_m - point.height_m);
        }
        if (radiance > 0) {
          image.laser_irradiance_w_m2.At(i, j) =
              static_cast<float>(radiance * view.IrradiancePerRadiance(u, v));
        }
      }
    }
  });
  return image;
}

}  // namespace sightline
