// SPDX-License-Identifier: Apache-2.0
#include "core/spelling/nearest_name.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

namespace sightline {
namespace {

constexpr size_t kMaxNameBytes = 100;  // bounds the work on absurd names

size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

std::pair<std::string, size_t> Nearest(const std::string& name,
                                       const std::vector<std::string>& known) {
  std::pair<std::string, size_t> best{"", std::numeric_limits<size_t>::max()};
  const std::string head = name.substr(0, kMaxNameBytes);
  for (const std::string& candidate : known) {
    // The unit is most often left out, so it counts as one edit.
    const size_t distance = candidate.starts_with(head + "_") ? 1 : EditDistance(head, candidate);
    if (distance < best.second) best = {candidate, distance};
  }
  return best;
}

}  // namespace

std::string NearestName(const std::string& name, const std::vector<std::string>& known) {
  return Nearest(name, known).first;
}

std::string LikelyName(const std::string& name, const std::vector<std::string>& known) {
  const auto [nearest, distance] = Nearest(name, known);
  return distance <= std::max<size_t>(2, name.size() / 3) ? nearest : "";
}

}  // namespace sightline
