// SPDX-License-Identifier: Apache-2.0
// One group of bars for every recording, on a logarithmic scale about 1, as a drawing.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct RecordingBar {
  std::string css_class;  // its colour, see charts.css
  double value = 1;       // > 0; above 1 the bar goes up, below 1 down
};

struct RecordingBars {
  std::string label;
  std::string note;     // shown on pointing at it
  bool marked = false;  // shaded
  std::vector<RecordingBar> bars;
};

// An <svg> element, coloured by the page's CSS variables.
std::string RecordingBarsSvg(const std::string& value_title,
                             const std::vector<RecordingBars>& recordings);

}  // namespace sightline
