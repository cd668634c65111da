// SPDX-License-Identifier: Apache-2.0
// Requests per second and their latency at the front ends of the planning service, by the number of
// clients; beside gRPC's own health check on the same server, which does nothing.
#include <curl/curl.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/impl/codegen/client_unary_call.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>

#include "absl/strings/str_cat.h"
#include "bench/common/measure.h"
#include "core/digest/sha256.h"
#include "planning_service/server/planning_server.h"
#include "sightline/v1/planning_service.grpc.pb.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;

constexpr char kToken[] = "token of the benchmark";

// One client's connection; true if the request was answered well.
using Request = std::function<bool()>;
// Makes the connection of client number `client`.
using Connect = std::function<Request(int client)>;

struct Load {
  double per_s = 0;
  std::vector<double> ms;
  int64_t failed = 0;
};

Load Measure(int clients, double seconds, const Connect& connect) {
  std::vector<Load> loads(static_cast<size_t>(clients));
  std::vector<std::thread> threads;
  std::atomic<int> ready = 0;
  for (int c = 0; c < clients; ++c) {
    threads.emplace_back([&, c] {
      Load& load = loads[static_cast<size_t>(c)];
      const Request request = connect(c);
      load.failed += !request();  // opens the connection
      ++ready;
      while (ready < clients) std::this_thread::yield();
      const Stopwatch watch;
      while (watch.Seconds() < seconds) {
        const Stopwatch one;
        load.failed += !request();
        load.ms.push_back(1e3 * one.Seconds());
      }
      load.per_s = static_cast<double>(load.ms.size()) / watch.Seconds();
    });
  }
  for (std::thread& thread : threads) thread.join();
  Load all;
  for (const Load& load : loads) {
    all.per_s += load.per_s;
    all.failed += load.failed;
    all.ms.insert(all.ms.end(), load.ms.begin(), load.ms.end());
  }
  return all;
}

v1::PlanningTask Task() {
  v1::PlanningTask task;
  task.set_kind("plan");
  task.mutable_inspection()->mutable_part()->set_file("part.glb");
  return task;
}

// The server under test, with no workers: jobs stay in the queue.
class Server {
 public:
  Server() : folder_(fs::temp_directory_path() / absl::StrCat("sightline-requests-", getpid())) {
    PlanningServerOptions options;
    options.rpc.listen = "127.0.0.1:0";
    options.data_folder = folder_ / "data";
    options.http_listen = "127.0.0.1:0";
    options.workers = 0;
    options.min_free_bytes = 0;
    options.clients_file = folder_ / "clients.json";
    fs::create_directories(folder_);
    // SHA-256 of kToken.
    std::ofstream(options.clients_file)
        << absl::StrCat(R"({"clients": [{"name": "bench", "token_sha256": ")", Sha256Hex(kToken),
                        R"(", "max_queued_jobs": 1000000}]})");
    auto server = StartPlanningServer(options);
    if (!server.ok()) Fail("start", std::string(server.status().message()));
    server_ = *std::move(server);
  }
  ~Server() {
    server_->Drain(absl::Seconds(1));
    server_.reset();
    fs::remove_all(folder_);
  }
  std::shared_ptr<grpc::Channel> Channel() const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(server_->address(), grpc::InsecureChannelCredentials(),
                                     arguments);
  }
  std::string http() const { return server_->http_url(); }

 private:
  fs::path folder_;
  std::unique_ptr<PlanningServer> server_;
};

void Identify(grpc::ClientContext* context) {
  context->AddMetadata("authorization", absl::StrCat("Bearer ", kToken));
}

size_t Discard(char*, size_t size, size_t count, void*) { return size * count; }

// GET with one connection that stays open.
Request HttpGet(const std::string& url) {
  std::shared_ptr<CURL> curl(curl_easy_init(), curl_easy_cleanup);
  curl_easy_setopt(curl.get(), CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_WRITEFUNCTION, Discard);
  curl_easy_setopt(curl.get(), CURLOPT_TCP_NODELAY, 1L);
  const std::shared_ptr<curl_slist> headers(
      curl_slist_append(nullptr, absl::StrCat("Authorization: Bearer ", kToken).c_str()),
      curl_slist_free_all);
  curl_easy_setopt(curl.get(), CURLOPT_HTTPHEADER, headers.get());
  return [curl, headers] {
    long status = 0;
    return curl_easy_perform(curl.get()) == CURLE_OK &&
           curl_easy_getinfo(curl.get(), CURLINFO_RESPONSE_CODE, &status) == CURLE_OK &&
           status == 200;
  };
}

