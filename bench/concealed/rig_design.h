// SPDX-License-Identifier: Apache-2.0
// Rigs and shot lists drawn at random, like those of the labelled sets of the recordings format but
// with other numbers.
#pragma once

#include <cstdint>
#include <string>

#include "core/recordings/recordings.h"

namespace sightline::bench {

enum class SetSize {
  kFull,   // some 44 recordings of 384 x 256
  kSmall,  // 13 recordings of 192 x 160, one of every essential series
};

// Nominal description of a rig and what is recorded with it: camera (mono 10 bit, mono 12 bit of
// low noise, Bayer 10 bit, Bayer 12 bit), lens, laser, surface, uncertainties, shot list in a
// random order with bursts kept together. Exposures put the mean crest of the line to about a third
// of full scale. Depends on the arguments only.
RecordingSet DrawRig(uint64_t seed, const std::string& name, SetSize size);

// True minus nominal values: normal with these standard uncertainties, clipped at two of them.
// line_position_each_px stays a standard deviation.
SetupDeviation DrawDeviation(const SetupDeviation& uncertainty, uint64_t seed);

}  // namespace sightline::bench
