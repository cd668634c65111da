#include "planner_client/report/plan/plan_csv.h"

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
      "cumulative_coverage_percent,measurement_points_count,scan_time_s,reposition_time_s\n";
  const double measurable = static_cast<double>(plan.coverage().measurable_targets());
  for (const v1::PlannedScan& scan : plan.scans()) {
    const v1::Measurement& m = scan.measurement();
    const auto integer = [](int64_t value) { return absl::StrCat(value); };
    const std::array<std::string, 21> row = {
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
        Shortest(scan.reposition_time_s())};
    absl::StrAppend(&csv, absl::StrJoin(row, ","), "\n");
  }
  return csv;
}

}  // namespace sightline
