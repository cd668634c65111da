// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/law/random_effect.h"

#include <cassert>

namespace sightline {

std::unique_ptr<const RandomEffect> MakeRandomEffect(RandomLaw law, const SetModel& model) {
  switch (law) {
    case RandomLaw::kNone:
      break;
    case RandomLaw::kPower:
      return MakePower(model);
    case RandomLaw::kCorrelatedPower:
      return MakeCorrelatedPower(model);
    case RandomLaw::kExposureTime:
      return MakeExposureTime(model);
    case RandomLaw::kScaledExposureTime:
      return MakeScaledExposureTime(model);
    case RandomLaw::kGaussianReflectance:
    case RandomLaw::kExponentialReflectance:
      return MakeReflectance(law, model);
    case RandomLaw::kVibration:
      return MakeVibration(model);
    case RandomLaw::kCorrelatedMovement:
      return MakeCorrelatedMovement(model);
  }
  assert(false && "the effect has no random law");
  return nullptr;
}

}  // namespace sightline
