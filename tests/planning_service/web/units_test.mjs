// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {bytesText, domainText, humanNumber, parseDomain, parseNumber, roundedText, shiftDecimal}
  from '../../../planning_service/web/page/units.js';

test('decimal points are moved without rounding', () => {
  assert.equal(shiftDecimal(5.5, -6), 5.5e-6);
  assert.equal(shiftDecimal('0.1', -3), 1e-4);
  assert.equal(shiftDecimal(3.45e-6, 6), 3.45);
  assert.equal(shiftDecimal(0.07, 2), 7);
  for (let i = 1; i < 2000; ++i) {
    const text = `${i / 100}`;
    assert.equal(humanNumber(parseNumber(text, {exponent: -3}).value, -3), text);
  }
});

test('numbers', () => {
  assert.deepEqual(parseNumber(' 3.45 µm', {exponent: -6, unit: 'µm'}), {value: 3.45e-6});
  assert.deepEqual(parseNumber('1e-3', {exponent: -3}), {value: 1e-6});
  assert.deepEqual(parseNumber('\u22125'), {value: -5});
  assert.match(parseNumber('0,5').error, /decimal point/);
  assert.match(parseNumber('five').error, /not a number/);
  assert.match(parseNumber('1e999').error, /too large/);
  assert.match(parseNumber('1.5', {integer: true}).error, /whole/);
  assert.match(parseNumber('0x10').error, /not a number/);
  assert.match(parseNumber('Infinity').error, /not a number/);
});

test('domains are read and written', () => {
  const MM = {exponent: -3, unit: 'mm'};
  const cases = [
    ['300', {fixed: 0.3}],
    ['200, 300, 400', {values: [0.2, 0.3, 0.4]}],
    ['100 to 800', {ranges: [{min: 0.1, max: 0.8}]}],
    ['-80 to -10, 10 to 80', {ranges: [{min: -0.08, max: -0.01}, {min: 0.01, max: 0.08}]}],
  ];
  for (const [text, domain] of cases) {
    assert.deepEqual(parseDomain(text, MM), {value: domain});
    assert.equal(domainText(domain, -3), text);
  }
  const range = {value: {ranges: [{min: 10, max: 80}]}};
  for (const text of ['10-80', '10 – 80', '10..80', '10 to 80 deg']) {
    assert.deepEqual(parseDomain(text, {unit: 'deg'}), range, text);
  }
  assert.deepEqual(parseDomain('-80 - -10'), {value: {ranges: [{min: -80, max: -10}]}});
  assert.match(parseDomain('10, 20 to 30').error, /one or the other/);
  assert.match(parseDomain('80 to 10').error, /ends below/);
  assert.match(parseDomain('10,').error, /between two commas/);
  assert.match(parseDomain('wide').error, /neither/);
});

test('domains that a line cannot show are not shown', () => {
  assert.equal(domainText({}), null);
  assert.equal(domainText({fixed: 1, values: [1]}), null);
  assert.equal(domainText({values: ['x']}), null);
  assert.equal(domainText({ranges: [null]}), null);
  // proto3 leaves out a bound of 0, and takes numbers as text.
  assert.equal(domainText({ranges: [{max: '90'}]}), '0 to 90');
});

test('texts for people', () => {
  assert.equal(bytesText(999), '999 B');
  assert.equal(bytesText('1134892'), '1.1 MB');
  assert.equal(bytesText('no'), '');
  assert.equal(roundedText(82.8427), '82.8');
  assert.equal(roundedText(0.0021), '0.0021');
  assert.equal(roundedText(1200), '1200');
  assert.equal(roundedText(NaN), '–');
});
