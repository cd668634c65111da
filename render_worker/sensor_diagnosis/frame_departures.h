// SPDX-License-Identifier: Apache-2.0
// What changes from frame to frame, or ties the noise of pixels together: light that flickers or
// drifts, a black level that wanders, lag, noise of whole rows and columns, charge that pixels
// share; and what the converter does to numbers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Standard deviation from frame to frame of the mean of all pixels, without what temporal noise of
// the pixels gives [DN], over all given steps.
double ScatterOfFrameMeans(std::span<const FlatFieldStatistics* const> steps);

// Flicker and drift of the light (bright steps: relative), or of the black level (dark: DN).
// Material: flicker from 0.1 % on, drift from 0.1 % over the series on; of the black level 0.1 DN.
std::vector<Departure> FrameMeanDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           bool dark);

// Noise of consecutive frames is correlated: frames are averaged, or signal is carried over after
// the electrons are counted. (Charge that stays in the pixel does not correlate noise: every
// electron is in one frame only.) Steps of at least four frames show it. Material from 0.2 % on.
Departure FrameCorrelation(std::span<const FlatFieldStatistics* const> steps);

// First frames of steps differ from second ones: charge lag after a change of the light, or light
// that settles. Material from 0.1 % on.
Departure FirstFrameDeficit(std::span<const FlatFieldStatistics* const> steps);

// Temporal noise that all pixels of a row or of a column have in common, in the dark. Material from
// 1 % of the pixels' variance on.
std::vector<Departure> LineNoiseDepartures(std::span<const FlatFieldStatistics* const> dark);

// Covariance of neighbouring pixels' noise over the signal: a constant part (readout), one
// proportional to it (coupling after the electrons are counted, like interpixel capacitance;
// diffusing electrons stay independent), one to its square (brighter-fatter: charge keeps charge
// away). `signal_dn`: of each step, above the dark level. Material: correlation from 0.2 % on.
std::vector<Departure> NeighbourDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           std::span<const double> signal_dn);

// Counts of all values [0, 2^bits), of all frames together. Where the camera clips is found from
// them; the lowest and the highest value that occur are taken for clipped ones.
std::vector<Departure> ConverterDepartures(const std::vector<int64_t>& counts, int bit_depth_bit,
                                           double share_of_dark_at_zero);

}  // namespace sightline
