// Points of scans that were asked about lately.
#pragma once

#include <array>
#include <list>
#include <map>
#include <mutex>

#include "core/rig/measurement.h"
#include "coverage_server/scene/coverage_scene.h"

namespace sightline {

// A plan is asked about many times while it grows; its scans need not be measured each time. Holds
// the scans used last, as long as they have not more than kMaxPoints points together. Thread-safe;
// answers do not depend on what it holds.
class ScanPointsCache {
 public:
  // Feasible without points: not known.
  MeasuredScan Find(const Measurement& measurement);
  void Add(const Measurement& measurement, const MeasuredScan& scan);

 private:
  // 24 bytes each: about 400 MB.
  static constexpr size_t kMaxPoints = 16'000'000;
  static constexpr size_t kMaxScans = 1024;
  using Key = std::array<double, kMeasurementParameters>;
  struct Entry {
    Key key;
    MeasuredScan scan;
  };

  std::mutex mutex_;
  std::list<Entry> entries_;  // used last first
  std::map<Key, std::list<Entry>::iterator> places_;
  size_t points_ = 0;
};

}  // namespace sightline
