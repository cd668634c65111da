// SPDX-License-Identifier: Apache-2.0
#include "report/plan/plan_csv.h"

#include <array>
#include <cassert>
#include <charconv>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sightline {
namespace {

std::string Shortest(double value) {
  std::array<char, 32> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  assert(error == std::errc());
  return std::string(buffer.data(), end);
}

}  // namespace

std::string PlanCsv(const v1::Plan& plan) {
  std::string csv =
      "scan,locked,camera_distance_m,triangulation_angle_deg,camera_azimuth_deg,camera_polar_deg,"
      "part_alpha_deg,part_beta_deg,part_gamma_deg,offset_y_m,offset_z_m,stage_start_m,stage_end_m,"
      "frames_count,covered_targets_count,new_targets_count,cumulative_targets_count,"
      "cumulative_coverage_percent,measurement_points_count,scan_time_s,reposition_time_s,"
      "pixel_footprint_median_mm,depth_per_pixel_median_mm,depth_per_pixel_high_mm,"
      "triangulation_angle_median_deg,camera_incidence_median_deg,laser_incidence_median_deg,"
      "overlap_percent\n";
  const double measurable = static_cast<double>(plan.coverage().measurable_targets());
  for (const v1::PlannedScan& scan : plan.scans()) {
    const v1::Measurement& m = scan.measurement();
    const auto integer = [](int64_t value) { return absl::StrCat(value); };
    const v1::ScanQuality& quality = scan.quality();
    // Empty cells for scans that measure nothing.
    const auto of_quality = [&](double value) {
      return scan.has_quality() ? Shortest(value) : std::string();
    };
    const std::array<std::string, 28> row = {
        integer(scan.index()),
        scan.locked() ? "1" : "0",
        Shortest(m.camera_distance_m()),
        Shortest(m.triangulation_angle_deg()),
        Shortest(m.camera_azimuth_deg()),
        Shortest(m.camera_polar_deg()),
        Shortest(m.part_alpha_deg()),
        Shortest(m.part_beta_deg()),
        Shortest(m.part_gamma_deg()),
        Shortest(m.offset_y_m()),
        Shortest(m.offset_z_m()),
        Shortest(scan.stage_start_m()),
        Shortest(scan.stage_end_m()),
        integer(scan.trigger_positions_m_size()),
        integer(scan.covered_targets()),
        integer(scan.new_targets()),
        integer(scan.cumulative_targets()),
        measurable > 0
            ? Shortest(100.0 * static_cast<double>(scan.cumulative_targets()) / measurable)
            : "",
        integer(scan.measurement_points()),
        Shortest(scan.scan_time_s()),
        Shortest(scan.reposition_time_s()),
        of_quality(1e3 * quality.pixel_footprint_m().median()),
        of_quality(1e3 * quality.depth_per_pixel_m().median()),
        of_quality(1e3 * quality.depth_per_pixel_m().high()),
        of_quality(quality.triangulation_angle_deg().median()),
        of_quality(quality.camera_incidence_deg().median()),
        of_quality(quality.laser_incidence_deg().median()),
        of_quality(100 * quality.overlap())};
    absl::StrAppend(&csv, absl::StrJoin(row, ","), "\n");
  }
  return csv;
}

}  // namespace sightline
