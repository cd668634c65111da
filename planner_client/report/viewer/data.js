// SPDX-License-Identifier: Apache-2.0
// Reads the numbers that viewer_data.cpp wrote.

function bytes(text) {
  const binary = atob(text);
  const result = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) result[i] = binary.charCodeAt(i);
  return result;
}

const array = (Type, text) => new Type(bytes(text).buffer);

/** Bit i of a little-endian bit set. */
export const hasBit = (bits, i) => (bits[i >> 3] >> (i & 7)) & 1;

export function readViewerData(json) {
  const raw = JSON.parse(json);
  const metres = (text) => {
    const steps = array(Uint16Array, text);
    const result = new Float32Array(steps.length);
    for (let i = 0; i < steps.length; ++i) {
      result[i] = raw.origin_m[i % 3] + steps[i] * raw.quantum_m;
    }
    return result;
  };
  return {
    partMin: raw.part_min_m,
    partMax: raw.part_max_m,
    mesh: {
      positions: metres(raw.mesh.positions),
      normals: array(Int16Array, raw.mesh.normals),
      triangles: array(Uint32Array, raw.mesh.triangles),
      nearestTarget: array(Uint32Array, raw.mesh.nearest_target),
      edges: metres(raw.mesh.edges),
    },
    targets: {
      count: raw.targets.count,
      spacing: raw.targets.spacing_m,
      positions: metres(raw.targets.positions),
      measurable: bytes(raw.targets.measurable),
    },
    rig: raw.rig,
    robot: (raw.robot ?? []).map((solid) => (
      solid.triangles ? {triangles: array(Float32Array, solid.triangles)} : solid)),
    scans: raw.scans.map((scan) => ({...scan, covered: bytes(scan.covered)})),
    regions: raw.regions.map(withTargets),
    uncertainty: raw.uncertainty ? readUncertainty(raw.uncertainty) : null,
    reasons: raw.reasons ? {kinds: raw.reasons.kinds, ofTarget: bytes(raw.reasons.of_target)} : null,
    obstacles: raw.obstacles.map((obstacle) => ({
      ...obstacle,
      positions: array(Float32Array, obstacle.positions),
      triangles: array(Uint32Array, obstacle.triangles),
    })),
    regionsOfInterest: raw.regions_of_interest,
    depthPerPixel: raw.depth_per_pixel ? lengths(raw.depth_per_pixel, raw.depth_per_pixel.codes) : null,
  };
}

const withTargets = (region) => (region && {...region, targets: new Set(array(Uint32Array, region.targets))});

/** Lengths in metres from their codes: steps of equal ratio; 0 stays 0. */
function lengths({lowest_m: lowest, highest_m: highest}, text) {
  const ratio = Math.log(highest / lowest) / 65534;
  return Float64Array.from(array(Uint16Array, text),
      (code) => (code === 0 ? 0 : lowest * Math.exp(ratio * (code - 1))));
}

function readUncertainty(raw) {
  const metres = (text) => lengths(raw, text);
  return {
    total: metres(raw.total),
    noise: metres(raw.noise),
    sampling: metres(raw.sampling),
    calibration: metres(raw.calibration),
    admissible: metres(raw.admissible),
    relaxed: raw.relaxed_m,
    classes: bytes(raw.classes),
    sensitivities: raw.sensitivities.map((map) => map && {
      detection: metres(map.detection),
      calibration: map.calibration ? metres(map.calibration) : null,
    }),
    features: raw.features.map(withTargets),
  };
}

/** The largest of noise, sampling, calibration per target: 0, 1, 2. */
export function dominatingParts({noise, sampling, calibration}) {
  return Uint8Array.from(noise, (n, i) =>
    (calibration[i] > Math.max(n, sampling[i]) ? 2 : sampling[i] > n ? 1 : 0));
}

/** Number of the first scan (1, 2, ...) that measures each target; 0: none. */
export function firstScans(data) {
  const first = new Uint16Array(data.targets.count);
  data.scans.forEach((scan, index) => {
    for (let i = 0; i < first.length; ++i) {
      if (first[i] === 0 && hasBit(scan.covered, i)) first[i] = index + 1;
    }
  });
  return first;
}
