// SPDX-License-Identifier: Apache-2.0
// Unpacks the scene of a report (report_scene.proto).
import {unzlibSync} from 'three/examples/jsm/libs/fflate.module.js';

function bytes(text) {
  const binary = atob(text);
  const result = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) result[i] = binary.charCodeAt(i);
  return result;
}

/** Bytes compressed by zlib, in base64. */
const unpackBytes = (text) => (text ? unzlibSync(bytes(text)) : new Uint8Array(0));

/** Differences to the number `stride` places before; lowest bytes of all, then the next ones. */
function unpack(Type, text, stride = 1) {
  const raw = unpackBytes(text);
  const size = Type.BYTES_PER_ELEMENT, count = raw.length / size;
  if (!Number.isInteger(count)) throw new Error(`${raw.length} bytes are no list of numbers of ${size} bytes`);
  const result = new Type(count);
  for (let i = 0; i < count; ++i) {
    let difference = 0;
    for (let byte = 0; byte < size; ++byte) difference |= raw[byte * count + i] << (8 * byte);
    result[i] = difference + (i < stride ? 0 : result[i - stride]);
  }
  return result;
}

const floats = (text) => new Float32Array(unpackBytes(text).slice().buffer);

/** Bit i of a little-endian bit set. */
export const hasBit = (bits, i) => (bits[i >> 3] >> (i & 7)) & 1;

/** Groups of 16 numbers. */
const matrices = (numbers = []) =>
  Array.from({length: numbers.length / 16}, (_, i) => numbers.slice(16 * i, 16 * i + 16));

const solids = (list = []) => list.map((solid) => ({
  centre: solid.centre_m ?? [0, 0, 0], size: solid.size_m, radius: solid.radius_m, length: solid.length_m,
  triangles: solid.triangles ? floats(solid.triangles) : undefined,
}));

const place = (raw) => ({...raw, targets: new Set(unpack(Uint32Array, raw.targets))});

function lengths(raw) {
  if (!raw?.codes) return null;
  const ratio = Math.log(raw.highest_m / raw.lowest_m) / 65534;
  return Float64Array.from(unpack(Uint16Array, raw.codes),
      (code) => (code === 0 ? 0 : raw.lowest_m * Math.exp(ratio * (code - 1))));
}

function readUncertainty(raw) {
  return {
    total: lengths(raw.total), noise: lengths(raw.noise), sampling: lengths(raw.sampling),
    calibration: lengths(raw.calibration), registration: lengths(raw.registration),
    admissible: lengths(raw.admissible),
    relaxed: raw.relaxed_m ?? 0,
    classes: unpack(Uint8Array, raw.classes),
    sensitivities: (raw.sensitivities ?? []).map((map) => (map.detection ?
      {detection: lengths(map.detection), calibration: lengths(map.calibration)} : null)),
    features: (raw.features ?? []).map((feature) => (feature.targets ? place(feature) : null)),
  };
}

/** The scene with its lists as typed arrays, lengths in metres. */
export function readScene(raw) {
  const metres = (text) => {
    const steps = unpack(Uint16Array, text, 3);
    return Float32Array.from(steps, (step, i) => raw.origin_m[i % 3] + step * raw.quantum_m);
  };
  return {
    partMin: raw.part_min_m,
    partMax: raw.part_max_m,
    mesh: {
      positions: metres(raw.mesh.positions),
      normals: unpack(Int8Array, raw.mesh.normals, 3),
      triangles: unpack(Uint32Array, raw.mesh.triangles, 3),
      nearestTarget: unpack(Uint32Array, raw.mesh.nearest_target),
      edges: metres(raw.mesh.edges),
    },
    targets: {
      count: Number(raw.targets.count ?? 0),
      spacing: raw.targets.spacing_m,
      positions: metres(raw.targets.positions),
      measurable: unpackBytes(raw.targets.measurable),
    },
    rig: {...raw.rig, camera_bodies: solids(raw.rig.camera_bodies), laser_bodies: solids(raw.rig.laser_bodies)},
    robot: solids(raw.robot),
    scans: (raw.scans ?? []).map((scan) => ({
      ...scan,
      stage_start_m: scan.stage_start_m ?? 0,
      stage_end_m: scan.stage_end_m ?? 0,
      covered: unpackBytes(scan.covered),
      robot: scan.robot_start ? {start: matrices(scan.robot_start), end: matrices(scan.robot_end)} : null,
    })),
    regions: (raw.unmeasured_regions ?? []).map(place),
    uncertainty: raw.uncertainty ? readUncertainty(raw.uncertainty) : null,
    reasons: raw.reasons ?
      {kinds: raw.reasons.kinds ?? [], ofTarget: unpack(Uint8Array, raw.reasons.of_target)} : null,
    obstacles: (raw.obstacles ?? []).map((obstacle) => ({
      name: obstacle.name ?? '',
      turns: obstacle.turns_with_part ?? false,
      stands_still: obstacle.stands_still ?? false,
      poses: matrices(obstacle.poses),
      positions: floats(obstacle.positions),
      triangles: unpack(Uint32Array, obstacle.triangles, 3),
    })),
    regionsOfInterest: raw.regions_of_interest ?? [],
    depthPerPixel: lengths(raw.depth_per_pixel),
  };
}

/** The largest of noise, sampling, and calibration or registration per target: 0, 1, 2. */
export function dominatingParts({noise, sampling, calibration, registration}) {
  return Uint8Array.from(noise, (n, i) => {
    const shared = Math.max(calibration[i], registration?.[i] ?? 0);
    return shared > Math.max(n, sampling[i]) ? 2 : sampling[i] > n ? 1 : 0;
  });
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
