// SPDX-License-Identifier: Apache-2.0
// Points that exact scans measured lately.
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

// Ray-exact point that a frame measures (exact_evaluator.h).
struct MeasurementPoint {
  Eigen::Vector3f position_m;  // part coordinates
  Eigen::Vector3f normal;
  int32_t frame;  // stage position / scan step
  int32_t column_px;
};

// The numbers of a scan, bit by bit: the same for the same scan alone.
inline std::string MeasurementKey(const Measurement& measurement) {
  std::string key;
  for (const double value : ToArray(measurement)) {
    const auto bits = std::bit_cast<uint64_t>(value);
    key.append(reinterpret_cast<const char*>(&bits), sizeof(bits));
  }
  return key;
}

// Scans are asked about again: for other targets on the same part, for their points, for a picture.
// Points of one part on one rig among its obstacles, within the same limits on depth; scenes that
// have all that in common share them. Answers do not depend on the cache.
struct MeasuredScans {
  using Points = std::vector<MeasurementPoint>;

  std::shared_ptr<LruStore<Points>> store;  // null: nothing is kept
  std::string geometry;                     // names part, rig, obstacles and limits

  // Null if unknown.
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
