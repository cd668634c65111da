// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/detectability_client.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "core/file/file_lock.h"
#include "core/file/read_file.h"
#include "core/status/status_macros.h"
#include "planner_client/part_files/private_folder.h"
#include "planner_client/rpc_client/answer_job.h"
#include "sightline/v1/optics_service.grpc.pb.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Part of every key: another number when the meaning of a table changes.
constexpr char kRule[] = "sightline detectability 1";
constexpr uint64_t kMaxTableBytes = uint64_t{64} << 20;
constexpr size_t kHexDigits = 64;

// A file holds the digest of the table's bytes, then these.
std::optional<v1::DetectabilityTable> ReadTable(const std::string& path) {
  const auto bytes = ReadRegularFile(path, kMaxTableBytes);
  if (!bytes.ok() || bytes->size() <= kHexDigits) return std::nullopt;
  const std::string table_bytes = bytes->substr(kHexDigits);
  v1::DetectabilityTable table;
  if (Sha256Hex(table_bytes) != bytes->substr(0, kHexDigits) ||
      !table.ParseFromString(table_bytes)) {
    return std::nullopt;
  }
  return table;
}

std::string KeyOf(const std::string& worker_build, const DetectabilityQuestion& question) {
  std::string text = absl::StrCat(kRule, "\n", worker_build, "\n");
  for (const AssetFile& asset : question.assets) {
    absl::StrAppend(&text, asset.file, "\n", Sha256Hex(asset.bytes), "\n");
  }
  {
    google::protobuf::io::StringOutputStream stream(&text);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);  // maps have no order of their own
    question.request.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(text);
}

}  // namespace

absl::StatusOr<v1::DetectabilityTable> AskDetectability(const WorkerClientOptions& options,
                                                        const DetectabilityQuestion& question) {
  WorkerCall call(options, question.assets);
  const auto service = v1::OpticsService::NewStub(call.channel());
  v1::CreateDetectabilityRequest request = question.request;
  AddAssetDigests(call, question.assets, 0, question.assets.size(), request.mutable_assets());
  request.set_request_id(NewRequestId());
  v1::CreateDetectabilityResponse created;
  v1::GetDetectabilityResponse answer;
  const absl::Status status = RunAnswerJob(
      &call, created,
      [&](grpc::ClientContext* context) {
        return service->CreateDetectability(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetDetectabilityRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetDetectability(context, get, &answer);
      });
  if (!status.ok()) return status;
  return std::move(*answer.mutable_table());
}

absl::StatusOr<v1::DetectabilityTable> KeptDetectability(
    const std::string& folder, const std::string& worker_build,
    const DetectabilityQuestion& question,
    const std::function<absl::StatusOr<v1::DetectabilityTable>()>& ask) {
  const std::string key = KeyOf(worker_build, question);
  const std::string path = (fs::path(folder) / (key + ".table")).string();
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto lock, FileLock::AwaitFile((fs::path(folder) / (key + ".lock")).string(), {}));
  if (auto kept = ReadTable(path)) {
    std::error_code ignored;
    fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);
    return *std::move(kept);
  }
  RemoveUnusedFiles(folder);
  SIGHTLINE_ASSIGN_OR_RETURN(auto table, ask());
  const std::string bytes = table.SerializeAsString();
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically(path, absl::StrCat(Sha256Hex(bytes), bytes), kPrivateFile));
  return table;
}

}  // namespace sightline
