// SPDX-License-Identifier: Apache-2.0
// Effects that recordings of plates in poses (docs/recordings.md, version 3) cannot show.
#pragma once

#include "render_worker/effects/effect.h"

namespace sightline {

// False: the reduction of these recordings to segments of the line removes the effect's change.
bool PosesCanShow(const EffectDescription& description);

// False: the effect is an error of an unstated value, or requires known amounts of light.
bool UnknownLightCanShow(const EffectDescription& description);

}  // namespace sightline
