// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace sightline {

// The file itself is wrong; the message names it and says why.
class StepInputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace sightline
