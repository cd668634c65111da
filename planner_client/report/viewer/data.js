// SPDX-License-Identifier: Apache-2.0
// Unpacks the scene of a report (report_scene.proto).

function bytes(text) {
  const binary = atob(text);
  const result = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) result[i] = binary.charCodeAt(i);
  return result;
}

/** Bytes compressed by zlib, in base64. */
async function unpackBytes(text) {
  if (!text) return new Uint8Array(0);
  const stream = new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Differences to the number `stride` places before; lowest bytes of all, then the next ones. */
async function unpack(Type, text, stride = 1) {
  const raw = await unpackBytes(text);
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

const floats = async (text) => new Float32Array((await unpackBytes(text)).buffer);

/** Bit i of a little-endian bit set. */
export const hasBit = (bits, i) => (bits[i >> 3] >> (i & 7)) & 1;

/** Groups of 16 numbers. */
const matrices = (numbers = []) =>
  Array.from({length: numbers.length / 16}, (_, i) => numbers.slice(16 * i, 16 * i + 16));

async function solids(list = []) {
  return Promise.all(list.map(async (solid) => ({
    centre: solid.centre_m ?? [0, 0, 0], size: solid.size_m, radius: solid.radius_m, length: solid.length_m,
    triangles: solid.triangles ? await floats(solid.triangles) : undefined,
  })));
}

async function place(raw) {
  return {...raw, targets: new Set(await unpack(Uint32Array, raw.targets))};
}

async function lengths(raw) {
  if (!raw?.codes) return null;
  const ratio = Math.log(raw.highest_m / raw.lowest_m) / 65534;
  return Float64Array.from(await unpack(Uint16Array, raw.codes),
      (code) => (code === 0 ? 0 : raw.lowest_m * Math.exp(ratio * (code - 1))));
}

async function readUncertainty(raw) {
  const [total, noise, sampling, calibration, admissible] = await Promise.all(
      [raw.total, raw.noise, raw.sampling, raw.calibration, raw.admissible].map(lengths));
  return {
    total, noise, sampling, calibration, admissible,
    relaxed: raw.relaxed_m ?? 0,
    classes: await unpack(Uint8Array, raw.classes),
    sensitivities: await Promise.all((raw.sensitivities ?? []).map(async (map) => (
      map.detection ? {detection: await lengths(map.detection), calibration: await lengths(map.calibration)} : null))),
    features: await Promise.all((raw.features ?? []).map(async (feature) => (feature.targets ? place(feature) : null))),
  };
}

async function readMesh(raw, metres) {
  const [positions, normals, triangles, nearestTarget, edges] = await Promise.all([
    metres(raw.positions), unpack(Int8Array, raw.normals, 3), unpack(Uint32Array, raw.triangles, 3),
    unpack(Uint32Array, raw.nearest_target), metres(raw.edges),
  ]);
  return {positions, normals, triangles, nearestTarget, edges};
}

/** The scene with its lists as typed arrays, lengths in metres. */
export async function readScene(raw) {
  const metres = async (text) => {
    const steps = await unpack(Uint16Array, text, 3);
    return Float32Array.from(steps, (step, i) => raw.origin_m[i % 3] + step * raw.quantum_m);
  };
  return {
    partMin: raw.part_min_m,
    partMax: raw.part_max_m,
    mesh: await readMesh(raw.mesh, metres),
    targets: {
      count: raw.targets.count,
      spacing: raw.targets.spacing_m,
      positions: await metres(raw.targets.positions),
      measurable: await unpackBytes(raw.targets.measurable),
    },
    rig: {...raw.rig, camera_bodies: await solids(raw.rig.camera_bodies), laser_bodies: await solids(raw.rig.laser_bodies)},
    robot: await solids(raw.robot),
    scans: await Promise.all((raw.scans ?? []).map(async (scan) => ({
      ...scan,
      stage_start_m: scan.stage_start_m ?? 0,
      stage_end_m: scan.stage_end_m ?? 0,
      covered: await unpackBytes(scan.covered),
      robot: scan.robot_start ? {start: matrices(scan.robot_start), end: matrices(scan.robot_end)} : null,
    }))),
    regions: await Promise.all((raw.unmeasured_regions ?? []).map(place)),
    uncertainty: raw.uncertainty ? await readUncertainty(raw.uncertainty) : null,
    reasons: raw.reasons ?
      {kinds: raw.reasons.kinds ?? [], ofTarget: await unpack(Uint8Array, raw.reasons.of_target)} : null,
    obstacles: await Promise.all((raw.obstacles ?? []).map(async (obstacle) => ({
      name: obstacle.name ?? '',
      turns: obstacle.turns_with_part ?? false,
      stands_still: obstacle.stands_still ?? false,
      poses: matrices(obstacle.poses),
      positions: await floats(obstacle.positions),
      triangles: await unpack(Uint32Array, obstacle.triangles, 3),
    }))),
    regionsOfInterest: raw.regions_of_interest ?? [],
    depthPerPixel: await lengths(raw.depth_per_pixel),
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
