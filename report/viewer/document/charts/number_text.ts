// SPDX-License-Identifier: Apache-2.0
// Numbers of ticks and of what is pointed at. All other numbers come with their text.

const SUPERSCRIPTS = '\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079';

const powerOfTen = (exponent: number): string => (exponent < 0 ? '10\u207b' : '10') +
    [...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[Number(digit)]).join('');

/** At most so many significant digits without zeros at the end, a true minus sign; a dash for no number. */
export function shortNumber(value: number, significant = 6): string {
  if (Number.isNaN(value)) return '\u2013';
  if (!Number.isFinite(value)) return value < 0 ? '\u2212\u221e' : '\u221e';
  if (value === 0) return '0';
  const rounded = Number(value.toPrecision(significant));
  const exponent = Math.floor(Math.log10(Math.abs(rounded)) + 1e-12);
  const minus = rounded < 0 ? '\u2212' : '';
  if (exponent < -4 || exponent >= 6) {
    const mantissa = Number((Math.abs(rounded) / 10 ** exponent).toPrecision(significant));
    return `${minus}${mantissa === 1 ? '' : `${mantissa}\u00b7`}${powerOfTen(exponent)}`;
  }
  return minus + String(Math.abs(rounded));
}
