// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/coverage_metrics.h"

namespace sightline {

CoverageMetrics::CoverageMetrics()
    : queries_(prometheus::BuildCounter()
                   .Name("sightline_queries_total")
                   .Help("Evaluated measurements by evaluator")
                   .Register(*registry())),
      parts_(AddGauge("sightline_parts", "Parts in memory")),
      part_bytes_(AddGauge("sightline_part_bytes", "Bytes of parts in memory")),
      scenes_(AddGauge("sightline_scenes", "Scenes in memory")),
      scene_bytes_(AddGauge("sightline_scene_bytes", "Bytes of scenes in memory")) {}

void CoverageMetrics::CountQueries(const std::string& evaluator, int64_t queries) {
  queries_.Add({{"evaluator", evaluator}}).Increment(static_cast<double>(queries));
}

void CoverageMetrics::SetParts(int64_t count, int64_t bytes) {
  parts_.Set(static_cast<double>(count));
  part_bytes_.Set(static_cast<double>(bytes));
}

void CoverageMetrics::SetScenes(int64_t count, int64_t bytes) {
  scenes_.Set(static_cast<double>(count));
  scene_bytes_.Set(static_cast<double>(bytes));
}

}  // namespace sightline
