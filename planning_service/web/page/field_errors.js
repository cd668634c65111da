// SPDX-License-Identifier: Apache-2.0
// Errors of the service, and where in the form they belong.
import {humanNumber} from './units.js';

export class ServiceError extends Error {
  // `status`: of HTTP; 0: no answer. `fields`: [{field, description}].
  constructor({status = 0, code = 'UNKNOWN', reason = '', message = '', fields = []}) {
    super(message);
    this.name = 'ServiceError';
    Object.assign(this, {status, code, reason, fields});
  }

  // Whether the same request may well be answered later.
  get isTransient() { return this.status === 0 || this.status === 502 || this.status === 503 || this.status === 504; }
}

// Reads {"error": {...}}; an answer of something in between (a proxy) keeps its status.
export function errorOfAnswer(status, text) {
  try {
    const {error} = JSON.parse(text);
    if (typeof error === 'object' && error !== null) {
      const fields = (Array.isArray(error.fields) ? error.fields : [])
          .filter((entry) => typeof entry?.field === 'string')
          .map(({field, description}) => ({field, description: String(description ?? '')}));
      return new ServiceError({
        status, code: String(error.code ?? 'UNKNOWN'), reason: String(error.reason ?? ''),
        message: String(error.message ?? ''), fields,
      });
    }
  } catch { /* Not JSON. */ }
  return new ServiceError({status, message: `The server answered with HTTP ${status}.`});
}

// The known path that a field of an error means: itself or the longest that leads to it
// ("inspection.measurement.camera_distance_m.ranges[0]"). Null: none.
export function knownPath(field, knownPaths) {
  const known = knownPaths instanceof Set ? knownPaths : new Set(knownPaths);
  const bare = field.replace(/^task\./, '').replace(/\[\d+\]/g, '');
  for (const start of [bare, `inspection.${bare}`]) {
    for (let path = start; path; path = path.slice(0, Math.max(0, path.lastIndexOf('.')))) {
      if (known.has(path)) return path;
    }
  }
  return null;
}

// [{path, field, description}] of an error: by its fields, or by the first known path that its
// message names.
export function locateErrors(error, knownPaths) {
  if (error.fields?.length) {
    return error.fields.map(({field, description}) =>
      ({path: knownPath(field, knownPaths), field, description}));
  }
  const match = /(?:^|[\s:"])((?:[a-z][a-z0-9_]*(?:\[\d+\])?\.)+[a-z][a-z0-9_]*(?:\[\d+\])?|plan_job_id|kind)\s+(.*)$/s
      .exec(error.message ?? '');
  const path = match && knownPath(match[1], knownPaths);
  return path ? [{path, field: match[1], description: match[2]}] : [];
}

const NUMBER = /-?\d+(?:\.\d+)?(?:e[+-]?\d+)?/gi;
const SI_UNIT = /(?<=[\d)\]]) m(?=$|[\s,;:.)/])/g;

// "is 0.5, must be in [1e-05, 0.1] m" in the unit of the form: "is 500, must be in [0.01, 100] mm".
// Sentences of another form stay as they are.
export function humanDescription(description, field) {
  if (!field?.exponent || !/^(is|has min) [-[(]?[\d.]+.*\b(must|above)\b/.test(description)) return description;
  const numbers = description.replace(NUMBER, (text) => humanNumber(Number(text), field.exponent));
  const unit = field.unit.replace(/\/s$/, '');
  return field.unit === '%' ? `${numbers} %` : numbers.replace(SI_UNIT, ` ${unit}`);
}
