// What scans may be, as a message on its own.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"

namespace sightline {

// Every parameter inside Table 2.1; what is not given has its bounds. INVALID_ARGUMENT.
absl::StatusOr<MeasurementDomain> ParseMeasurementDomain(const v1::MeasurementDomain& message,
                                                         const std::string& context);

// Every parameter written out.
v1::MeasurementDomain MeasurementDomainToProto(const MeasurementDomain& domain);

}  // namespace sightline
