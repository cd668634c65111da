// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/rendered_line.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/acceptance/virtual_test.h"
#include "core/image/read_raw_image.h"
#include "core/laser_line/detect_laser_line.h"
#include "core/laser_line/ridge_score.h"
#include "core/random/seed.h"
#include "core/sensor/sensor.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"
#include "planner_client/acceptance/artefact_mesh.h"
#include "planner_client/acceptance/channel_planes.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kMeshFile[] = "artefact.stl";
constexpr int kMargin_px = 24;
// Widest crop around a plate, whose columns are all alike.
constexpr int kPlateColumns_px = 640;
// A detected point farther than this from the true line belongs to another line.
constexpr double kReach_px = 9;
constexpr double kWantedOfRange = 0.7;

// The rendered region around the middle of the image.
struct Crop {
  int columns_px = 0, rows_px = 0;
  int first_column = 0, first_row = 0;  // in the whole image
};

int EvenUp(double value) { return 2 * static_cast<int>(std::ceil(0.5 * value)); }

Crop CropOf(const Camera& camera, const Artefact& artefact, const ArtefactScan& scan) {
  double half_columns = 0, half_rows = 0;
  for (const ArtefactPoint& p : scan.points) {
    half_columns = std::max(half_columns, std::abs(p.column_px - 0.5 * camera.columns_px));
    half_rows = std::max(half_rows, std::abs(p.row_px - 0.5 * camera.rows_px));
  }
  if (artefact.kind == ArtefactKind::kPlate) {
    half_columns = std::min(half_columns, 0.5 * kPlateColumns_px - kMargin_px);
  }
  Crop crop;
  crop.columns_px = std::min(EvenUp(2 * (half_columns + kMargin_px)), camera.columns_px / 2 * 2);
  crop.rows_px = std::min(EvenUp(2 * (half_rows + kMargin_px)), camera.rows_px / 2 * 2);
  // The principal point is the middle of both.
  crop.first_column = (camera.columns_px - crop.columns_px) / 2;
  crop.first_row = (camera.rows_px - crop.rows_px) / 2;
  return crop;
}

// The request without frames.
v1::RenderSpec SpecOf(const ArtefactImaging& imaging, const Crop& crop) {
  v1::RenderSpec spec;
  v1::Inspection* sent = spec.mutable_part()->mutable_inspection();
  *sent = imaging.message;
  sent->mutable_part()->set_file(kMeshFile);
  sent->mutable_part()->set_unit("m");
  v1::Camera* camera = sent->mutable_camera();
  const double whole = std::tan(0.5 * imaging.inspection.rig.camera.vertical_fov_rad);
  const double half = std::atan(whole * crop.rows_px / imaging.inspection.rig.camera.rows_px);
  camera->set_columns_px(crop.columns_px);
  camera->set_rows_px(crop.rows_px);
  camera->set_vertical_fov_deg(2 * half * 180 / std::numbers::pi);
  return spec;
}

void AddFrame(const ArtefactImaging& imaging, const ArtefactMesh& mesh, double stage_m,
              double exposure_time_s, v1::RenderSpec* spec) {
  v1::PartFrame* frame = spec->mutable_part()->add_frames();
  // The renderer puts the middle of the mesh's box at the offsets.
  const Eigen::Vector3d middle_m = mesh.box_m.center();
  Measurement measurement = imaging.place;
  measurement.offset_y_m = middle_m.y();
  measurement.offset_z_m = middle_m.z();
  *frame->mutable_measurement() = MeasurementToProto(measurement);
  frame->set_stage_position_m(stage_m + middle_m.x());
  frame->set_scan(1);
  frame->set_frame(spec->part().frames_size() - 1);
  const Lens& lens = *imaging.inspection.rig.lens;
  v1::OpticalSetting* setting = frame->mutable_setting();
  setting->set_f_number(lens.f_number);
  setting->set_exposure_time_s(exposure_time_s);
  setting->set_focus_distance_m(lens.focus_distance_m.value_or(imaging.place.camera_distance_m));
  setting->set_laser_power_w(imaging.inspection.rig.laser.power_w);
  setting->set_sensor_tilt_x_deg(lens.sensor_tilt_x_rad * 180 / std::numbers::pi);
  setting->set_sensor_tilt_y_deg(lens.sensor_tilt_y_rad * 180 / std::numbers::pi);
}

