// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {allowedText, isAllowed, nearestAllowed, ratioPlace, ratioValue, tidy} from '../../../planner_client/explore/page/parameter.js';

const angle = {ranges: [[-80, -10], [10, 80]], values: [], scale: 1, unit: '°'};
const length = {ranges: [[0.1, 0.8]], values: [], scale: 1000, unit: 'mm'};

test('a slider passes over what is not allowed', () => {
  assert.equal(nearestAllowed(angle, 4), 10);
  assert.equal(nearestAllowed(angle, -4), -10);
  assert.equal(nearestAllowed(angle, 99), 80);
  assert.equal(nearestAllowed(angle, 33), 33);
  assert.equal(nearestAllowed({ranges: [], values: [0, 90, 180], scale: 1}, 100), 90);
});

test('typed values outside are not allowed, rounding aside', () => {
  assert.ok(isAllowed(angle, 10));
  assert.ok(!isAllowed(angle, 9.9));
  assert.ok(!isAllowed(angle, NaN));
  assert.ok(isAllowed(length, 0.80000001));
  assert.ok(!isAllowed(length, 0.801));
});

test('limits are named in the units that people see', () => {
  assert.equal(allowedText(length), '100 to 800 mm');
  assert.equal(allowedText(angle), '-80 to -10 or 10 to 80 °');
  assert.equal(tidy(0.1 + 0.2), 0.3);
});

test('sliders of settings go by equal ratios', () => {
  const range = [1e-5, 0.1];
  assert.ok(Math.abs(ratioPlace(1e-3, range) - 0.5) < 1e-12);
  assert.ok(Math.abs(ratioValue(ratioPlace(0.004, range), range) - 0.004) < 1e-12);
});
