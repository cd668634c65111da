// SPDX-License-Identifier: Apache-2.0
// Constructors of the models of material.h, each from its own message.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/material/detailed_material.h"

namespace sightline {

std::shared_ptr<const Material> MakeLambert(DetailedMaterial::Common common, float albedo);

// rho/pi + D F G/(4 cos cos), F = F0 + (1 - F0)(1 - cos)^5. At grazing angles, where F tends to 1,
// the plain sum would reflect more than arrives. It is divided by max(1, A(out), A(in)) with its
// directional albedo A: reciprocal, and equal to the plain sum unless that creates energy.
std::shared_ptr<const Material> MakeLambertGgx(DetailedMaterial::Common common, float albedo,
                                               float specular_f0, float alpha);

struct RefractiveIndexTable {
  std::vector<double> wavelength_m;  // ascends; constant beyond the ends
  std::vector<double> n;
  std::vector<double> k;
};

// Rough metal: a white Lambert reflector covers the fraction `diffuse_share` (d) of the surface,
// facets cover the rest: (1 - d) D F G/(4 cos cos) + d/pi.
std::shared_ptr<const Material> MakeConductor(DetailedMaterial::Common common,
                                              const RefractiveIndexTable& index, float alpha_x,
                                              float alpha_y, float diffuse_share,
                                              double laser_wavelength_m);
// CSV "wavelength_nm,n,k".
absl::StatusOr<RefractiveIndexTable> ReadRefractiveIndex(const std::string& path,
                                                         const std::string& context);

// See measured_table.cpp and merl.cpp. INVALID_ARGUMENT names the file and the line.
absl::StatusOr<std::shared_ptr<const Material>> ReadMeasuredTable(
    DetailedMaterial::Common common, const std::string& path, std::optional<double> spot_diameter_m,
    const std::string& context);
absl::StatusOr<std::shared_ptr<const Material>> ReadMerl(DetailedMaterial::Common common,
                                                         const std::string& path,
                                                         double laser_wavelength_m,
                                                         const std::string& context);

}  // namespace sightline