// Images in the order of the frames.
absl::StatusOr<std::vector<Image<uint16_t>>> Images(const RenderClientOptions& client,
                                                    const ArtefactImaging& imaging,
                                                    const ArtefactMesh& mesh, v1::RenderSpec spec,
                                                    uint64_t seed) {
  spec.mutable_part()->mutable_inspection()->mutable_render()->set_seed(
      static_cast<int64_t>(seed >> 1));
  std::vector<AssetFile> assets = imaging.assets;
  assets.push_back({kMeshFile, mesh.stl});
  SIGHTLINE_ASSIGN_OR_RETURN(std::vector<std::string> names,
                             RenderToFolder(client, std::move(spec), assets, imaging.folder));
  std::sort(names.begin(), names.end());
  std::vector<Image<uint16_t>> images;
  for (const std::string& name : names) {
    const fs::path path = fs::path(imaging.folder) / name;
    if (path.extension() == ".png") {
      SIGHTLINE_ASSIGN_OR_RETURN(auto image, ReadRawImage(path.string()));
      images.push_back(std::move(image));
    }
    std::error_code ignored;
    fs::remove(path, ignored);
  }
  return images;
}

std::vector<ChannelPlane> PlanesOf(const Inspection& inspection, const Crop& crop) {
  const Sensor& sensor = *inspection.sensor;
  const int channel = inspection.optics->detector.channel.value_or(
      MostSensitiveChannel(sensor, inspection.rig.laser.wavelength_m));
  return PlanesOfChannel(sensor, channel, crop.columns_px, crop.rows_px);
}

Image<float> ValuesOf(const Image<uint16_t>& raw, const ChannelPlane& plane) {
  Image<float> values((raw.columns_px - plane.first_column + plane.step - 1) / plane.step,
                      (raw.rows_px - plane.first_row + plane.step - 1) / plane.step);
  for (int r = 0; r < values.rows_px; ++r) {
    for (int c = 0; c < values.columns_px; ++c) {
      values.At(r, c) =
          raw.At(plane.first_row + plane.step * r, plane.first_column + plane.step * c);
    }
  }
  return values;
}

double SaturationOf(const Sensor& sensor) {
  return std::min(sensor.largest_dn(),
                  std::floor(sensor.gain_dn_per_electron * sensor.saturation_capacity_electrons +
                             sensor.black_level_dn));
}

LaserLineOptions DetectionOf(const Inspection& inspection, double ridge_sigma_px) {
  const Sensor& sensor = *inspection.sensor;
  const LineDetector& detector = inspection.optics->detector;
  LaserLineOptions options;
  options.ridge_sigma_px = detector.ridge_sigma_px.value_or(std::clamp(ridge_sigma_px, 0.7, 20.0));
  // As in the choice of the optics: six standard deviations of the response to dark noise.
  const double noise_dn =
      std::hypot(sensor.gain_dn_per_electron * sensor.dark_noise_electrons, std::sqrt(1 / 12.0));
  options.min_ridge_score_dn =
      detector.min_ridge_score_dn.value_or(6 * noise_dn * RidgeNoise(options.ridge_sigma_px));
  options.saturation_dn = SaturationOf(sensor);
  options.background_dn = std::numeric_limits<double>::quiet_NaN();
  return options;
}

// Detects the line of one plane, in pixels of the crop. A first detection measures the width of the
// line, which sets the scale of the ridge filter.
absl::StatusOr<std::vector<LinePoint>> LineOf(const Image<uint16_t>& raw, const ChannelPlane& plane,
                                              const Inspection& inspection) {
  const Image<float> values = ValuesOf(raw, plane);
  const LaserLineMethod method = inspection.optics->detector.method;
  auto points = DetectLaserLine(values, DetectionOf(inspection, 1.5), method);
  if (!points.ok() || points->empty()) return points;
  if (!inspection.optics->detector.ridge_sigma_px) {
    std::vector<double> widths;
    for (const LinePoint& p : *points) widths.push_back(p.width_px);
    points = DetectLaserLine(values, DetectionOf(inspection, UpperMedian(widths)), method);
    if (!points.ok()) return points;
  }
  for (LinePoint& p : *points) {
    p.column_px = plane.first_column + plane.step * p.column_px;
    p.row_px = plane.first_row + plane.step * p.row_px;
  }
  return points;
}

