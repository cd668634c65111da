// SPDX-License-Identifier: Apache-2.0
// Section on how well the selected model predicts recordings that it was not fitted to.
#pragma once

#include <string>

#include "report/document/report_parts.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// `named_model`: description of the model of diagnosis.named_check; empty: the nominal one. The
// result is empty if there was no check.
ReportBlocks PredictiveCheckBlocks(const v1::Diagnosis& diagnosis, const std::string& named_model);

}  // namespace sightline
