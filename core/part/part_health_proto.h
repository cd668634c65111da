// SPDX-License-Identifier: Apache-2.0
// The health report as a message.
#pragma once

#include "core/part/part_health.h"
#include "sightline/v1/part.pb.h"

namespace sightline {

v1::PartHealth PartHealthToProto(const PartHealth& health);

}  // namespace sightline
