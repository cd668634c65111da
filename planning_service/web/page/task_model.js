// SPDX-License-Identifier: Apache-2.0
// The task as the service takes it (v1::PlanningTask), read and written by path. Form and JSON both
// show this one object, so that fields unknown to the form are kept.

export function getPath(object, path) {
  let value = object;
  for (const name of path.split('.')) {
    if (typeof value !== 'object' || value === null) return undefined;
    value = value[name];
  }
  return value === null ? undefined : value;
}

// A copy of `object` with the value at `path`; undefined removes it, and with it messages that have
// become empty.
export function withPath(object, path, value) {
  const [name, ...rest] = path.split('.');
  const isMessage = typeof object === 'object' && object !== null && !Array.isArray(object);
  const copy = isMessage ? {...object} : {};
  const inner = rest.length ? withPath(copy[name], rest.join('.'), value) : value;
  const isEmpty = inner === undefined || (rest.length && Object.keys(inner).length === 0);
  if (isEmpty) {
    delete copy[name];
  } else {
    copy[name] = inner;
  }
  return copy;
}

// Options of a kind of job: the field of the task that holds them.
const OPTIONS_OF_KIND = {
  plan: 'plan_options', inspect: 'inspect_options', accept: 'accept_options', optics: 'optics_options',
  render: 'render_options', diagnose: 'diagnose_options',
};

export const KINDS = {
  plan: {title: 'Plan', text: 'Find the scans that cover the part'},
  evaluate: {title: 'Evaluate', text: 'Exact coverage of given scans'},
  inspect: {title: 'Inspect', text: 'Judge a part by its measured points'},
  accept: {title: 'Accept', text: 'Acceptance test of the rig, simulated'},
  optics: {title: 'Optics', text: 'Choose f-number, exposure and focus'},
  render: {title: 'Render', text: 'Images as the camera would take them'},
  verify: {title: 'Verify', text: 'Compare recordings with simulation'},
  diagnose: {title: 'Diagnose', text: 'Find out why recordings differ'},
};

export function takesInspection(kind) { return kind !== 'verify'; }
export function takesPlan(kind) { return ['evaluate', 'inspect', 'optics', 'render'].includes(kind); }
export function takesRecordings(kind) {
  return kind === 'verify' || kind === 'diagnose' || kind === 'render';
}

function isFilled(message) { return message !== undefined && Object.keys(message).length > 0; }

// The task that is sent for a kind: fields that other kinds have are left out.
export function taskOfKind(kind, task) {
  const sent = {kind};
  const plate = kind === 'render' && task.recordings !== undefined && !getPath(task, 'inspection.part');
  if (takesInspection(kind) && !plate && isFilled(task.inspection)) sent.inspection = task.inspection;
  if (takesPlan(kind) && task.plan_job_id) {
    sent.plan_job_id = task.plan_job_id;
  } else if (takesPlan(kind) && task.plan !== undefined) {
    sent.plan = task.plan;
  }
  if (task.other_part && (sent.plan_job_id || sent.plan !== undefined)) sent.other_part = true;
  if (takesRecordings(kind) && task.recordings !== undefined && (kind !== 'render' || plate)) {
    sent.recordings = task.recordings;
  }
  const options = OPTIONS_OF_KIND[kind];
  if (options && isFilled(task[options])) sent[options] = task[options];
  if (task.seed !== undefined) sent.seed = task.seed;
  return sent;
}

// Text with spaces in place of comments, which go from // to the end of the line outside of strings.
export function withoutComments(text) {
  return text.replace(/"(?:\\[^\n]|[^"\\\n])*"?|\/\/[^\n]*/g,
      (found) => found.startsWith('//') ? ' '.repeat(found.length) : found);
}

// {value} of JSON text that must be an object and may have // comments, or {error} with line and
// column where the browser tells them. Whole numbers that JavaScript cannot hold are refused, not rounded.
export function parseJsonObject(text) {
  let value;
  let tooLarge = null;
  try {
    value = JSON.parse(withoutComments(text), (key, number, context) => {
      if (typeof number === 'number' && Number.isInteger(number) && !Number.isSafeInteger(number) &&
          /^-?\d+$/.test(context?.source ?? '')) {
        tooLarge = `${key} is ${context.source}: write whole numbers beyond 2^53 in quotes`;
      }
      return number;
    });
  } catch (error) {
    return {error: positionText(String(error.message), text)};
  }
  if (tooLarge) return {error: tooLarge};
  if (typeof value !== 'object' || value === null || Array.isArray(value)) {
    return {error: 'must be a JSON object: { … }'};
  }
  return {value};
}

function positionText(message, text) {
  const match = /at position (\d+)(?! *\(line)/.exec(message);
  if (!match || /line \d+/.test(message)) return message;
  const before = text.slice(0, Number(match[1])).split('\n');
  return `${message} (line ${before.length}, column ${before.at(-1).length + 1})`;
}

// Full vertical angle of view in degrees by pixel size, rows, focal length and focus distance (if
// given); undefined if one of the others is not given, or a sensor makes the service work it out.
export function angleOfViewDeg(inspection) {
  const rows = getPath(inspection, 'camera.rows_px') ?? 512;
  const pitch_m = getPath(inspection, 'camera.pixel_pitch_m');
  const focal_length_m = getPath(inspection, 'lens.focal_length_m');
  const focus_m = getPath(inspection, 'lens.focus_distance_m') ?? Infinity;
  if (getPath(inspection, 'camera.sensor_file') || getPath(inspection, 'camera.sensor')) return undefined;
  if (!(rows > 0 && pitch_m > 0 && focal_length_m > 0 && focus_m > focal_length_m)) return undefined;
  const image_distance_m = 1 / (1 / focal_length_m - 1 / focus_m);
  return Math.round(2 * Math.atan(0.5 * rows * pitch_m / image_distance_m) * 180 / Math.PI * 1000) / 1000;
}

// The inspection after an input that the angle of view follows from: an angle that was worked out
// before, or is now for the first time, is worked out anew; one that was stated stays.
export function withFollowingAngle(before, after) {
  const old_deg = angleOfViewDeg(before), new_deg = angleOfViewDeg(after);
  const stated_deg = getPath(after, 'camera.vertical_fov_deg');
  const follows = stated_deg === undefined ? old_deg === undefined : stated_deg === old_deg;
  return follows && old_deg !== new_deg ? withPath(after, 'camera.vertical_fov_deg', new_deg) : after;
}

// Field of view of a camera at a distance: width and height in mm, and size of a pixel.
export function fieldOfView(inspection, distance_m) {
  const columns = Number(getPath(inspection, 'camera.columns_px') ?? 512);
  const rows = Number(getPath(inspection, 'camera.rows_px') ?? 512);
  const angle_deg = Number(getPath(inspection, 'camera.vertical_fov_deg') ?? angleOfViewDeg(inspection) ?? 45);
  if (!(columns > 0 && rows > 0 && angle_deg > 0 && angle_deg < 180 && distance_m > 0)) return null;
  const height_mm = 2e3 * distance_m * Math.tan(angle_deg * Math.PI / 360);
  return {width_mm: height_mm * columns / rows, height_mm, pixel_mm: height_mm / rows};
}

// Least and greatest value of a ParameterDomain.
export function domainBounds(domain, fallback) {
  const numbers = [domain?.fixed, ...(domain?.values ?? []),
                   ...(domain?.ranges ?? []).flatMap((range) => [range?.min ?? 0, range?.max ?? 0])]
      .filter((value) => value !== undefined).map(Number);
  return numbers.length ? [Math.min(...numbers), Math.max(...numbers)] : fallback;
}
