// SPDX-License-Identifier: Apache-2.0
// A client that announces and sends a part of any size, for bench/bad_input. Prints the server's
// status code and message and what was sent; exit code 0 if the part was accepted, else 2.
#include <grpcpp/grpcpp.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "sightline/v1/coverage_service.grpc.pb.h"

int main(int argc, char** argv) {
  CLI::App app("Uploads a part of zeros");
  std::string address;
  int64_t announced = 0, sent_limit = 0;
  app.add_option("address", address)->required();
  app.add_option("--announce-bytes", announced)->required();
  app.add_option("--send-bytes", sent_limit)->required();
  CLI11_PARSE(app, argc, argv);

  const auto start = std::chrono::steady_clock::now();
  const auto stub = sightline::v1::CoverageService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  sightline::v1::UploadPartResponse response;
  const auto writer = stub->UploadPart(&context, &response);
  sightline::v1::UploadPartRequest message;
  message.mutable_header()->set_format("stl");
  message.mutable_header()->set_unit("mm");
  message.mutable_header()->set_size_bytes(announced);
  message.mutable_header()->set_file_name("zeros.stl");
  bool open = writer->Write(message);
  message.set_chunk(std::string(1 << 20, '\0'));
  int64_t sent = 0;
  while (open && sent < sent_limit) {
    open = writer->Write(message);
    if (open) sent += 1 << 20;
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf("code %d: %s (after %.2f s and %lld MiB)\n", status.error_code(),
              status.error_message().c_str(), seconds, static_cast<long long>(sent >> 20));
  std::fflush(stdout);
  // Without destructors: gRPC 1.51 now and then waits 10 s in grpc_shutdown for its own poller when
  // the last channel goes.
  std::_Exit(status.ok() ? 0 : 2);
}
