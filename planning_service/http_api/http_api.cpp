// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/http_api.h"

#include <utility>

#include "core/status/status_macros.h"
#include "planning_service/http/http_server.h"
#include "planning_service/http_api/routes.h"

namespace sightline {

struct HttpApi::Impl {
  Impl(const HttpApiOptions& options, std::unique_ptr<HttpServer> http_server, PlanningJobs* jobs,
       ClientAccess* access)
      : routes(jobs, access, MakeBrowserGuard(options.allowed_hosts, http_server->listening()),
               options.max_event_streams, options.max_body_memory_bytes, options.web_files),
        server(std::move(http_server)) {}

  Routes routes;
  const std::unique_ptr<HttpServer> server;  // ends before the routes that it calls
};

absl::StatusOr<std::unique_ptr<HttpApi>> HttpApi::Start(const HttpApiOptions& options,
                                                        PlanningJobs* jobs, ClientAccess* access) {
  if (options.max_event_streams < 1) {
    return absl::InvalidArgumentError("max_event_streams must be at least 1");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      std::unique_ptr<HttpServer> server,
      HttpServer::Listen(
          {.option = "--http",
           .listen = options.listen,
           .tls = {options.tls_certificate_file, options.tls_key_file, options.tls_client_ca_file},
           .tls_check_interval = options.tls_check_interval,
           .max_connections = options.max_connections,
           .max_request_bytes = options.max_request_bytes,
           .request_timeout = options.request_timeout}));
  auto impl = std::make_unique<Impl>(options, std::move(server), jobs, access);
  impl->server->Start(
      [&routes = impl->routes](HttpExchange& exchange) { routes.Answer(exchange); });
  return std::unique_ptr<HttpApi>(new HttpApi(std::move(impl)));
}

HttpApi::HttpApi(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpApi::~HttpApi() { Stop(); }

const std::string& HttpApi::address() const { return impl_->server->listening().address; }

void HttpApi::Stop() { impl_->server->Stop(); }

}  // namespace sightline
