// SPDX-License-Identifier: Apache-2.0
// Whether recordings that were not fitted are predicted, kind by kind and setting by setting.
#pragma once

#include <string>

#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// HTML of a report's section; empty if no prediction was made. `named_model`: text, what the most
// probable model with a name is called; empty if that is the null model.
std::string PredictiveCheckHtml(const v1::Diagnosis& diagnosis, const std::string& named_model);

}  // namespace sightline
