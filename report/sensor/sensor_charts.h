// SPDX-License-Identifier: Apache-2.0
// Charts of a camera's diagnosis: photon transfer, linearity, noise, and curves of departures.
#pragma once

#include "report/document/report_parts.h"
#include "report/sensor/sensor_view.h"

namespace sightline {

// Empty without steps below saturation.
ReportBlocks PhotonTransferBlocks(const SensorView& view);

// Empty without curves.
ReportBlocks SensorCurveBlocks(const v1::SensorDiagnosis& diagnosis);

}  // namespace sightline
