// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/equivalents.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace sightline::bench {
namespace {

constexpr std::array<std::string_view, 4> kAmplitude = {
    "illumination.power_error", "surface.albedo_error", "optics.transmission_error",
    "sensor.qe_error"};

}  // namespace

std::vector<std::string> PhysicallyEquivalent(const ActiveEffect& effect, const Sensor& camera) {
  const std::string_view id = effect.effect->description().id;
  std::vector<std::string> ids;
  const auto add = [&](std::string_view other) {
    if (other != id) ids.emplace_back(other);
  };
  const bool product = std::find(kAmplitude.begin(), kAmplitude.end(), id) != kAmplitude.end();
  // A Bayer sensor's efficiencies may differ: then no common factor stands for them.
  if (product && (id != "sensor.qe_error" || camera.colour_filter == ColourFilter::kMono)) {
    for (const std::string_view other : kAmplitude) add(other);
  }
  if (id == "sensor.response_nonlinearity") add("sensor.adc_inl");
  if (id == "surface.depolarisation") add("illumination.partial_coherence");
  // Up to two equally strong patterns are also what partly polarised light makes.
  if (id == "illumination.partial_coherence" && effect.parameters[0] <= 2) {
    add("surface.depolarisation");
  }
  return ids;
}

}  // namespace sightline::bench
