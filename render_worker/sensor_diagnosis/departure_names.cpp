// SPDX-License-Identifier: Apache-2.0
// The vocabulary's functions have names that types of render_worker/sensor have, too; hence this
// file is compiled by itself and includes none of them.
#include "render_worker/sensor_diagnosis/departure_names.h"

#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

std::string IdOf(const Effect& effect) { return std::string(effect.description().id); }

}  // namespace

const VocabularyNames& NamesInVocabulary() {
  static const auto& names =
      *new VocabularyNames{.stray_light = IdOf(AmbientLight()),
                           .quadratic_response = IdOf(ResponseNonlinearity()),
                           .brighter_fatter = IdOf(BrighterFatter()),
                           .dark_column_pattern = IdOf(DsnuColumnPattern()),
                           .hot_pixels = IdOf(HotPixels()),
                           .row_noise = IdOf(RowNoise()),
                           .missing_codes = IdOf(AdcMissingBits()),
                           .odd_even_width = IdOf(AdcInl())};
  return names;
}

}  // namespace sightline
