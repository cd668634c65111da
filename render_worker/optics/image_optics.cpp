// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/image_optics.h"

#include "render_worker/optics/incoherent_imaging.h"
#include "render_worker/optics/laser_imaging.h"

namespace sightline {

PixelIrradiance ApplyOptics(const IdealImage& image, const OpticsModel& optics,
                            const SpeckleModel& speckle, int threads) {
  PixelIrradiance light;
  light.roi = image.grid.roi;
  light.laser_irradiance_w_m2 = image.laser_irradiance_w_m2.empty()
                                    ? Image<float>(light.roi.columns_px, light.roi.rows_px)
                                    : ImageLaser(image, optics, speckle, threads);
  for (size_t channel = 0; channel < image.incoherent_electron_flux_m2_s.size(); ++channel) {
    const Image<float>& flux = image.incoherent_electron_flux_m2_s[channel];
    if (flux.empty()) continue;
    light.incoherent_electron_flux_m2_s[channel] = ImageIncoherent(
        flux, image.incoherent_grid, image.incoherent_wavelength_m[channel], optics, threads);
  }
  return light;
}

}  // namespace sightline
