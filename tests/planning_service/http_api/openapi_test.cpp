// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/openapi.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "sightline/v1/planning_task.pb.h"

namespace sightline {
namespace {

using nlohmann::json;

// Every "$ref" below `node`.
void CollectReferences(const json& node, std::vector<std::string>* references) {
  if (node.is_object() && node.contains("$ref")) references->push_back(node["$ref"]);
  for (const auto& child : node) {
    if (child.is_structured()) CollectReferences(child, references);
  }
}

TEST(OpenApi, EveryReferenceLeadsSomewhere) {
  const json document = json::parse(OpenApiJson());
  std::vector<std::string> references;
  CollectReferences(document, &references);
  EXPECT_GT(references.size(), 50u);
  for (const std::string& reference : references) {
    ASSERT_EQ(reference.substr(0, 2), "#/");
    EXPECT_TRUE(document.contains(json::json_pointer(reference.substr(1)))) << reference;
  }
}

TEST(OpenApi, SchemasFollowTheMessages) {
  const json schemas = json::parse(OpenApiJson())["components"]["schemas"];
  const json& task = schemas["PlanningTask"];
  const auto* type = v1::PlanningTask::descriptor();
  ASSERT_EQ(task["properties"].size(), static_cast<size_t>(type->field_count()));
  for (int i = 0; i < type->field_count(); ++i) {
    EXPECT_TRUE(task["properties"].contains(type->field(i)->name())) << type->field(i)->name();
  }
  EXPECT_EQ(task["additionalProperties"], false);
  EXPECT_THAT(schemas["PlanningJob"]["properties"]["state"]["enum"],
              ::testing::Contains(json("SUCCEEDED")));
  EXPECT_EQ(schemas["PlanningJob"]["properties"]["created_at"]["format"], "date-time");
  EXPECT_FALSE(schemas["PlanningJob"].contains("additionalProperties"));
}

TEST(OpenApi, DescribesEveryPath) {
  const json paths = json::parse(OpenApiJson())["paths"];
  const std::map<std::string, std::vector<std::string>> expected = {
      {"/v1/jobs", {"get", "post"}},
      {"/v1/jobs/{job_id}", {"get", "delete"}},
      {"/v1/jobs/{job_id}/events", {"get"}},
      {"/v1/jobs/{job_id}/results", {"get"}},
      {"/v1/jobs/{job_id}/results/{name}", {"get"}},
      {"/v1/files", {"put"}},
      {"/v1/recipes/{recipe_id}", {"put", "delete"}},
      {"/v1/recipes/{recipe_id}/start", {"post"}},
      {"/v1/state", {"get"}},
      {"/v1/openapi.json", {"get"}},
      {"/healthz", {"get"}},
  };
  EXPECT_EQ(paths.size(), expected.size());
  for (const auto& [path, methods] : expected) {
    for (const std::string& method : methods) {
      EXPECT_TRUE(paths.value(path, json::object()).contains(method)) << method << " " << path;
    }
  }
}

}  // namespace
}  // namespace sightline
