// SPDX-License-Identifier: Apache-2.0
// Prometheus metrics that every server has.
#pragma once

#include <prometheus/collectable.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <memory>
#include <string>

#include "absl/time/time.h"

namespace sightline {

// Thread-safe. A server with more to count adds its own families to the registry.
class ServerMetrics {
 public:
  ServerMetrics();
  virtual ~ServerMetrics() = default;

  void CountRequest(const std::string& method, const std::string& code, absl::Duration latency);
  void SetInFlight(int64_t calls);
  void SetStreams(int64_t streams, bool saturated);
  // Counts a call that was refused.
  void CountRefused() { refused_.Increment(); }

  std::shared_ptr<prometheus::Registry> registry() const { return registry_; }
  // Source of every scrape: the registry, unless a server updates its values before a scrape.
  virtual std::shared_ptr<prometheus::Collectable> collectable() { return registry_; }
  // A gauge without labels.
  prometheus::Gauge& AddGauge(const std::string& name, const std::string& help);

 private:
  std::shared_ptr<prometheus::Registry> registry_;
  prometheus::Family<prometheus::Counter>& requests_;
  prometheus::Family<prometheus::Histogram>& latency_;
  prometheus::Gauge& in_flight_;
  prometheus::Gauge& streams_;
  prometheus::Gauge& saturated_;
  prometheus::Counter& refused_;
};

}  // namespace sightline
