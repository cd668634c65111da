// SPDX-License-Identifier: Apache-2.0
// Prometheus metrics of a coverage server.
#pragma once

#include "rpc_server/server_metrics.h"

namespace sightline {

// Thread-safe.
class CoverageMetrics : public ServerMetrics {
 public:
  CoverageMetrics();

  // `evaluator`: "fast" or "exact".
  void CountQueries(const std::string& evaluator, int64_t queries);
  void SetParts(int64_t count, int64_t bytes);
  void SetScenes(int64_t count, int64_t bytes);

 private:
  prometheus::Family<prometheus::Counter>& queries_;
  prometheus::Gauge& parts_;
  prometheus::Gauge& part_bytes_;
  prometheus::Gauge& scenes_;
  prometheus::Gauge& scene_bytes_;
};

}  // namespace sightline
