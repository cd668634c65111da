// SPDX-License-Identifier: Apache-2.0
// Distribution of facet normals of a rough surface: GGX (Walter et al., EGSR 2007), anisotropic,
// with height-correlated Smith masking (Heitz, JCGT 2014). Directions are in the local frame (z:
// normal).
#pragma once

#include <Eigen/Core>

namespace sightline {

struct GgxRoughness {
  float alpha_x = 0.3F;
  float alpha_y = 0.3F;
};

// D(h) [1/sr]; its projected area integrates to 1.
float GgxDistribution(const GgxRoughness& roughness, const Eigen::Vector3f& half);

// Smith's Lambda; 0 along the normal.
float GgxLambda(const GgxRoughness& roughness, const Eigen::Vector3f& direction);

// Fraction of facets visible from one direction, 1/(1 + Lambda), or from two, 1/(1 + Lambda +
// Lambda'). With one direction along the normal both agree: 2/(1 + sqrt(1 + alpha^2 tan^2)).
float GgxMasking(const GgxRoughness& roughness, const Eigen::Vector3f& direction);
float GgxMaskingShadowing(const GgxRoughness& roughness, const Eigen::Vector3f& out,
                          const Eigen::Vector3f& in);

// D G / (4 cos cos): the BRDF for a Fresnel factor of 1. Both directions above the surface.
float GgxReflection(const GgxRoughness& roughness, const Eigen::Vector3f& out,
                    const Eigen::Vector3f& in);

// Samples a facet normal in proportion to its area visible from `out` (Heitz, JCGT 2018), with u1,
// u2 in [0, 1).
Eigen::Vector3f SampleVisibleNormal(const GgxRoughness& roughness, const Eigen::Vector3f& out,
                                    float u1, float u2);

// Density [1/sr] of the direction reflected at a normal sampled in this way.
float VisibleNormalReflectionPdf(const GgxRoughness& roughness, const Eigen::Vector3f& out,
                                 const Eigen::Vector3f& in);

// Mirror direction of `out` at a facet.
Eigen::Vector3f ReflectAt(const Eigen::Vector3f& half, const Eigen::Vector3f& out);

// cos/pi over the upper hemisphere (Malley's method).
Eigen::Vector3f SampleCosine(float u1, float u2);

}  // namespace sightline
