// SPDX-License-Identifier: Apache-2.0
// Base of all effects: holds the description.
#pragma once

#include <utility>

#include "render_worker/effects/effect.h"

namespace sightline {

class DescribedEffect : public Effect {
 public:
  const EffectDescription& description() const final { return description_; }

 protected:
  explicit DescribedEffect(EffectDescription description) : description_(std::move(description)) {}

 private:
  EffectDescription description_;
};

}  // namespace sightline
