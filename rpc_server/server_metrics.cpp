// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/server_metrics.h"

namespace sightline {
namespace {

const prometheus::Histogram::BucketBoundaries kLatencyBuckets_s = {
    0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 100};

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
      in_flight_(AddGauge("sightline_in_flight_requests", "Calls being served")),
      streams_(AddGauge("sightline_open_streams", "Calls that may wait for their client")),
      saturated_(
          AddGauge("sightline_saturated", "1 while health says NOT_SERVING for that reason")),
      refused_(prometheus::BuildCounter()
                   .Name("sightline_refused_calls_total")
                   .Help("Calls over a limit on calls or streams, or while draining")
                   .Register(*registry_)
                   .Add({})) {}

void ServerMetrics::CountRequest(const std::string& method, const std::string& code,
                                 absl::Duration latency) {
  requests_.Add({{"method", method}, {"code", code}}).Increment();
  latency_.Add({{"method", method}}, kLatencyBuckets_s).Observe(absl::ToDoubleSeconds(latency));
}

void ServerMetrics::SetInFlight(int64_t calls) { in_flight_.Set(static_cast<double>(calls)); }

void ServerMetrics::SetStreams(int64_t streams, bool saturated) {
  streams_.Set(static_cast<double>(streams));
  saturated_.Set(saturated ? 1 : 0);
}

prometheus::Gauge& ServerMetrics::AddGauge(const std::string& name, const std::string& help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(*registry_).Add({});
}

}  // namespace sightline
