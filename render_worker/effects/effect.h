// SPDX-License-Identifier: Apache-2.0
// Physical effects as modules that plug into one stage of the image chain. The renderer switches
// them on, the diagnosis fits them: the same code.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/optics/image_optics.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

enum class Stage { kIllumination, kSurface, kOptics, kGeometry, kSensor, kTime };

// One number of an effect.
struct EffectParameter {
  std::string_view name;  // with its unit, as in the recordings format's vocabulary
  double null_value;    // all at null: as if left out, bit by bit; of a mere shape: a typical value
  double lower, upper;  // physical bounds; lower <= null_value <= upper
  // Half of all rigs that have the effect are believed to deviate from the null value by less than
  // this (scale of the prior, in the parameter's unit; > 0).
  double prior_scale;
  // Of a shape: values from which to search besides the null value, where one does not lead to
  // another (a place, a phase, a period).
  std::vector<double> starts = {};
  // Of an amount that may be anything from hardly seen to blinding: as many decades below
  // `prior_scale` are believed to be equally likely. 0: as above.
  double decades = 0;
};

// How an effect moves charge between neighbouring pixels.
enum class ChargeTransport {
  kNone,
  kProportional,     // a fixed share of the charge
  kGrowsWithCharge,  // a larger share the more charge there is
};

struct EffectDescription {
  std::string_view id;  // "optics.veiling_glare"
  Stage stage;
  // Its realisation is drawn by chance and cannot be known: it does not change the expectation of a
  // pixel, only how pixels or recordings scatter.
  bool is_drawn = false;
  ChargeTransport charge_transport = ChargeTransport::kNone;
  std::string_view summary;    // one line of physics
  std::string_view reference;  // paper, standard clause or book
  std::vector<EffectParameter> parameters;

  bool MovesCharge() const { return charge_transport != ChargeTransport::kNone; }
};

// What an effect does, by place in the chain. Every hook gets the parameters in the order of the
// description, and leaves its argument bit-identical when they have their null values. Hooks are
// pure: what is drawn at random comes from the frame's seeds.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual const EffectDescription& description() const = 0;

  using Parameters = std::span<const double>;
  // Numbers of the frame: power, distances, f-number, gain, exposure time, ...
  virtual void OnFrame(FrameSetup&, Parameters) const {}
  // Plate only: laser irradiance, reflectance, height, other light as functions of the place.
  virtual void OnPlate(PlateScene&, const FrameSetup&, Parameters) const {}
  // Ideal image at the sub-pixels.
  virtual void OnIdealImage(IdealImage&, const FrameSetup&, Parameters) const {}
  // Pupil, defocus over the field, transfer functions of the sensor plane.
  virtual void OnOptics(OpticsModel&, const FrameSetup&, Parameters) const {}
  virtual void OnSpeckle(SpeckleModel&, const FrameSetup&, Parameters) const {}
  // Irradiance of the pixels.
  virtual void OnPixelIrradiance(PixelIrradiance&, const FrameSetup&, Parameters) const {}
  // Mean photo-electrons, before noise. `previous`: those of the frame read out before this one in
  // the same burst (nullptr: none).
  virtual void OnMeanElectrons(Image<double>&, const Image<double>* /*previous*/, const FrameSetup&,
                               Parameters) const {}
  // Charge after noise, before conversion.
  virtual void OnElectrons(Image<double>&, const FrameSetup&, Parameters) const {}
  // Raw numbers.
  virtual void OnRaw(Image<uint16_t>&, const FrameSetup&, Parameters) const {}
};

// All effects of the vocabulary, by id.
std::span<const Effect* const> AllEffects();
// nullptr: unknown.
const Effect* FindEffect(std::string_view id);

// An effect with its strength.
struct ActiveEffect {
  const Effect* effect = nullptr;
  std::vector<double> parameters;
};

// Checks id, names and bounds; left-out parameters are null. INVALID_ARGUMENT names the effect, the
// parameter, the value, the allowed range, and the nearest known name.
struct NamedValue {
  std::string name;
  double value;
};
absl::StatusOr<ActiveEffect> MakeActiveEffect(std::string_view id,
                                              const std::vector<NamedValue>& parameters);

// Puts effects into the order in which they act, that of AllEffects, so that the image does not
// depend on the order in which they were listed. INVALID_ARGUMENT: one is there twice.
absl::Status OrderEffects(std::vector<ActiveEffect>* effects);

}  // namespace sightline
