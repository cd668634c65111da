// SPDX-License-Identifier: Apache-2.0
// Scales of charts: from values to places on the drawing.
import {Axis, numberOf, numbersOf} from '../report_data';

export class AxisScale {
  readonly low: number;
  readonly high: number;
  private readonly logarithmic: boolean;

  /**
   * `values` are the data; those that are not finite, or not positive on a logarithmic axis, do not count.
   * `lowAt` and `highAt` are the places of the axis' ends.
   */
  constructor(private readonly axis: Axis, values: number[],
      private readonly lowAt: number, private readonly highAt: number) {
    this.logarithmic = axis.logarithmic ?? false;
    let low = Infinity, high = -Infinity;
    for (const value of values) {
      if (!this.drawable(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    const given = {low: axis.low === undefined ? undefined : numberOf(axis.low),
      high: axis.high === undefined ? undefined : numberOf(axis.high)};
    if (!(low <= high)) {
      low = given.low ?? (this.logarithmic ? 0.1 : 0);
      high = given.high ?? Math.max(1, low + 1);
    }
    // Marks at the ends need room.
    if (this.logarithmic) {
      const room = Math.max((high / low) ** 0.06, 1.12);
      this.low = Math.max(given.low ?? low / room, Number.MIN_VALUE);
      const end = given.high ?? high * room;
      this.high = end > this.low ? end : 10 * this.low;
    } else {
      const room = high > low ? 0.05 * (high - low) : low === 0 ? 1 : 0.1 * Math.abs(low);
      this.low = given.low ?? low - room;
      const end = given.high ?? high + room;
      this.high = end > this.low ? end : this.low + Math.max(1, 0.1 * Math.abs(this.low));
    }
  }

  drawable(value: number): boolean {
    return Number.isFinite(value) && (!this.logarithmic || value > 0);
  }

  /** Values outside of the axis are drawn at its end. */
  at(value: number): number {
    const cut = Math.min(Math.max(value, this.low), this.high);
    const fraction = this.logarithmic ?
      (Math.log(cut) - Math.log(this.low)) / (Math.log(this.high) - Math.log(this.low)) :
      (cut - this.low) / (this.high - this.low);
    return this.lowAt + fraction * (this.highAt - this.lowAt);
  }

  shows(value: number): boolean {
    return Number.isFinite(value) && value >= this.low && value <= this.high;
  }

  /** At most about `count`, at round numbers; of the axis' own ticks those that do not crowd it. */
  ticks(count: number): number[] {
    if (this.axis.ticks?.length) return this.ownTicks(count);
    if (this.logarithmic) return this.logarithmicTicks(count);
    const rough = (this.high - this.low) / Math.max(count, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    let step = ([1, 2, 5].find((digit) => digit * power >= rough) ?? 10) * power;
    if (this.axis.whole_numbers) step = Math.max(1, Math.round(step));
    const ticks: number[] = [];
    const first = Math.ceil(this.low / step - 1e-9);
    // So large numbers that a step does not change them have no ticks.
    for (let i = first; i * step <= this.high + 1e-9 * step && ticks.length < 200; ++i) ticks.push(i * step);
    return ticks;
  }

  private ownTicks(count: number): number[] {
    // They are not equally spaced: half the mean distance is still enough for a label.
    const nearest = 0.5 * Math.abs(this.highAt - this.lowAt) / Math.max(count, 1);
    const ticks: number[] = [];
    for (const tick of numbersOf(this.axis.ticks)) {
      const last = ticks[ticks.length - 1];
      if (this.shows(tick) && (last === undefined || Math.abs(this.at(tick) - this.at(last)) >= nearest)) {
        ticks.push(tick);
      }
    }
    return ticks;
  }

  private logarithmicTicks(count: number): number[] {
    const decades = Math.log10(this.high / this.low);
    // The finest choice that does not crowd the axis.
    const digits = [[1, 2, 3, 4, 5, 6, 8], [1, 2, 5], [1, 3]].find((choice) => decades * choice.length <= count) ?? [1];
    const step = Math.max(1, Math.ceil(decades / count));
    const ticks: number[] = [];
    for (let decade = Math.floor(Math.log10(this.low)); decade <= Math.ceil(Math.log10(this.high)); decade += step) {
      for (const digit of digits) {
        const tick = Number(`${digit}e${decade}`);
        if (tick >= this.low * (1 - 1e-9) && tick <= this.high * (1 + 1e-9)) ticks.push(tick);
      }
    }
    return ticks;
  }
}
