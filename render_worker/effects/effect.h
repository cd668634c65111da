// SPDX-License-Identifier: Apache-2.0
// Physical effects as modules for one stage of the image chain. The renderer and the diagnosis use
// the same code: one applies the effects, the other fits them.
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
  // Scale of the prior, in the parameter's unit, > 0: half of all rigs with the effect are believed
  // to deviate less than this from the null value.
  double prior_scale;
  // Start values of a search, in addition to the null value, for a shape parameter (a position, a
  // phase, a period) in which a fit cannot move from one value to another.
  std::vector<double> starts = {};
  // Decades below `prior_scale` that are equally likely, for an amount that may be anything from
  // barely visible to blinding. 0: the prior is that of `prior_scale` alone.
  double decades = 0;
  // The only values of a count besides the null value (blades of an aperture, missing bits); each
  // is tried, none is fitted. Empty: the parameter is continuous.
  std::vector<double> discrete_values = {};
};

// How an effect moves charge along a whole column of the sensor.
enum class ColumnTransport {
  kNone,
  kReadout,   // every pixel of the column gains a share of the column's sum
  kOverflow,  // a fraction (parameter 0) of the charge above a threshold (parameter 1) [electrons]
};

// How an effect moves charge between neighbouring pixels.
enum class ChargeTransport {
  kNone,
  kProportional,     // a fixed share of the charge
  kGrowsWithCharge,  // a larger share the more charge there is
};

// Regions of an image in which an effect shows, and settings on which its size depends, as named in
// the recordings format ("line_core", "background"; "f_number", "exposure_time_s").
struct EffectSignature {
  std::vector<std::string_view> regions = {}, depends_on = {};
};

// An effect either changes the expectation of every recording, or is random: only the distribution
// of its realised values is known, which differ from pixel to pixel, row to row, ...
enum class EffectKind {
  kExpected,
  kRandomPerPixel,
  kRandomPerRow,
  kRandomPerColumn,
  kRandomPerRecording,
  kRandomPerPlace,  // on the plate
};

// Distribution of the amplitudes of a random effect per recording or per place. Its covariance
// function is in render_worker/diagnosis/random_effect; its parameters are those of the effect.
enum class RandomLaw {
  kNone,
  kPower,                // independent relative deviations of the power
  kCorrelatedPower,      // relative deviations of the power with a correlation time
  kExposureTime,         // independent deviations of the exposure time
  kScaledExposureTime,   // deviations in proportion to a power of the exposure time
  kGaussianReflectance,  // a texture of the plate with a Gaussian autocorrelation
  kExponentialReflectance,
  kVibration,           // sinusoidal movement across the line with a random phase
  kCorrelatedMovement,  // movement across the line with a correlation time
};

// Source of start values if a fit cannot move from one shape to another.
enum class StartSearch {
  kGrid,                 // EffectParameter::starts
  kPeriodogramOfTime,    // peaks of a periodogram over the recordings' timestamps
  kPeriodogramOfSensor,  // peaks of a periodogram over rows and columns of the sensor
};

// Images on which an effect acts. An inspection may have another set-up than the recordings, and it
// shows a part.
enum class EffectScope {
  kAnyImage,        // the same effect acts on images of parts
  kFlatPlate,       // acts on flat plates only: the renderer rejects it for parts
  kRecordingSetUp,  // distances and angles of the recordings, no property of camera, lens or laser
};

// A number of an inspection (docs/api) that has the same meaning as a parameter
// of an effect.
struct InspectionField {
  // Dotted path such as "laser.power_w"; "materials.material." stands for every material of the
  // plate. Empty: images of parts cannot show this parameter.
  std::string_view field;
  enum Operation { kFactor, kShift } operation = kFactor;
  int parameter = 0;  // index of the parameter that is the factor, or what is added
  // True: the inspection keeps the effect itself if it does not state the number, or if the changed
  // number would be out of range. False: the number is clamped to its range.
  bool may_stay_an_effect = false;
  // The parameter is the radiance of the lit plate, but the field is that of the incident light: it
  // is divided by the reflectance of the plate.
  bool is_radiance_of_plate = false;
};

