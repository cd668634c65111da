#include "render_worker/diagnosis/smear_trail.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sightline {

bool IsSmear(const ActiveEffect& active) {
  return active.effect->description().id == "sensor.smear";
}

SmearTrail TrailOfSmear(const Image<double>& total, const Image<double>& steady,
                        const FrameSetup& frame, std::span<const ActiveEffect> effects,
                        const LineSpeckle* speckle) {
  SmearTrail trail;
  const auto smear = std::find_if(effects.begin(), effects.end(), IsSmear);
  if (smear == effects.end() || smear->parameters[0] == 0) return trail;
  const auto added = [&](const Image<double>& electrons) {
    Image<double> after = electrons;
    smear->effect->OnMeanElectrons(after, nullptr, frame, smear->parameters);
    for (size_t i = 0; i < after.values.size(); ++i) after.values[i] -= electrons.values[i];
    return after;
  };
  trail.steady = added(steady);
  trail.laser = added(total);
  for (size_t i = 0; i < trail.laser.values.size(); ++i) {
    trail.laser.values[i] -= trail.steady.values[i];
  }
  if (speckle == nullptr) return trail;
  std::vector<double> light(total.rows_px);
  for (int row = 0; row < total.rows_px; ++row) light[row] = total.At(row, 0) - steady.At(row, 0);
  trail.crest_row = static_cast<int>(std::max_element(light.begin(), light.end()) - light.begin());
  const SpecklePixelCovariance& crest = speckle->At(
      speckle->PlaceOf((frame.roi.row_px + trail.crest_row) * frame.sensor.pixel_pitch_m));
  double sum = 0, product = 0;
  for (int a = 0; a < total.rows_px; ++a) {
    sum += light[a];
    const int last = std::min(total.rows_px - 1, a + crest.max_lag());
    for (int b = std::max(0, a - crest.max_lag()); b <= last; ++b) {
      product += light[a] * light[b] * crest.At(b - a, 0);
    }
  }
  if (sum > 0) trail.contrast_kept = std::sqrt(std::max(0.0, product / crest.At(0, 0))) / sum;
  return trail;
}
}  // namespace sightline
