// SPDX-License-Identifier: Apache-2.0
// The effects, one function each; the physics is in the file named after each effect.
#pragma once

#include "render_worker/effects/effect.h"

// Order of the recordings format. Effects that wrap each other's functions of the plate compose
// correctly in this order (profile of the beam first, then its position on the plate).
#define SIGHTLINE_EFFECTS(X) \
  X(AmbientLight)            \
  X(PowerError)              \
  X(PowerDrift)              \
  X(PowerNoise)              \
  X(BeamQuality)             \
  X(BeamFocus)               \
  X(BeamShape)               \
  X(LineNonuniformity)       \
  X(LineBow)                 \
  X(GhostLine)               \
  X(PartialCoherence)        \
  X(WavelengthError)         \
  X(AlbedoError)             \
  X(BrdfError)               \
  X(SubsurfaceScattering)    \
  X(Depolarisation)          \
  X(AlbedoTexture)           \
  X(TiltedPlate)             \
  X(CurvedPlate)             \
  X(Fluorescence)            \
  X(FNumberError)            \
  X(TransmissionError)       \
  X(FocusError)              \
  X(SphericalAberration)     \
  X(Coma)                    \
  X(Astigmatism)             \
  X(FieldCurvature)          \
  X(VeilingGlare)            \
  X(LensReflection)          \
  X(RadialDistortion)        \
  X(TangentialDistortion)    \
  X(MechanicalVignetting)    \
  X(NaturalVignetting)       \
  X(PolygonAperture)         \
  X(CoverGlassEtalon)        \
  X(Dust)                    \
  X(CameraDistanceError)     \
  X(LaserDistanceError)      \
  X(IncidenceAngleError)     \
  X(CameraRoll)              \
  X(LaserRoll)               \
  X(SensorTilt)              \
  X(ResponseNonlinearity)    \
  X(DarkCurrent)             \
  X(BlackLevelError)         \
  X(Prnu)                    \
  X(DsnuColumnPattern)       \
  X(HotPixels)               \
  X(Crosstalk)               \
  X(BrighterFatter)          \
  X(Blooming)                \
  X(Smear)                   \
  X(LowerFullWell)           \
  X(GainError)               \
  X(ColumnGain)              \
  X(QeError)                 \
  X(ColourResponseError)     \
  X(MicroLensVignetting)     \
  X(ReadNoiseExcess)         \
  X(RowNoise)                \
  X(AdcMissingBits)          \
  X(AdcInl)                  \
  X(ImageLag)                \
  X(RollingShutter)          \
  X(VibrationBlur)           \
  X(PlateMotion)             \
  X(ExposureOffset)          \
  X(ExposureJitter)          \
  X(AmbientFlicker)          \
  X(TemperatureDrift)

namespace sightline {

#define X(effect) const Effect& effect();
SIGHTLINE_EFFECTS(X)
#undef X

}  // namespace sightline
