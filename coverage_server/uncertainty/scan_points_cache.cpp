#include "coverage_server/uncertainty/scan_points_cache.h"

#include "coverage_server/uncertainty/exact_inference.h"

namespace sightline {

namespace {

size_t PointsOf(const MeasuredScan& scan) { return scan.points ? scan.points->size() : 0; }

}  // namespace

MeasuredScan ScanPointsCache::Find(const Measurement& measurement) {
  const std::lock_guard lock(mutex_);
  const auto found = places_.find(ToArray(measurement));
  if (found == places_.end()) return {};
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second->scan;
}

void ScanPointsCache::Add(const Measurement& measurement, const MeasuredScan& scan) {
  const std::lock_guard lock(mutex_);
  const Key key = ToArray(measurement);
  if (places_.contains(key) || PointsOf(scan) > kMaxPoints) return;
  entries_.push_front({key, scan});
  places_[key] = entries_.begin();
  points_ += PointsOf(scan);
  while (points_ > kMaxPoints || entries_.size() > kMaxScans) {
    points_ -= PointsOf(entries_.back().scan);
    places_.erase(entries_.back().key);
    entries_.pop_back();
  }
}

}  // namespace sightline
