// SPDX-License-Identifier: Apache-2.0
// Cache of the points that recent exact scans have measured.
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/memo/lru_store.h"
#include "core/rig/measurement.h"

namespace sightline {

// A point that a frame measures, exact by rays (exact_evaluator.h).
struct MeasurementPoint {
  Eigen::Vector3f position_m;  // part coordinates
  Eigen::Vector3f normal;
  int32_t frame;  // stage position / scan step
  int32_t column_px;
};

// The bits of a scan's numbers: two scans have equal keys only if they are identical.
inline std::string MeasurementKey(const Measurement& measurement) {
  std::string key;
  for (const double value : ToArray(measurement)) {
    const auto bits = std::bit_cast<uint64_t>(value);
    key.append(reinterpret_cast<const char*>(&bits), sizeof(bits));
  }
  return key;
}

// The same scan is often queried again: for other targets on the same part, for its points, for a
// picture. Scenes share points if they have the same part, rig, obstacles and limits on depth.
// Answers do not depend on the cache.
struct MeasuredScans {
  using Points = std::vector<MeasurementPoint>;

  std::shared_ptr<LruStore<Points>> store;  // null: nothing is kept
  std::string geometry;                     // identifies part, rig, obstacles and limits

  // The points of a scan; null if they are not in the cache.
  std::shared_ptr<const Points> Find(const Measurement& measurement) const {
    return store == nullptr ? nullptr : store->Get(KeyOf(measurement));
  }
  // Points that exceed the store's limit are not kept.
  void Add(const Measurement& measurement, std::shared_ptr<const Points> points) const {
    if (store == nullptr) return;
    const auto bytes = static_cast<int64_t>(points->size() * sizeof(MeasurementPoint));
    store->Put(KeyOf(measurement), std::move(points), bytes).IgnoreError();
  }

 private:
  std::string KeyOf(const Measurement& measurement) const {
    return geometry + MeasurementKey(measurement);
  }
};

}  // namespace sightline