// Frames of the scan, evenly spread.
std::vector<int> ChosenFrames(const ArtefactScan& scan, int most) {
  const auto count = static_cast<int>(scan.frames.size());
  const int chosen = std::min(most, count);
  std::vector<int> frames;
  for (int i = 0; i < chosen; ++i) {
    frames.push_back(static_cast<int>((i + 0.5) * count / chosen));
  }
  return frames;
}

// Points of the scan by frame.
std::map<int, std::vector<const ArtefactPoint*>> PointsOf(const ArtefactScan& scan,
                                                          const std::vector<int>& frames) {
  std::map<int, std::vector<const ArtefactPoint*>> points;
  for (const int frame : frames) points[frame];
  for (const ArtefactPoint& p : scan.points) {
    const auto found = points.find(p.frame);
    if (found != points.end()) found->second.push_back(&p);
  }
  return points;
}

// Deviations of the detected line in one image of a crop.
struct SeenLine {
  LineDeviations::Realisation line;
  int visible = 0, found = 0;  // points in columns of the laser's channel; those that are detected
};

absl::StatusOr<SeenLine> DeviationsOf(const Image<uint16_t>& image, const Crop& crop,
                                      const std::vector<ChannelPlane>& planes,
                                      const Inspection& inspection,
                                      const std::vector<const ArtefactPoint*>& truth) {
  std::map<int, double> rows_px;  // of detected points, in the whole image
  for (const ChannelPlane& plane : planes) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto points, LineOf(image, plane, inspection));
    for (const LinePoint& p : points) {
      rows_px[crop.first_column + p.column_px] = crop.first_row + p.row_px;
    }
  }
  SeenLine seen;
  seen.line.rows_px.assign(static_cast<size_t>(crop.columns_px),
                           std::numeric_limits<float>::quiet_NaN());
  for (const ArtefactPoint* p : truth) {
    const int column = p->column_px - crop.first_column;
    if (column < 0 || column >= crop.columns_px) continue;
    const bool of_channel = std::any_of(
        planes.begin(), planes.end(),
        [&](const ChannelPlane& plane) { return (column - plane.first_column) % plane.step == 0; });
    if (!of_channel) continue;
    ++seen.visible;
    const auto detected = rows_px.find(p->column_px);
    if (detected == rows_px.end()) continue;
    const double deviation_px = detected->second - p->row_px;
    if (!(std::abs(deviation_px) <= kReach_px)) continue;
    ++seen.found;
    seen.line.rows_px[static_cast<size_t>(column)] = static_cast<float>(deviation_px);
  }
  return seen;
}

}  // namespace

absl::StatusOr<double> ExposureOf(const RenderClientOptions& client, const ArtefactImaging& imaging,
                                  const Artefact& artefact, const ArtefactScan& scan) {
  const ArtefactMesh mesh = MeshOfArtefact(artefact);
  const Crop crop = CropOf(imaging.inspection.rig.camera, artefact, scan);
  v1::RenderSpec spec = SpecOf(imaging, crop);
  const double stage_m = scan.frames[scan.frames.size() / 2].stage_m;
  std::vector<double> times_s;
  for (double time_s = 1e-6; time_s <= 1; time_s *= 4) times_s.push_back(time_s);
  for (const double time_s : times_s) AddFrame(imaging, mesh, stage_m, time_s, &spec);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto images,
                             Images(client, imaging, mesh, std::move(spec), imaging.seed));
  const Sensor& sensor = *imaging.inspection.sensor;
  const double range_dn = SaturationOf(sensor) - sensor.black_level_dn;
  double best_s = 0;
  for (size_t i = 0; i < times_s.size(); ++i) {
    std::vector<double> peaks_dn;
    for (const ChannelPlane& plane : PlanesOf(imaging.inspection, crop)) {
      SIGHTLINE_ASSIGN_OR_RETURN(const auto points, LineOf(images[i], plane, imaging.inspection));
      for (const LinePoint& p : points) peaks_dn.push_back(p.peak_dn);
    }
    if (peaks_dn.size() < 16) continue;
    const double bright_dn = LowerQuantile(peaks_dn, 0.95);
    // The longest exposure without clipping is the most informative.
    if (bright_dn < 0.9 * range_dn) best_s = times_s[i] * kWantedOfRange * range_dn / bright_dn;
  }
  if (!(best_s > 0)) {
    return absl::FailedPreconditionError(
        "no exposure time from 1 us to 1 s shows an unclipped laser line on the sphere");
  }
  return best_s;
}

