// SPDX-License-Identifier: Apache-2.0
// Quantum efficiency not as stated, of all colours or of their ratio. On a mono sensor only
// qe_factor counts; on a Bayer sensor it is red's.
#include <initializer_list>
#include <optional>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr const char* kQuantumEfficiencyReference =
    "EMVA 1288 R4.0 Linear, section 2.1 (quantum efficiency)";

void ScaleEfficiency(QuantumEfficiencyCurve& curve, double factor) {
  for (double& efficiency : curve.quantum_efficiency) efficiency *= factor;
}

// Fields of single numbers and of curves. The arguments are the indices of the parameters that are
// the colours' factors. An inspection does not state the colours that its sensor lacks.
std::vector<InspectionField> EfficiencyFields(std::optional<int> red_or_mono, int green, int blue) {
  std::vector<InspectionField> fields;
  if (red_or_mono) {
    fields = {{.field = "camera.sensor.quantum_efficiency.mono", .parameter = *red_or_mono},
              {.field = "camera.sensor.quantum_efficiency.red", .parameter = *red_or_mono},
              {.field = "camera.sensor.quantum_efficiency_curve.mono", .parameter = *red_or_mono},
              {.field = "camera.sensor.quantum_efficiency_curve.red", .parameter = *red_or_mono}};
  }
  for (const InspectionField& field : std::initializer_list<InspectionField>{
           {.field = "camera.sensor.quantum_efficiency.green", .parameter = green},
           {.field = "camera.sensor.quantum_efficiency.blue", .parameter = blue},
           {.field = "camera.sensor.quantum_efficiency_curve.green", .parameter = green},
           {.field = "camera.sensor.quantum_efficiency_curve.blue", .parameter = blue}}) {
    fields.push_back(field);
  }
  return fields;
}

class QeErrorEffect final : public DescribedEffect {
 public:
  QeErrorEffect()
      : DescribedEffect(
            {.id = "sensor.qe_error",
             .stage = Stage::kSensor,
             .signature = {{"line_core", "whole_image"}, {"signal_level"}},
             .inspection_fields = EfficiencyFields(0, 1, 2),
             .summary = "quantum efficiency: true over stated (mono or red, green, blue)",
             .reference = kQuantumEfficiencyReference,
             .parameters = {{"qe_factor", 1, 0.1, 10, 0.1},
                            {"qe_factor_green", 1, 0.1, 10, 0.1},
                            {"qe_factor_blue", 1, 0.1, 10, 0.1}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
      ScaleEfficiency(frame.sensor.quantum_efficiency[channel], p[channel]);
    }
  }
};

class ColourResponseErrorEffect final : public DescribedEffect {
 public:
  ColourResponseErrorEffect()
      : DescribedEffect({.id = "sensor.colour_response_error",
                         .stage = Stage::kSensor,
                         .signature = {{"line_core", "whole_image"}, {"signal_level"}},
                         .inspection_fields = EfficiencyFields({}, 0, 1),
                         .summary = "ratio of the colours' quantum efficiencies, red as stated",
                         .reference = kQuantumEfficiencyReference,
                         .parameters = {{"qe_factor_green", 1, 0.1, 10, 0.1},
                                        {"qe_factor_blue", 1, 0.1, 10, 0.1}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (frame.sensor.colour_filter == ColourFilter::kMono) return;
    ScaleEfficiency(frame.sensor.quantum_efficiency[kGreen], p[0]);
    ScaleEfficiency(frame.sensor.quantum_efficiency[kBlue], p[1]);
  }
};

}  // namespace

const Effect& QeError() {
  static const QeErrorEffect effect;
  return effect;
}
const Effect& ColourResponseError() {
  static const ColourResponseErrorEffect effect;
  return effect;
}

}  // namespace sightline
