// SPDX-License-Identifier: Apache-2.0
#include "render_worker/detectability/detectability_table.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/parallel/worker_threads.h"
#include "core/random/seed.h"
#include "core/status/status_macros.h"
#include "render_worker/detectability/facet.h"
#include "render_worker/detectability/facet_exposures.h"
#include "render_worker/render/part_scene.h"
#include "render_worker/render/part_view.h"

namespace sightline {
namespace {

// Angle between machining marks and the plane of normal and camera: half way between the two
// extremes.
constexpr double kMarksTurn_deg = 45;
// Distance of the laser where the rig has it follow the camera.
constexpr double kUsualLaserDistance_m = 0.5;

constexpr size_t kIncidences = std::size(kFacetIncidence_deg),
                 kAzimuths = std::size(kFacetAzimuth_deg);

// Nearest and farthest camera of the domain; one where they are equal.
std::vector<double> CameraDistances(const ParameterDomain& domain) {
  std::vector<double> ends = domain.values;
  for (const ParameterDomain::Range& range : domain.ranges) {
    ends.push_back(range.min);
    ends.push_back(range.max);
  }
  const auto [nearest, farthest] = std::minmax_element(ends.begin(), ends.end());
  if (*farthest <= 1.001 * *nearest) return {*nearest};
  // In equal ratios: the size of the line in the image changes by as much from one to the next.
  const double ratio = std::cbrt(*farthest / *nearest);
  return {*nearest, ratio * *nearest, ratio * ratio * *nearest, *farthest};
}

// The material with its machining marks turned so on a facet; the material itself if it has none.
v1::Material OnFacet(const v1::Material& material) {
  v1::Material turned = material;
  const v1::Material::Conductor& conductor = material.conductor();
  if (!material.has_conductor() || conductor.ggx_alpha_x() == conductor.ggx_alpha_y()) {
    return turned;
  }
  auto* direction = turned.mutable_conductor()->mutable_machining_direction();
  direction->set_x(std::cos(Radians(kMarksTurn_deg)));
  direction->set_y(std::sin(Radians(kMarksTurn_deg)));
  direction->set_z(0);
  return turned;
}

// A point of the grid of one material.
struct GridPoint {
  size_t index = 0;  // in the table
  FacetView view;
};

class MaterialTable {
 public:
  MaterialTable(const Inspection& inspection, std::span<const ActiveEffect> effects,
                const DetectabilityTask& task, const DetectabilityHooks& hooks)
      : effects_(effects), task_(task), hooks_(hooks) {
    distances_m_ = CameraDistances(inspection.domain.parameters[kCameraDistance]);
    laser_distance_m_ = inspection.rig.laser.distance_m.value_or(kUsualLaserDistance_m);
    for (size_t d = 0; d < distances_m_.size(); ++d) {
      for (size_t camera = 0; camera < kIncidences; ++camera) {
        for (size_t laser = 0; laser < kIncidences; ++laser) {
          // Along the normal the azimuth has no meaning: the first stands for all.
          const size_t azimuths = camera == 0 || laser == 0 ? 1 : kAzimuths;
          for (size_t azimuth = 0; azimuth < azimuths; ++azimuth) {
            points_.push_back(
                {((d * kIncidences + camera) * kIncidences + laser) * kAzimuths + azimuth,
                 {distances_m_[d], Radians(kFacetIncidence_deg[camera]),
                  Radians(kFacetIncidence_deg[laser]), Radians(kFacetAzimuth_deg[azimuth])}});
          }
        }
      }
    }
  }

  // `report`: fractions in [0, 1], by one thread at a time.
  absl::StatusOr<v1::DetectabilityOfMaterial> Make(
      const Inspection& inspection, const MaterialChoice& material, const AssetResolver& assets,
      const std::function<void(double)>& report) const {
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto scene, MakeFacetScene(inspection, OnFacet(material.material), laser_distance_m_,
                                         distances_m_.back(), task_.f_number, assets));
    std::vector<ExposureRange> ranges(points_.size());
    SIGHTLINE_RETURN_IF_ERROR(Render(*scene, report, ranges));
    return Filled(ranges);
  }

