// SPDX-License-Identifier: Apache-2.0
// Early return of errors.
#pragma once

#include "absl/status/status.h"

// Evaluates an expression of type absl::Status, and returns it from the function if it is an error.
#define SIGHTLINE_RETURN_IF_ERROR(expression)                               \
  do {                                                                      \
    if (absl::Status status_ = (expression); !status_.ok()) return status_; \
  } while (false)
