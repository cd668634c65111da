// SPDX-License-Identifier: Apache-2.0
#include "report/recordings/line_range.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sightline {

std::pair<double, double> LineRange(const std::vector<double>& rows,
                                    const std::vector<double>& signal) {
  assert(!rows.empty() && rows.size() == signal.size());
  double least = INFINITY, most = -INFINITY;
  for (const double value : signal) {
    if (!std::isfinite(value)) continue;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  const std::pair<double, double> all = {rows.front(), rows.back()};
  if (!(most > least)) return all;
  double first = INFINITY, last = -INFINITY;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!(signal[i] > least + 0.05 * (most - least))) continue;
    first = std::min(first, rows[i]);
    last = std::max(last, rows[i]);
  }
  if (!(first <= last)) return all;
  const double middle = 0.5 * (first + last);
  const double half = std::max(12.0, 1.5 * (last - first));
  const std::pair<double, double> range = {std::max(all.first, middle - half),
                                           std::min(all.second, middle + half)};
  return range.first < range.second ? range : all;
}

}  // namespace sightline
