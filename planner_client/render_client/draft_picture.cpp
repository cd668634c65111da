// SPDX-License-Identifier: Apache-2.0
#include "planner_client/render_client/draft_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/process_folder/process_folder.h"
#include "core/sensor/sensor.h"
#include "core/status/status_macros.h"
#include "planner_client/render_client/render_client.h"
#include "report/raw_image/raw_png.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr int kMostReduction = 64;
constexpr uint64_t kMostPixels = uint64_t{1} << 24;  // of a draft, even if its header says more

// Reduced number of pixels of a row or column. It is a multiple of four: the principal point is
// then between two cells of a colour mosaic, as in the camera, and the picture begins with a whole
// cell.
int Divided(int pixels, int reduction) { return std::max(16, (pixels / reduction) & ~3); }

}  // namespace

v1::RenderSpec DraftOf(v1::RenderSpec spec, const DraftSettings& settings, int* reduction) {
  v1::PartRender& part = *spec.mutable_part();
  v1::Inspection& draft = *part.mutable_inspection();
  v1::Camera& camera = *draft.mutable_camera();
  v1::Sensor& sensor = *camera.mutable_sensor();
  const int columns = camera.has_columns_px() ? camera.columns_px() : sensor.sensor_columns_px();
  const int rows = camera.has_rows_px() ? camera.rows_px() : sensor.sensor_rows_px();
  int n = 1;
  while (n < kMostReduction && int64_t{columns / n} * (rows / n) > settings.max_pixels) ++n;
  *reduction = n;
  // The field of view stays: rows times pitch.
  sensor.set_sensor_columns_px(Divided(sensor.sensor_columns_px(), n));
  sensor.set_sensor_rows_px(Divided(sensor.sensor_rows_px(), n));
  sensor.set_pixel_pitch_m(n * sensor.pixel_pitch_m());
  if (camera.has_columns_px()) camera.set_columns_px(Divided(camera.columns_px(), n));
  if (camera.has_rows_px()) camera.set_rows_px(Divided(camera.rows_px(), n));
  camera.clear_pixel_pitch_m();
  camera.clear_vertical_fov_deg();
  const double area = static_cast<double>(n) * n;
  v1::RenderSettings& render = *draft.mutable_render();
  const double exposure_s = render.has_exposure_time_s() ? render.exposure_time_s() : 0.01;
  render.set_exposure_time_s(exposure_s / area);
  for (v1::PartFrame& drawn : *part.mutable_frames()) {
    if (!drawn.has_setting()) continue;
    drawn.mutable_setting()->set_exposure_time_s(drawn.setting().exposure_time_s() / area);
  }
  if (render.has_stage_speed_m_per_s()) {
    render.set_stage_speed_m_per_s(std::min(10.0, area * render.stage_speed_m_per_s()));
  }
  render.clear_sub_pixels();
  render.set_speckle(false);
  render.set_noise_target_relative(settings.noise_relative);
  render.set_max_samples_per_px(16);
  render.set_max_bounces(1);
  render.set_laser_interreflection(false);
  return spec;
}

v1::RenderSpec DraftSpec(const v1::Inspection& inspection, const v1::PartFrame& frame,
                         int64_t max_pixels, int* reduction) {
  v1::RenderSpec spec;
  *spec.mutable_part()->mutable_inspection() = inspection;
  *spec.mutable_part()->add_frames() = frame;
  spec.mutable_output()->set_image_format(v1::RenderOutput::IMAGE_FORMAT_PNG);
  return DraftOf(std::move(spec), {.max_pixels = max_pixels}, reduction);
}

absl::StatusOr<DraftPicture> PictureOfRaw(const std::string& file, int bit_depth_bit,
                                          double black_dn, bool bayer) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto read, ReadRawPng(file, kMostPixels));
  const RawPng& raw = read;
  const int columns = raw.columns_px, rows = raw.rows_px;
  if (columns < 2 || rows < 2) {
    return absl::InternalError(
        absl::StrCat(fs::path(file).filename().string(), ": the rendered image is too small"));
  }

  const double white_dn = static_cast<double>((1 << bit_depth_bit) - 1);
  const auto shown = [&](double dn) {
    const double signal = std::clamp((dn - black_dn) / (white_dn - black_dn), 0.0, 1.0);
    return static_cast<uint8_t>(std::lround(255 * std::pow(signal, 1 / 2.2)));
  };
  const auto at = [&](int row, int column) { return static_cast<double>(raw.At(row, column)); };
  DraftPicture picture;
  picture.columns_px = columns;
  picture.rows_px = rows;
  std::vector<uint8_t> values;
  values.reserve(raw.values_dn.size() * (bayer ? 3 : 1));
  int64_t clipped = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      clipped += at(row, column) >= white_dn ? 1 : 0;
      if (!bayer) {
        values.push_back(shown(at(row, column)));
        continue;
      }
      // The pixel's cell of red, two green, blue.
      const int top = std::min(row & ~1, rows - 2), left = std::min(column & ~1, columns - 2);
      values.push_back(shown(at(top, left)));
      values.push_back(shown(0.5 * (at(top, left + 1) + at(top + 1, left))));
      values.push_back(shown(at(top + 1, left + 1)));
    }
  }
  picture.clipped_fraction =
      static_cast<double>(clipped) / static_cast<double>(raw.values_dn.size());
  SIGHTLINE_ASSIGN_OR_RETURN(picture.png, EncodePng(values, columns, rows, bayer));
  return picture;
}

DrawDraft DrawWithWorker(v1::Inspection inspection, std::vector<AssetFile> assets,
                         ServerAccess worker) {
  struct Task {
    v1::Inspection inspection;
    std::vector<AssetFile> assets;
    ServerAccess worker;
  };
  auto task = std::make_shared<const Task>(
      Task{std::move(inspection), std::move(assets), std::move(worker)});
  return [task](const v1::PartFrame& frame,
                const std::atomic<bool>& cancelled) -> absl::StatusOr<DraftPicture> {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto sensor,
                               ParseSensor(task->inspection.camera().sensor(), "camera.sensor"));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto folder,
                               ProcessFolder::Make(TemporaryBase(), "sightline-draft"));
    RenderClientOptions client;
    static_cast<ServerAccess&>(client) = task->worker;
    client.interrupted = &cancelled;
    std::vector<std::string> warnings;
    client.on_warning = [&](const std::string& warning) { warnings.push_back(warning); };
    int reduction = 1;
    const v1::RenderSpec spec = DraftSpec(task->inspection, frame, kDraftPixels, &reduction);
    const auto files = RenderToFolder(client, spec, task->assets, folder.path());
    if (cancelled) return absl::CancelledError("another picture was asked for");
    if (!files.ok()) return files.status();
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto picture, PictureOfRaw(folder.path() + "/" + files->front(), sensor.bit_depth_bit,
                                   sensor.black_level_dn +
                                       sensor.gain_dn_per_electron * sensor.dark_mean_electrons,
                                   sensor.colour_filter == ColourFilter::kBayerRggb));
    picture.reduction = reduction;
    picture.warnings = std::move(warnings);
    return picture;
  };
}

}  // namespace sightline