struct EffectDescription {
  std::string_view id;  // "optics.veiling_glare"
  Stage stage;
  // kExpected: the effect changes the expectation. Otherwise its realised value is unknown, and it
  // changes the variance of pixels or recordings.
  EffectKind kind = EffectKind::kExpected;
  RandomLaw random_law = RandomLaw::kNone;
  StartSearch start_search = StartSearch::kGrid;
  // False: recordings of a plate are uninformative about it for any set-up.
  bool plates_can_show_it = true;
  EffectSignature signature = {};
  EffectScope scope = EffectScope::kAnyImage;
  // Empty: no field of an inspection expresses the effect.
  std::vector<InspectionField> inspection_fields = {};
  // The diagnosis estimates the realised value of this random effect, so that its hooks act on the
  // expectation of each recording.
  bool realisation_is_estimated = false;
  // Its pattern may be finer than the segments over which statistics average, so that the
  // expectation of a segment is its mean over the segment's columns.
  bool finer_than_block = false;
  // Odd and even columns differ, so that a column does not represent its neighbours.
  bool columns_alternate = false;
  ColumnTransport column_transport = ColumnTransport::kNone;
  ChargeTransport charge_transport = ChargeTransport::kNone;
  std::string_view summary;    // one line of physics
  std::string_view reference;  // paper, standard clause or book
  std::vector<EffectParameter> parameters;

  bool IsRandom() const { return kind != EffectKind::kExpected; }
  bool ChangesExpectation() const { return !IsRandom() || realisation_is_estimated; }
  bool VariesOverSensor() const {
    return kind == EffectKind::kRandomPerPixel || kind == EffectKind::kRandomPerRow ||
           kind == EffectKind::kRandomPerColumn;
  }
  bool MovesCharge() const { return charge_transport != ChargeTransport::kNone; }
};

// Standard deviations of offsets that all pixels of a row or of a column have in common
// [electrons].
struct LineOffsets {
  double row_electrons = 0;     // new in every recording
  double column_electrons = 0;  // fixed for the sensor
};

// An effect acts on the image chain through hooks, one for each place in the chain. Every hook gets
// the parameters in the order of the description, and leaves its argument bit-identical when they
// have their null values. Hooks are pure: random numbers come from the frame's seeds.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual const EffectDescription& description() const = 0;

  using Parameters = std::span<const double>;
  // Numbers of the frame: power, distances, f-number, gain, exposure time, ...
  virtual void OnFrame(FrameSetup&, Parameters) const {}
  // Only plates: laser irradiance, reflectance, height, other light as functions of the position.
  virtual void OnPlate(PlateScene&, const FrameSetup&, Parameters) const {}
  // Ideal image at the sub-pixels.
  virtual void OnIdealImage(IdealImage&, const FrameSetup&, Parameters) const {}
  // Pupil, defocus over the field, transfer functions of the sensor plane.
  virtual void OnOptics(OpticsModel&, const FrameSetup&, Parameters) const {}
  virtual void OnSpeckle(SpeckleModel&, const FrameSetup&, Parameters) const {}
  // Irradiance of the pixels.
  virtual void OnPixelIrradiance(PixelIrradiance&, const FrameSetup&, Parameters) const {}
  // Mean photo-electrons, before noise. `previous`: those of the preceding frame in the same burst
  // (nullptr: none).
  virtual void OnMeanElectrons(Image<double>&, const Image<double>* /*previous*/, const FrameSetup&,
                               Parameters) const {}
  // Charge after noise, before conversion.
  virtual void OnElectrons(Image<double>&, const FrameSetup&, Parameters) const {}
  // Raw numbers.
  virtual void OnRaw(Image<uint16_t>&, const FrameSetup&, Parameters) const {}

  // Random effects on whole rows and columns set their variance here; the diagnosis uses it instead
  // of the realised offsets.
  virtual void OnLineOffsets(LineOffsets&, Parameters) const {}
  // Relative variance of the light of columns about the mean of a block of `columns_px` (>= 1)
  // columns, due to a pattern of unknown phase that is fixed on the sensor.
  virtual double VarianceWithinBlock(int /*columns_px*/, Parameters) const { return 0; }
};

// All effects of the vocabulary, by id.
std::span<const Effect* const> AllEffects();
// Returns nullptr for an unknown id.
const Effect* FindEffect(std::string_view id);

// An effect with its strength.
struct ActiveEffect {
  const Effect* effect = nullptr;
  std::vector<double> parameters;
};

// Checks id, names and bounds; omitted parameters have their null values. INVALID_ARGUMENT names
// the effect, the parameter, the value, the allowed range, and the nearest known name.
struct NamedValue {
  std::string name;
  double value;
};
absl::StatusOr<ActiveEffect> MakeActiveEffect(std::string_view id,
                                              const std::vector<NamedValue>& parameters);

// Sorts effects into the order in which they act, that of AllEffects, so that the image does not
// depend on the order of the list. INVALID_ARGUMENT if an effect appears twice.
absl::Status OrderEffects(std::vector<ActiveEffect>* effects);

}  // namespace sightline