// A unary call by the generic stub of a client of its own.
template <typename Call>
Connect Rpc(const Server& server, Call call) {
  return [&server, call](int client) -> Request {
    auto stub =
        std::shared_ptr<v1::PlanningService::Stub>(v1::PlanningService::NewStub(server.Channel()));
    auto number = std::make_shared<int>(0);
    return [stub, call, client, number] { return call(*stub, client, (*number)++); };
  };
}

int Run(double seconds, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  curl_global_init(CURL_GLOBAL_ALL);
  spdlog::set_level(spdlog::level::err);
  const Server server;
  const auto stub = v1::PlanningService::NewStub(server.Channel());
  std::string digest, job_id;
  {
    grpc::ClientContext context;
    Identify(&context);
    v1::UploadFileResponse response;
    auto writer = stub->UploadFile(&context, &response);
    v1::UploadFileRequest request;
    request.mutable_header()->set_size_bytes(4);
    writer->Write(request);
    request.set_chunk("part");
    writer->Write(request);
    writer->WritesDone();
    if (!writer->Finish().ok()) Fail("upload", "failed");
    digest = response.digest();
  }
  const auto create = [digest](v1::PlanningService::Stub& service, const std::string& request_id,
                               std::string* id) {
    grpc::ClientContext context;
    Identify(&context);
    v1::CreatePlanningJobRequest request;
    request.set_request_id(request_id);
    *request.mutable_task() = Task();
    request.add_files()->set_name("part.glb");
    request.mutable_files(0)->set_digest(digest);
    v1::CreatePlanningJobResponse response;
    const bool good = service.CreatePlanningJob(&context, request, &response).ok();
    *id = response.job().job_id();
    return good;
  };
  if (!create(*stub, "first", &job_id)) Fail("create", "failed");

  const std::vector<std::pair<std::string, Connect>> loads = {
      {"gRPC health check",
       [&](int) -> Request {
         auto generic = server.Channel();
         auto method = std::make_shared<grpc::internal::RpcMethod>(
             "/grpc.health.v1.Health/Check", grpc::internal::RpcMethod::NORMAL_RPC);
         // An empty request asks for the whole server; its encoding is that of any empty message.
         return [generic, method] {
           grpc::ClientContext context;
           v1::GetVisionStateRequest request;
           v1::GetVisionStateRequest response;
           return grpc::internal::BlockingUnaryCall(generic.get(), *method, &context, request,
                                                    &response)
               .ok();
         };
       }},
      {"gRPC get job", Rpc(server,
                           [&](v1::PlanningService::Stub& service, int, int) {
                             grpc::ClientContext context;
                             Identify(&context);
                             v1::GetPlanningJobRequest request;
                             request.set_job_id(job_id);
                             v1::GetPlanningJobResponse response;
                             return service.GetPlanningJob(&context, request, &response).ok();
                           })},
      {"gRPC create job",
       Rpc(server,
           [&](v1::PlanningService::Stub& service, int client, int number) {
             std::string id;
             return create(service,
                           absl::StrCat(getpid(), "-", client, "-", number, "-", std::rand()), &id);
           })},
      {"HTTP get job",
       [&](int) { return HttpGet(absl::StrCat(server.http(), "/v1/jobs/", job_id)); }},
      {"HTTP list 100 jobs",
       [&](int) { return HttpGet(absl::StrCat(server.http(), "/v1/jobs?page_size=100")); }},
  };
  std::printf("%-20s %8s %12s %9s %9s %8s %s\n", "request", "clients", "requests/s", "p50 ms",
              "p99 ms", "failed", "rate over health check");
  Json results = Json::array();
  for (const int clients : {1, 4, 16}) {
    double reference = 0;
    for (const auto& [name, connect] : loads) {
      const Load load = Measure(clients, seconds, connect);
      if (reference == 0) reference = load.per_s;
      std::printf("%-20s %8d %12.0f %9.3f %9.3f %8lld %.2f\n", name.c_str(), clients, load.per_s,
                  Quantile(load.ms, 0.5), Quantile(load.ms, 0.99),
                  static_cast<long long>(load.failed), load.per_s / reference);
      results.push_back({{"request", name},
                         {"clients", clients},
                         {"per_s", load.per_s},
                         {"p50_ms", Quantile(load.ms, 0.5)},
                         {"p99_ms", Quantile(load.ms, 0.99)},
                         {"failed", load.failed}});
    }
  }
  WriteResults(json, "planning_requests", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app{"Requests per second of the planning service"};
  double seconds = 5;
  std::string json;
  app.add_option("--seconds", seconds, "of each load")->check(CLI::Range(0.1, 600.0));
  app.add_option("--json", json, "file for the results");
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(seconds, json);
}
