// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/openapi.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/timestamp.pb.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "sightline/v1/planning_service.pb.h"
#include "sightline/v1/planning_task.pb.h"

// The assembler copies the file's bytes into read-only data; the build gives its path.
asm(".section .rodata\n"
    ".global sightline_http_openapi\n"
    "sightline_http_openapi:\n"
    ".incbin \"" SIGHTLINE_OPENAPI
    "\"\n"
    ".global sightline_http_openapi_end\n"
    "sightline_http_openapi_end:\n"
    ".byte 0\n"
    ".previous\n");
extern "C" const char sightline_http_openapi[];
extern "C" const char sightline_http_openapi_end[];

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using nlohmann::ordered_json;

// "sightline.v1.PlanningJob.State" -> "PlanningJob_State".
std::string SchemaName(const Descriptor& type) {
  absl::string_view name = type.full_name();
  absl::ConsumePrefix(&name, "sightline.v1.");
  return absl::StrReplaceAll(name, {{".", "_"}});
}

// `strict`: for requests, in which an unknown field is an error; answers may get new fields.
void AddSchema(const Descriptor& type, bool strict, ordered_json* schemas);

ordered_json ValueSchema(const FieldDescriptor& field, bool strict, ordered_json* schemas) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      if (field.message_type() == google::protobuf::Timestamp::descriptor()) {
        return {{"type", "string"}, {"format", "date-time"}};
      }
      AddSchema(*field.message_type(), strict, schemas);
      return {{"$ref", "#/components/schemas/" + SchemaName(*field.message_type())}};
    case FieldDescriptor::CPPTYPE_ENUM: {
      ordered_json names = ordered_json::array();
      for (int i = 0; i < field.enum_type()->value_count(); ++i) {
        names.push_back(field.enum_type()->value(i)->name());
      }
      return {{"type", "string"}, {"enum", names}};
    }
    case FieldDescriptor::CPPTYPE_STRING:
      if (field.type() == FieldDescriptor::TYPE_BYTES) {
        return {{"type", "string"}, {"format", "byte"}};
      }
      return {{"type", "string"}};
    case FieldDescriptor::CPPTYPE_BOOL:
      return {{"type", "boolean"}};
    case FieldDescriptor::CPPTYPE_FLOAT:
      return {{"type", "number"}, {"format", "float"}};
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return {{"type", "number"}, {"format", "double"}};
    case FieldDescriptor::CPPTYPE_INT32:
      return {{"type", "integer"}, {"format", "int32"}};
    case FieldDescriptor::CPPTYPE_INT64:
      return {{"type", "integer"}, {"format", "int64"}};
    case FieldDescriptor::CPPTYPE_UINT32:
    case FieldDescriptor::CPPTYPE_UINT64:
      return {{"type", "integer"}, {"minimum", 0}};
  }
  return ordered_json::object();
}

void AddSchema(const Descriptor& type, bool strict, ordered_json* schemas) {
  const std::string name = SchemaName(type);
  if (schemas->contains(name)) return;
  (*schemas)[name] = ordered_json::object();  // ends the recursion for recursive types
  ordered_json properties = ordered_json::object();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (field.is_map()) {
      properties[field.name()] = {
          {"type", "object"},
          {"additionalProperties",
           ValueSchema(*field.message_type()->map_value(), strict, schemas)}};
    } else if (field.is_repeated()) {
      properties[field.name()] = {{"type", "array"},
                                  {"items", ValueSchema(field, strict, schemas)}};
    } else {
      properties[field.name()] = ValueSchema(field, strict, schemas);
    }
  }
  ordered_json schema = {{"type", "object"}, {"properties", properties}};
  if (strict) schema["additionalProperties"] = false;
  (*schemas)[name] = schema;
}

}  // namespace

std::string OpenApiJson() {
  ordered_json document =
      ordered_json::parse(sightline_http_openapi, sightline_http_openapi_end, nullptr,
                          /*allow_exceptions=*/false);
  ordered_json& schemas = document["components"]["schemas"];
  AddSchema(*v1::PlanningTask::descriptor(), /*strict=*/true, &schemas);
  AddSchema(*v1::CreatePlanningJobRequest::descriptor(), /*strict=*/true, &schemas);
  AddSchema(*v1::PrepareRecipeRequest::descriptor(), /*strict=*/true, &schemas);
  AddSchema(*v1::StartJobRequest::descriptor(), /*strict=*/true, &schemas);
  AddSchema(*v1::PlanningJob::descriptor(), /*strict=*/false, &schemas);
  AddSchema(*v1::ListPlanningJobsResponse::descriptor(), /*strict=*/false, &schemas);
  AddSchema(*v1::PrepareRecipeResponse::descriptor(), /*strict=*/false, &schemas);
  AddSchema(*v1::UploadFileResponse::descriptor(), /*strict=*/false, &schemas);
  AddSchema(*v1::GetVisionStateResponse::descriptor(), /*strict=*/false, &schemas);
  return document.dump(1);
}

}  // namespace sightline
