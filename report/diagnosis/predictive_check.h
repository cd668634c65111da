// SPDX-License-Identifier: Apache-2.0
// Whether the named model predicts recordings it was not fitted to.
#pragma once

#include <string>

#include "report/document/report_parts.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// `named_model`: the model of diagnosis.named_check in words; empty: it is the nominal one. Empty:
// there was no check.
ReportBlocks PredictiveCheckBlocks(const v1::Diagnosis& diagnosis, const std::string& named_model);

}  // namespace sightline
