// SPDX-License-Identifier: Apache-2.0
// Allowed values of a parameter, in the unit that people see.

/** The shortest decimal number that is as good as `value`: 0.1 um, 0.0001 degrees. */
export const tidy = (value) => Number(value.toFixed(4));

/** The nearest allowed value. `ranges` and `values` as the server gives them, not scaled. */
export function nearestAllowed({ranges, values}, value) {
  let best = null;
  const consider = (candidate) => {
    if (best === null || Math.abs(candidate - value) < Math.abs(best - value)) best = candidate;
  };
  for (const [min, max] of ranges) consider(Math.min(max, Math.max(min, value)));
  for (const allowed of values) consider(allowed);
  return best;
}

/** Whether the value is allowed, rounding for people (tidy) aside. */
export const isAllowed = (parameter, value) =>
  Number.isFinite(value) && Math.abs(nearestAllowed(parameter, value) - value) * parameter.scale < 6e-5;

/** "[-80, -10] or [10, 80] °" in shown units. */
export function allowedText({ranges, values, scale, unit}) {
  const shown = (v) => tidy(v * scale);
  if (ranges.length === 0) return `${values.map(shown).join(', ')} ${unit}`.trim();
  return `${ranges.map(([min, max]) => `${shown(min)} to ${shown(max)}`).join(' or ')} ${unit}`.trim();
}

/** A slider's place in [0, 1] on a scale of equal ratios, and back. */
export const ratioPlace = (value, [min, max]) => Math.log(value / min) / Math.log(max / min);
export const ratioValue = (place, [min, max]) => min * (max / min) ** place;
