// SPDX-License-Identifier: Apache-2.0
// Where an effect shows, and what it grows with: in the words of the recordings format.
#pragma once

#include <string_view>
#include <vector>

namespace sightline {

struct EffectSignature {
  std::vector<std::string_view> regions;
  std::vector<std::string_view> depends_on;
};

// Of an effect of the vocabulary, by id; empty for others.
EffectSignature SignatureOf(std::string_view id);

}  // namespace sightline
