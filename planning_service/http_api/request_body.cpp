// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/request_body.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "planning_service/http/multipart_reader.h"
#include "planning_service/task/planning_task.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// Tasks are texts written by people or programs; large data comes in files.
constexpr size_t kMaxJsonBytes = 16 << 20;
// A text that grows by doubling takes twice its size, and so does its copy with numbers for null
// positions.
constexpr int64_t kBytesPerTextByte = 2;
// A body that has sent this much reserves memory for all that it announces. If bodies reserved
// piece by piece, they could fill the memory together and none of them would complete.
constexpr size_t kTrustedBytes = 1 << 20;
constexpr size_t kMaxFieldBytes = 64;
constexpr int kMaxParts = 1000;

std::string MediaType(const HttpRequest& request) {
  const std::string type = request.Header("content-type");
  return absl::AsciiStrToLower(absl::StripAsciiWhitespace(type.substr(0, type.find(';'))));
}

absl::Status UnsupportedMediaType(const std::string& wanted) {
  return WithErrorInfo(absl::InvalidArgumentError(absl::StrCat("Content-Type: must be ", wanted)),
                       "MEDIA_TYPE_NOT_SUPPORTED");
}

// Lines of "DOCUMENT: path.of.field: reason" of the strict reader as field violations.
absl::Status WithField(const absl::Status& status, const std::string& document,
                       const std::string& field_prefix) {
  if (!absl::IsInvalidArgument(status)) return status;
  std::vector<FieldViolation> violations;
  for (absl::string_view text : absl::StrSplit(status.message(), '\n')) {
    if (!absl::ConsumePrefix(&text, document + ": ")) continue;
    const size_t colon = text.find(": ");
    // Syntax errors name a line instead of a field.
    if (colon == absl::string_view::npos || absl::StartsWith(text, "line ")) {
      violations.push_back({document, std::string(text)});
    } else {
      violations.push_back(
          {absl::StrCat(field_prefix, text.substr(0, colon)), std::string(text.substr(colon + 2))});
    }
  }
  return violations.empty() ? status : InvalidFields(violations);
}

// Memory of a text of so many bytes and of its message.
int64_t BodyMemory(size_t text_bytes) {
  return kBytesPerTextByte * static_cast<int64_t>(text_bytes) +
         static_cast<int64_t>(MostMessageBytes(text_bytes));
}

// Reserves memory until the request holds `bytes`. UNAVAILABLE: there is not enough at the moment.
absl::Status HoldMemory(SharedLimit::Share* memory, int64_t bytes) {
  if (bytes <= memory->held()) return absl::OkStatus();
  const std::optional<Shortage> shortage = memory->Grow(bytes - memory->held());
  if (!shortage) return absl::OkStatus();
  return WithRetryDelay(
      WithErrorInfo(absl::UnavailableError(absl::StrCat(
                        "overloaded: JSON bodies of ", shortage->of_owner ? "yours" : "all clients",
                        " that are being read take ", shortage->held, " of ", shortage->limit,
                        " bytes of memory")),
                    "OVERLOADED"),
      absl::Seconds(1));
}

// `document` is the name of the text in errors.
absl::Status ParseBody(std::string json, const std::string& document,
                       const std::string& field_prefix, SharedLimit::Share* memory,
                       google::protobuf::Message* message) {
  SIGHTLINE_RETURN_IF_ERROR(HoldMemory(memory, BodyMemory(json.size())));
  return WithField(ParseStrictJson(NumberNullPlatePositions(std::move(json)), document, message),
                   document, field_prefix);
}

// Reads the rest of the data of `read`. Memory is reserved for bytes that arrive, not for a mere
// announcement. `announced_bytes`: Content-Length; 0: not known.
template <typename Read>
absl::StatusOr<std::string> ReadText(const std::string& field, size_t max_bytes,
                                     size_t announced_bytes, SharedLimit::Share* memory,
                                     Read read) {
  std::string text;
  for (;;) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::string piece, read());
    if (piece.empty()) return text;
    if (text.size() + piece.size() > max_bytes) {
      return WithErrorInfo(absl::ResourceExhaustedError(
                               absl::StrCat(field, ": must have at most ", max_bytes, " bytes")),
                           "REQUEST_TOO_LARGE");
    }
    text += piece;
    const int64_t needed = text.size() > kTrustedBytes && announced_bytes >= text.size()
                               ? BodyMemory(std::min(announced_bytes, max_bytes))
                               : kBytesPerTextByte * static_cast<int64_t>(text.size());
    SIGHTLINE_RETURN_IF_ERROR(HoldMemory(memory, needed));
  }
}

