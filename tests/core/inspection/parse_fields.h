// SPDX-License-Identifier: Apache-2.0
// Inspections of which a test gives the fields that matter to it.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"

namespace sightline {

// Inspection of a part a.glb in the folder parts/; `fields`: JSON members beside it, may be empty.
inline absl::StatusOr<Inspection> ParseFields(const std::string& fields) {
  v1::Inspection message;
  const std::string json =
      R"({"part": {"file": "a.glb"})" + (fields.empty() ? "" : ", " + fields) + "}";
  const absl::Status status = ParseStrictJson(json, "bracket.json", &message);
  EXPECT_TRUE(status.ok()) << status;
  return ParseInspection(message, "bracket.json", "parts");
}

// Message of the error that `fields` must give.
inline std::string ErrorOfFields(const std::string& fields) {
  const absl::StatusOr<Inspection> inspection = ParseFields(fields);
  EXPECT_EQ(inspection.status().code(), absl::StatusCode::kInvalidArgument) << fields;
  return std::string(inspection.status().message());
}

}  // namespace sightline