 private:
  absl::Status Render(PartScene& scene, const std::function<void(double)>& report,
                      std::vector<ExposureRange>& ranges) const {
    std::vector<absl::Status> statuses(ranges.size());
    std::atomic<size_t> next = 0;
    std::atomic<bool> failed = false;
    std::mutex report_mutex;
    size_t done = 0;
    RenderLimits limits = hooks_.limits;
    limits.threads = 1;
    limits.progress = nullptr;
    WorkerThreads threads;
    for (int thread = 0; thread < std::max(1, hooks_.limits.threads); ++thread) {
      threads.Start([&] {
        for (size_t i = next++; i < ranges.size() && !failed; i = next++) {
          auto range = FacetExposures(scene, effects_, points_[i].view, task_.min_detected_fraction,
                                      DeriveSeed(task_.seed, "facet", i), limits);
          statuses[i] = range.status();
          if (range.ok()) {
            ranges[i] = *range;
          } else {
            failed = true;
          }
          const std::lock_guard lock(report_mutex);
          report(static_cast<double>(++done) / static_cast<double>(ranges.size()));
        }
      });
    }
    threads.Join();
    for (const absl::Status& status : statuses) {
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  v1::DetectabilityOfMaterial Filled(const std::vector<ExposureRange>& ranges) const {
    v1::DetectabilityOfMaterial table;
    for (const double distance_m : distances_m_) table.add_camera_distances_m(distance_m);
    for (const double angle_deg : kFacetIncidence_deg) {
      table.add_camera_incidence_deg(angle_deg);
      table.add_laser_incidence_deg(angle_deg);
    }
    for (const double angle_deg : kFacetAzimuth_deg) table.add_azimuth_deg(angle_deg);
    table.set_laser_distance_m(laser_distance_m_);
    const size_t entries = distances_m_.size() * kIncidences * kIncidences * kAzimuths;
    table.mutable_shortest_exposure_time_s()->Resize(static_cast<int>(entries), 0);
    table.mutable_longest_exposure_time_s()->Resize(static_cast<int>(entries), 0);
    for (size_t p = 0; p < points_.size(); ++p) {
      const ExposureRange& range = ranges[p];
      const size_t index = points_[p].index;
      // A point along the normal stands for all azimuths.
      const size_t laser = index / kAzimuths % kIncidences,
                   camera = index / kAzimuths / kIncidences % kIncidences;
      const size_t copies = camera == 0 || laser == 0 ? kAzimuths : 1;
      for (size_t k = 0; k < copies; ++k) {
        table.set_shortest_exposure_time_s(static_cast<int>(index + k), range.shortest_s);
        table.set_longest_exposure_time_s(static_cast<int>(index + k), range.longest_s);
      }
    }
    return table;
  }

  std::span<const ActiveEffect> effects_;
  const DetectabilityTask& task_;
  const DetectabilityHooks& hooks_;
  std::vector<double> distances_m_;
  double laser_distance_m_ = 0;
  std::vector<GridPoint> points_;
};

// The material of a name in the part file; null: none.
const MaterialChoice* MaterialOf(const Inspection& inspection, const std::string& part_material) {
  const MaterialChoice* fallback = nullptr;
  for (const MaterialChoice& choice : inspection.materials) {
    if (choice.part_material == part_material) return &choice;
    if (choice.part_material.empty()) fallback = &choice;
  }
  return fallback;
}

}  // namespace

absl::StatusOr<v1::DetectabilityTable> MakeDetectabilityTable(const Inspection& inspection,
                                                              std::span<const ActiveEffect> effects,
                                                              const AssetResolver& assets,
                                                              const DetectabilityTask& task,
                                                              const DetectabilityHooks& hooks) {
  const FrameSetup nominal = PartFrameSetup(inspection, {MeasurementOf({0.4, 0, 0.5, 0})});
  SIGHTLINE_RETURN_IF_ERROR(CheckEffectsActOnParts(nominal, effects));
  // Names of the same material share its table.
  std::map<std::string, v1::DetectabilityOfMaterial> known;
  std::map<std::string, const MaterialChoice*> different;
  for (const std::string& name : task.part_materials) {
    const MaterialChoice* material = MaterialOf(inspection, name);
    if (material == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("materials: no entry for the part's material \"", name, "\""));
    }
    different.emplace(material->material.SerializeAsString(), material);
  }
  const MaterialTable maker(inspection, effects, task, hooks);
  size_t done = 0;
  for (const auto& [bytes, material] : different) {
    const auto report = [&, of = static_cast<double>(different.size())](double fraction) {
      if (!hooks.on_progress) return;
      hooks.on_progress((static_cast<double>(done) + fraction) / of,
                        absl::StrCat("light of ", material->material.name()));
    };
    SIGHTLINE_ASSIGN_OR_RETURN(auto table, maker.Make(inspection, *material, assets, report));
    known.emplace(bytes, std::move(table));
    ++done;
  }
  v1::DetectabilityTable table;
  for (const std::string& name : task.part_materials) {
    v1::DetectabilityOfMaterial& entry = *table.add_materials();
    entry = known.at(MaterialOf(inspection, name)->material.SerializeAsString());
    entry.set_part_material(name);
  }
  return table;
}

}  // namespace sightline