absl::StatusOr<RenderedLine> RenderLine(const RenderClientOptions& client,
                                        const ArtefactImaging& imaging, const Artefact& artefact,
                                        const ArtefactScan& scan, double exposure_time_s,
                                        int most_frames, int realisations) {
  const ArtefactMesh mesh = MeshOfArtefact(artefact);
  const Crop crop = CropOf(imaging.inspection.rig.camera, artefact, scan);
  const std::vector<int> chosen = ChosenFrames(scan, most_frames);
  const auto truth = PointsOf(scan, chosen);
  const ReferencePlace place = PlaceOfReference(scan, artefact.surfaces.front());
  v1::RenderSpec spec = SpecOf(imaging, crop);
  std::vector<LineDeviations::Frame> frames;
  for (const int frame : chosen) {
    const double stage_m = scan.frames[static_cast<size_t>(frame)].stage_m;
    AddFrame(imaging, mesh, stage_m, exposure_time_s, &spec);
    frames.push_back({stage_m - place.stage_m, crop.first_column - place.column_px, {}, {}});
  }

  RenderedLine line{LineDeviations({}, false), 0, {}, 0};
  const std::vector<ChannelPlane> planes = PlanesOf(imaging.inspection, crop);
  // Without speckle, the image equals the mean image except for a little sensor noise.
  v1::RenderSpec mean_spec = spec;
  mean_spec.mutable_part()->mutable_inspection()->mutable_render()->set_speckle(false);
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto mean_images,
      Images(client, imaging, mesh, std::move(mean_spec),
             DeriveSeed(DeriveSeed(imaging.seed, "mean image"), artefact.name.c_str())));
  for (size_t i = 0; i < chosen.size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto systematic,
        DeviationsOf(mean_images[i], crop, planes, imaging.inspection, truth.at(chosen[i])));
    frames[i].systematic = std::move(systematic.line);
    ++line.images;
  }
  double visible = 0, found = 0;
  for (int r = 0; r < realisations; ++r) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto images,
        Images(client, imaging, mesh, spec,
               DeriveSeed(imaging.seed, artefact.name.c_str(), static_cast<uint64_t>(r))));
    for (size_t i = 0; i < chosen.size(); ++i) {
      const std::vector<const ArtefactPoint*>& points = truth.at(chosen[i]);
      SIGHTLINE_ASSIGN_OR_RETURN(auto seen,
                                 DeviationsOf(images[i], crop, planes, imaging.inspection, points));
      ++line.images;
      visible += seen.visible;
      found += seen.found;
      for (const ArtefactPoint* p : points) {
        const int column = p->column_px - crop.first_column;
        if (column < 0 || column >= crop.columns_px) continue;
        const auto index = static_cast<size_t>(column);
        const double deviation_px = seen.line.rows_px[index];
        const double systematic_px = frames[i].systematic.rows_px[index];
        if (!std::isfinite(deviation_px) || !std::isfinite(systematic_px)) continue;
        line.samples.push_back({p->incidence_rad, systematic_px, deviation_px - systematic_px});
      }
      frames[i].realisations.push_back(std::move(seen.line));
    }
  }
  line.found_fraction = visible > 0 ? found / visible : 0;
  line.deviations = LineDeviations(std::move(frames), artefact.kind == ArtefactKind::kPlate);
  return line;
}

}  // namespace sightline
