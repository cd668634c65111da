// SPDX-License-Identifier: Apache-2.0
// Early return of errors. The macros are for functions and lambdas that return absl::Status,
// absl::StatusOr or another type to which absl::Status converts:
//
//   absl::StatusOr<Scene> ReadScene(const std::string& file) {
//     SIGHTLINE_RETURN_IF_ERROR(CheckFileName(file));
//     SIGHTLINE_ASSIGN_OR_RETURN(const std::string text, ReadRegularFile(file, kMostBytes));
//     return ParseScene(text);
//   }
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Evaluates an expression of type absl::Status, and returns it from the function if it is an error.
#define SIGHTLINE_RETURN_IF_ERROR(...)                                           \
  do {                                                                           \
    if (absl::Status sightline_status = (__VA_ARGS__); !sightline_status.ok()) { \
      return sightline_status;                                                   \
    }                                                                            \
  } while (false)

// Evaluates an expression (the arguments after the first) of type absl::StatusOr. The macro returns
// its status from the function if that is an error, and moves its value to `target` otherwise.
// `target` declares a variable or is one: `const Part part`, `auto part`, `scene.part`.
// The preprocessor splits `target` at commas: a type with several template arguments is written
// as auto. The macro is several statements, so a branch that consists of it needs braces.
#define SIGHTLINE_ASSIGN_OR_RETURN(target, ...)                                           \
  SIGHTLINE_ASSIGN_OR_RETURN_BY_(SIGHTLINE_JOIN_(sightline_status_or_, __LINE__), target, \
                                 __VA_ARGS__)

// Two steps, because ## joins its operands before __LINE__ is a number.
#define SIGHTLINE_JOIN_(name, line) SIGHTLINE_JOIN_NOW_(name, line)
#define SIGHTLINE_JOIN_NOW_(name, line) name##line
#define SIGHTLINE_ASSIGN_OR_RETURN_BY_(status_or, target, ...) \
  auto status_or = (__VA_ARGS__);                              \
  if (!status_or.ok()) return std::move(status_or).status();   \
  target = *std::move(status_or)
