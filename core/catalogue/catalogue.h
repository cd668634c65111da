// SPDX-License-Identifier: Apache-2.0
// Catalogue of cameras, lenses and lasers: numbers of their data sheets, in a folder of files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/rig/rig.h"
#include "core/sensor/sensor.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/sensor.pb.h"

namespace sightline {

struct DeviceCamera {
  Sensor sensor;
  std::string mount;
  std::optional<double> max_frame_rate_hz;  // of the whole sensor
  std::optional<double> price_eur;
  std::string file;
  v1::Sensor message;
};

struct DeviceLens {
  std::string name;
  std::string mount;
  // The lens at its widest aperture, focus distance unset. Its min_focus_distance_m is the value
  // below. Data sheets count that from the front of the lens, a thin lens from its centre, so it is
  // off by the few centimetres between the two.
  Lens lens;
  double min_f_number = 0, max_f_number = 0;
  std::optional<double> min_focus_distance_m;
  std::optional<double> image_circle_m;  // diameter
  std::optional<double> price_eur;
  std::string file;
  v1::CatalogueLens message;
};

struct DeviceLaser {
  std::string name;
  Laser laser;
  std::string safety_class;  // of IEC 60825-1; empty: not known
  std::optional<double> price_eur;
  std::string file;
  v1::CatalogueLaser message;
};

// Camera and laser in one housing. Distances are from the front of the housing along the laser.
struct DeviceProfileSensor {
  std::string name;
  double near_distance_m = 0, far_distance_m = 0;
  double near_width_m = 0, far_width_m = 0;  // of the laser line that is measured there
  int points_per_profile = 0;
  std::optional<double> wavelength_m;
  std::optional<double> triangulation_angle_rad;  // in the middle of the range
  std::string safety_class;
  std::optional<double> price_eur;
  std::string file;
  v1::CatalogueProfileSensor message;

  double MiddleDistance() const { return 0.5 * (near_distance_m + far_distance_m); }
  double MiddleWidth() const { return 0.5 * (near_width_m + far_width_m); }
};

// Devices by kind, in the order of their file names, so that results do not depend on the file
// system. Names are unique within a kind. Only profile_sensors may be empty.
struct Catalogue {
  std::vector<DeviceCamera> cameras;
  std::vector<DeviceLens> lenses;
  std::vector<DeviceLaser> lasers;
  std::vector<DeviceProfileSensor> profile_sensors;
};

// The mounts that a camera or a lens can name.
const std::vector<std::string>& KnownMounts();

// Reads cameras/*.json (v1.Sensor), lenses/*.json (v1.CatalogueLens), lasers/*.json
// (v1.CatalogueLaser) and profile_sensors/*.json (v1.CatalogueProfileSensor) of a folder. Other
// files, hidden files and folders below are passed over. NOT_FOUND: no such folder.
// INVALID_ARGUMENT names file, field, value and allowed range. It also stands for two devices of
// one kind and name, for a kind with more than 1000 files, and for cameras, lenses or lasers
// without any.
absl::StatusOr<Catalogue> ReadCatalogue(const std::string& folder);

}  // namespace sightline
