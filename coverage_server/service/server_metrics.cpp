#include "coverage_server/service/server_metrics.h"

namespace sightline {
namespace {

const prometheus::Histogram::BucketBoundaries kLatencyBuckets_s = {
    0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 100};

prometheus::Gauge& MakeGauge(prometheus::Registry& registry, const std::string& name,
                             const std::string& help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add({});
}

}  // namespace

ServerMetrics::ServerMetrics()
    : registry_(std::make_shared<prometheus::Registry>()),
      requests_(prometheus::BuildCounter()
                    .Name("sightline_requests_total")
                    .Help("Finished calls by method and status code")
                    .Register(*registry_)),
      latency_(prometheus::BuildHistogram()
                   .Name("sightline_request_seconds")
                   .Help("Time from the start to the end of a call")
                   .Register(*registry_)),
      queries_(prometheus::BuildCounter()
                   .Name("sightline_queries_total")
                   .Help("Evaluated measurements by evaluator")
                   .Register(*registry_)),
      parts_(MakeGauge(*registry_, "sightline_parts", "Parts in memory")),
      part_bytes_(MakeGauge(*registry_, "sightline_part_bytes", "Bytes of parts in memory")),
      scenes_(MakeGauge(*registry_, "sightline_scenes", "Scenes in memory")),
      scene_bytes_(MakeGauge(*registry_, "sightline_scene_bytes", "Bytes of scenes in memory")),
      in_flight_(MakeGauge(*registry_, "sightline_in_flight_requests", "Calls being served")) {}

void ServerMetrics::CountRequest(const std::string& method, const std::string& code,
                                 absl::Duration latency) {
  requests_.Add({{"method", method}, {"code", code}}).Increment();
  latency_.Add({{"method", method}}, kLatencyBuckets_s).Observe(absl::ToDoubleSeconds(latency));
}

void ServerMetrics::CountQueries(const std::string& evaluator, int64_t queries) {
  queries_.Add({{"evaluator", evaluator}}).Increment(static_cast<double>(queries));
}

void ServerMetrics::SetParts(int64_t count, int64_t bytes) {
  parts_.Set(static_cast<double>(count));
  part_bytes_.Set(static_cast<double>(bytes));
}

void ServerMetrics::SetScenes(int64_t count, int64_t bytes) {
  scenes_.Set(static_cast<double>(count));
  scene_bytes_.Set(static_cast<double>(bytes));
}

void ServerMetrics::SetInFlight(int64_t calls) { in_flight_.Set(static_cast<double>(calls)); }

}  // namespace sightline