template <typename Read>
absl::StatusOr<JobFile> TakeFile(PlanningJobs* jobs, const Client& client,
                                 const std::string& expected_digest, Read read) {
  SIGHTLINE_ASSIGN_OR_RETURN(FileUpload upload, jobs->Upload(client));
  for (;;) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::string piece, read());
    if (piece.empty()) return upload.Finish(expected_digest);
    SIGHTLINE_RETURN_IF_ERROR(upload.Write(piece));
  }
}

}  // namespace

bool IsMultipartForm(const HttpRequest& request) {
  return MediaType(request) == "multipart/form-data";
}

absl::StatusOr<int64_t> ReadInteger(const std::string& field, const std::string& text, int64_t min,
                                    int64_t max) {
  const auto value = ParseWhole(text);
  if (!value.ok() || *value < min || *value > max) {
    return InvalidFields({{field, absl::StrCat("is \"", text.substr(0, kMaxFieldBytes),
                                               "\", must be an integer from ", min, " to ", max)}});
  }
  return *value;
}

absl::StatusOr<TaskForm> ReadTaskForm(HttpExchange& exchange, PlanningJobs* jobs,
                                      const Client& client, SharedLimit::Share* memory) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string boundary,
                             MultipartBoundary(exchange.request().Header("content-type")));
  MultipartReader reader(boundary, [&exchange] { return exchange.ReadBody(); });
  const auto read = [&reader] { return reader.Read(); };
  TaskForm form;
  bool has_task = false;
  std::set<std::string> names;
  for (int parts = 1;; ++parts) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::optional<MultipartPart> part, reader.NextPart());
    if (!part.has_value()) break;
    if (parts > kMaxParts) {
      return absl::InvalidArgumentError(
          absl::StrCat("multipart/form-data: must have at most ", kMaxParts, " parts"));
    }
    const std::string& field = part->name;
    if (field == "task") {
      if (has_task) return InvalidFields({{"task", "is given twice"}});
      has_task = true;
      SIGHTLINE_ASSIGN_OR_RETURN(std::string json,
                                 ReadText("task", kMaxJsonBytes, 0, memory, read));
      // Parsed before the files arrive, so that a task that cannot be read is refused at once.
      SIGHTLINE_RETURN_IF_ERROR(ParseBody(std::move(json), "task", "task.", memory, &form.task));
      continue;
    }
    if (field == "priority") {
      if (form.has_priority) return InvalidFields({{"priority", "is given twice"}});
      form.has_priority = true;
      SIGHTLINE_ASSIGN_OR_RETURN(std::string text,
                                 ReadText("priority", kMaxFieldBytes, 0, memory, read));
      SIGHTLINE_ASSIGN_OR_RETURN(int64_t priority, ReadInteger("priority", text, -100, 100));
      form.priority = static_cast<int>(priority);
      continue;
    }
    const std::string& name = part->filename.empty() ? field : part->filename;
    const std::string place = absl::StrCat("files[", form.files.size(), "].name");
    if (!IsValidUtf8(name)) return InvalidFields({{place, "must be UTF-8"}});
    if (absl::Status status = CheckFileName(name); !status.ok()) {
      return FieldViolations(status).empty()
                 ? InvalidFields({{place, std::string(status.message())}})
                 : status;
    }
    if (!names.insert(name).second) {
      return InvalidFields({{place, absl::StrCat("\"", name, "\" is given twice")}});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(JobFile file, TakeFile(jobs, client, "", read));
    file.name = name;
    form.files.push_back(std::move(file));
  }
  if (!has_task) {
    return InvalidFields({{"task",
                           "is missing; the form needs a field of this name with the JSON "
                           "of a planning task"}});
  }
  return form;
}

absl::Status ReadJsonBody(HttpExchange& exchange, bool may_be_empty, SharedLimit::Share* memory,
                          google::protobuf::Message* message) {
  const std::string type = MediaType(exchange.request());
  if (type != "application/json" && !(type.empty() && may_be_empty)) {
    return UnsupportedMediaType("application/json");
  }
  const auto announced = ParseUnsigned(exchange.request().Header("content-length"));
  SIGHTLINE_ASSIGN_OR_RETURN(
      std::string json,
      ReadText("body", kMaxJsonBytes, announced.ok() ? static_cast<size_t>(*announced) : 0, memory,
               [&exchange] { return exchange.ReadBody(); }));
  if (json.empty() && may_be_empty) return absl::OkStatus();
  if (type.empty()) return UnsupportedMediaType("application/json");
  return ParseBody(std::move(json), "body", "", memory, message);
}

absl::StatusOr<JobFile> ReadFileBody(HttpExchange& exchange, PlanningJobs* jobs,
                                     const Client& client, const std::string& expected_digest) {
  if (IsMultipartForm(exchange.request())) {
    return UnsupportedMediaType("application/octet-stream: the bytes of the file themselves");
  }
  return TakeFile(jobs, client, expected_digest, [&exchange] { return exchange.ReadBody(); });
}

}  // namespace sightline
