// One effect each; its physics stands in the file named after it.
#pragma once

#include "render_worker/effects/effect.h"

namespace sightline {

const Effect& AmbientLight();
const Effect& PowerError();
const Effect& PowerDrift();
const Effect& PowerNoise();
const Effect& BeamQuality();
const Effect& BeamFocus();
const Effect& BeamShape();
const Effect& LineNonuniformity();
const Effect& LineBow();
const Effect& GhostLine();
const Effect& PartialCoherence();
const Effect& WavelengthError();

const Effect& AlbedoError();
const Effect& BrdfError();
const Effect& SubsurfaceScattering();
const Effect& Depolarisation();
const Effect& AlbedoTexture();
const Effect& TiltedPlate();
const Effect& CurvedPlate();
const Effect& Fluorescence();

const Effect& FNumberError();
const Effect& TransmissionError();
const Effect& FocusError();
const Effect& SphericalAberration();
const Effect& Coma();
const Effect& Astigmatism();
const Effect& FieldCurvature();
const Effect& VeilingGlare();
const Effect& LensReflection();
const Effect& RadialDistortion();
const Effect& TangentialDistortion();
const Effect& MechanicalVignetting();
const Effect& NaturalVignetting();
const Effect& PolygonAperture();
const Effect& CoverGlassEtalon();
const Effect& Dust();

const Effect& CameraDistanceError();
const Effect& LaserDistanceError();
const Effect& IncidenceAngleError();
const Effect& CameraRoll();
const Effect& LaserRoll();
const Effect& SensorTilt();

const Effect& ResponseNonlinearity();
const Effect& DarkCurrent();
const Effect& BlackLevelError();
const Effect& Prnu();
const Effect& DsnuColumnPattern();
const Effect& HotPixels();
const Effect& Crosstalk();
const Effect& BrighterFatter();
const Effect& Blooming();
const Effect& Smear();
const Effect& LowerFullWell();
const Effect& GainError();
const Effect& QeError();
const Effect& ColourResponseError();
const Effect& ReadNoiseExcess();
const Effect& RowNoise();
const Effect& AdcMissingBits();
const Effect& AdcInl();
const Effect& ImageLag();
const Effect& RollingShutter();

const Effect& VibrationBlur();
const Effect& PlateMotion();
const Effect& ExposureOffset();
const Effect& ExposureJitter();
const Effect& AmbientFlicker();
const Effect& TemperatureDrift();

}  // namespace sightline
