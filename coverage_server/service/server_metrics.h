// Prometheus metrics of a coverage server.
#pragma once

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <memory>
#include <string>

#include "absl/time/time.h"

namespace sightline {

// Thread-safe.
class ServerMetrics {
 public:
  ServerMetrics();

  void CountRequest(const std::string& method, const std::string& code, absl::Duration latency);
  // `evaluator`: "fast" or "exact".
  void CountQueries(const std::string& evaluator, int64_t queries);
  void SetParts(int64_t count, int64_t bytes);
  void SetScenes(int64_t count, int64_t bytes);
  void SetInFlight(int64_t calls);

  std::shared_ptr<prometheus::Registry> registry() const { return registry_; }

 private:
  std::shared_ptr<prometheus::Registry> registry_;
  prometheus::Family<prometheus::Counter>& requests_;
  prometheus::Family<prometheus::Histogram>& latency_;
  prometheus::Family<prometheus::Counter>& queries_;
  prometheus::Gauge& parts_;
  prometheus::Gauge& part_bytes_;
  prometheus::Gauge& scenes_;
  prometheus::Gauge& scene_bytes_;
  prometheus::Gauge& in_flight_;
};

}  // namespace sightline
