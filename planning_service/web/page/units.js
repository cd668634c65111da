// SPDX-License-Identifier: Apache-2.0
// Numbers as people write them (mm, µm, %) and as the service takes them (m, fractions).
//
// The units differ by powers of ten only, so the decimal point is moved in the text: 5.5 µm become
// 5.5e-6 m exactly as written, which a multiplication would not give.

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

// `value` times ten to the power of `exponent`, correctly rounded.
export function shiftDecimal(value, exponent) {
  const [mantissa, power = '0'] = String(value).toLowerCase().split('e');
  return Number(`${mantissa}e${Number(power) + exponent}`);
}

// {value} in the unit of the service, or {error}. `unit` may follow the number.
export function parseNumber(text, {exponent = 0, unit = '', integer = false} = {}) {
  let trimmedText = text.trim().replace('\u2212', '-');
  if (unit && trimmedText.endsWith(unit)) trimmedText = trimmedText.slice(0, -unit.length).trim();
  if (/^[+-]?\d+,\d+$/.test(trimmedText)) {
    return {error: `“${text.trim()}”: write the decimal point as “.”`};
  }
  if (!NUMBER.test(trimmedText)) return {error: `“${text.trim()}” is not a number`};
  const value = shiftDecimal(trimmedText, exponent);
  if (!Number.isFinite(value)) return {error: `“${text.trim()}” is too large`};
  if (integer && !Number.isSafeInteger(value)) return {error: 'must be a whole number'};
  return {value};
}

// Text of a number of the service in people's unit.
export function humanNumber(value, exponent = 0) {
  return String(shiftDecimal(value, -exponent));
}

const ITEM = /^([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(?:\s*(?:to|\.\.\.?|…|–|-)\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?))?$/i;

// Reads the domain of a parameter from "300", "200, 300, 400" or "-80 to -10, 10 to 80": {value} is
// the ParameterDomain of the service (fixed, values or ranges), or {error}.
export function parseDomain(text, {exponent = 0, unit = ''} = {}) {
  const fixed = [], ranges = [];
  for (let item of text.replaceAll('\u2212', '-').split(/[,;]/)) {
    item = item.trim();
    if (unit && item.endsWith(unit)) item = item.slice(0, -unit.length).trim();
    const match = ITEM.exec(item);
    if (!match) {
      return {error: item === '' ? 'has nothing between two commas' :
          `“${item}” is neither a number nor a range such as “100 to 800”`};
    }
    const first = shiftDecimal(match[1], exponent);
    if (match[2] === undefined) {
      fixed.push(first);
    } else {
      const last = shiftDecimal(match[2], exponent);
      if (first > last) return {error: `“${item}” ends below its start`};
      ranges.push({min: first, max: last});
    }
  }
  if (fixed.length && ranges.length) return {error: 'has numbers and ranges: give one or the other'};
  if (ranges.length) return {value: {ranges}};
  return {value: fixed.length === 1 ? {fixed: fixed[0]} : {values: fixed}};
}

// The inverse; null for none or several of fixed, values and ranges.
export function domainText(domain, exponent = 0) {
  if (typeof domain !== 'object' || domain === null) return null;
  const given = ['fixed', 'values', 'ranges'].filter((name) => domain[name] !== undefined);
  if (given.length !== 1) return null;
  const text = (value) => humanNumber(value ?? 0, exponent);
  if (given[0] === 'fixed') return isNumeric(domain.fixed) ? text(domain.fixed) : null;
  const list = domain[given[0]];
  if (!Array.isArray(list) || list.length === 0) return null;
  if (given[0] === 'values') return list.every(isNumeric) ? list.map(text).join(', ') : null;
  const isRange = (range) => typeof range === 'object' && range !== null &&
      isNumeric(range.min ?? 0) && isNumeric(range.max ?? 0);
  return list.every(isRange) ?
      list.map((range) => `${text(range.min)} to ${text(range.max)}`).join(', ') : null;
}

// The proto3 JSON form takes numbers as text too.
export function isNumeric(value) {
  return typeof value === 'number' ? Number.isFinite(value) :
      typeof value === 'string' && NUMBER.test(value);
}

export function bytesText(bytes) {
  let value = Number(bytes);
  if (!(value >= 0)) return '';
  if (value < 1000) return `${value} B`;
  for (const unit of ['kB', 'MB', 'GB']) {
    value /= 1000;
    if (value < 1000 || unit === 'GB') return `${value < 10 ? value.toFixed(1) : Math.round(value)} ${unit}`;
  }
  return '';
}

// A length for people, to three digits: "0.71", "42.5", "320".
export function roundedText(value) {
  if (!Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return digits > 8 ? value.toPrecision(2) : String(Number(value.toFixed(digits)));
}

export const METRES_PER_UNIT = {m: 1, cm: 1e-2, mm: 1e-3, um: 1e-6, inch: 0.0254};
export const UNIT_NAMES = {m: 'm', cm: 'cm', mm: 'mm', um: 'µm', inch: 'inch'};
