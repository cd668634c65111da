// SPDX-License-Identifier: Apache-2.0
// Colours and legends of uncertainties.
import {Color} from 'three';

// Numbers of the classes are those of target_uncertainty.h.
export const CLASS_STATES = [
  [0, '--admissible', 'admissible'],
  [1, '--relaxed', 'only relaxed'],
  [2, '--not-reached', 'not reached'],
  [3, '--not-judged', 'no tolerance here'],
  [4, '--not-measurable', 'not measurable'],
];
export const PART_STATES = [
  [0, '--noise', 'noise'],
  [1, '--sampling', 'sampling'],
  [2, '--calibration', 'calibration or registration'],
  [3, '--not-measured', 'not measured'],
  [4, '--not-measurable', 'not measurable'],
];
export const SCALE_STATES = [
  [0, null, 'measurable'],
  [3, '--not-measured', 'not by this scan'],
  [4, '--not-measurable', 'not measurable'],
];

// Viridis: lightness tells the order with any kind of colour blindness, and nothing of it is grey
// as what is not measurable. From small uncertainties, dark, to large ones.
const STOPS = ['#440154', '#482878', '#3e4a89', '#31688e', '#26828e', '#1f9e89', '#35b779', '#6dcd59', '#b4de2c', '#fde725'];
const STEPS = 256;
const colours = STOPS.map((stop) => new Color().setStyle(stop, ''));
const TABLE = [...Array(STEPS).keys()].map((i) => {
  const place = i / (STEPS - 1) * (STOPS.length - 1);
  const k = Math.min(STOPS.length - 2, Math.floor(place));
  return colours[k].clone().lerp(colours[k + 1], place - k);
});

export const lengthText = (m) => {
  if (m === 0) return '0';
  const [value, unit] = m < 0.9995e-3 ? [1e6 * m, '\u00b5m'] : [1e3 * m, 'mm'];
  return `${value >= 100 ? value.toFixed(0) : value.toPrecision(value < 1 ? 2 : 3)}\u202f${unit}`;
};
const tickText = (m) => (m < 0.9995e-3 ? `${+(1e6 * m).toPrecision(1)}\u202f\u00b5m` : `${+(1e3 * m).toPrecision(1)}\u202fmm`);

/** Logarithmic colour scale over the middle 99 % of `values` that are not 0, in round numbers. */
export class LogScale {
  constructor(values) {
    const sorted = Float64Array.from(values.filter((v) => v > 0)).sort();
    const at = (fraction) => (sorted.length ? sorted[Math.round(fraction * (sorted.length - 1))] : 1e-6);
    const round = (v, way) => {
      const decade = 10 ** Math.floor(Math.log10(v) + 1e-9);
      const steps = [1, 2, 5, 10].map((s) => s * decade);
      return way < 0 ? steps.filter((s) => s <= v * 1.0001).pop() : steps.find((s) => s >= v * 0.9999);
    };
    this.low = round(at(0.005), -1);
    this.high = round(at(0.995), 1);
    if (this.high <= this.low) this.high = 2 * this.low;
  }

  /** 0 at the low end, 1 at the high one; beyond them too. */
  place(value) {
    return Math.log(value / this.low) / Math.log(this.high / this.low);
  }

  /** 0 has the colour of the low end. */
  colour(value) {
    const place = value > 0 ? this.place(value) : 0;
    return TABLE[Math.round((STEPS - 1) * Math.min(1, Math.max(0, place)))];
  }

  /** marks: [value, text] pairs drawn across the scale where they lie on it. */
  legend(marks) {
    const box = document.createElement('div');
    const bar = document.createElement('div');
    bar.className = 'scale';
    bar.style.background = `linear-gradient(90deg, ${STOPS.join(', ')})`;
    const ticks = document.createElement('div');
    ticks.className = 'scale-ticks';
    const add = (value, text, name) => {
      const place = this.place(value);
      if (place < -0.001 || place > 1.001) return;
      const tick = document.createElement('span');
      tick.textContent = text;
      tick.className = name;
      tick.style.left = `${100 * place}%`;
      ticks.append(tick);
    };
    const decades = Math.log10(this.high / this.low);
    // Round numbers, as many as fit.
    const steps = decades > 1.8 ? [1] : decades > 0.9 ? [1, 3] : [1, 2, 5];
    for (let e = Math.floor(Math.log10(this.low)); e <= Math.ceil(Math.log10(this.high)); ++e) {
      for (const step of steps) add(step * 10 ** e, tickText(step * 10 ** e), '');
    }
    for (const [value, text] of marks) add(value, text, 'mark');
    box.append(bar, ticks);
    return box;
  }
}
