// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {errorOfAnswer, humanDescription, knownPath, locateErrors, ServiceError}
  from '../../../planning_service/web/page/field_errors.js';
import {FIELD_BY_PATH} from '../../../planning_service/web/page/fields.js';

const KNOWN = new Set([...FIELD_BY_PATH.keys(), 'inspection', 'inspection.part.file', 'inspection.part.unit', 'plan_job_id']);

test('errors are read from answers', () => {
  const error = errorOfAnswer(400, JSON.stringify({error: {
    code: 'INVALID_ARGUMENT', reason: 'R', message: 'wrong', fields: [{field: 'a.b', description: 'is 1'}, {}, null],
  }}));
  assert.deepEqual([error.status, error.code, error.reason, error.message, error.fields],
      [400, 'INVALID_ARGUMENT', 'R', 'wrong', [{field: 'a.b', description: 'is 1'}]]);
  assert.ok(!error.isTransient);
  // The answer of a proxy.
  const other = errorOfAnswer(502, '<html>Bad gateway</html>');
  assert.match(other.message, /502/);
  assert.ok(other.isTransient);
  assert.ok(new ServiceError({message: 'no answer'}).isTransient);
  assert.equal(errorOfAnswer(500, 'null').status, 500);
});

test('fields lead to the form', () => {
  assert.equal(knownPath('task.inspection.rig.scan_step_m', KNOWN), 'inspection.rig.scan_step_m');
  assert.equal(knownPath('rig.scan_step_m', KNOWN), 'inspection.rig.scan_step_m');
  assert.equal(knownPath('inspection.measurement.camera_distance_m.ranges[0]', KNOWN), 'inspection.measurement.camera_distance_m');
  // Errors of fields that the form does not show appear at the JSON.
  assert.equal(knownPath('inspection.obstacles[1].frame', KNOWN), 'inspection');
  assert.equal(knownPath('plan_job_id', KNOWN), 'plan_job_id');
  assert.equal(knownPath('nothing.like.it', new Set()), null);
});

test('errors without fields are found by their message', () => {
  const located = locateErrors(new ServiceError({message: 'inspection.json: rig.scan_step_m is 5, must be in [1e-05, 0.1] m'}), KNOWN);
  assert.deepEqual(located, [{path: 'inspection.rig.scan_step_m', field: 'rig.scan_step_m', description: 'is 5, must be in [1e-05, 0.1] m'}]);
  assert.deepEqual(locateErrors(new ServiceError({message: 'the disk is full'}), KNOWN), []);
});

test('descriptions are in the form’s unit', () => {
  const human = (path, text) => humanDescription(text, FIELD_BY_PATH.get(path));
  assert.equal(human('inspection.rig.scan_step_m', 'is 0.5, must be in [1e-05, 0.1] m'), 'is 500, must be in [0.01, 100] mm');
  assert.equal(human('inspection.camera.pixel_pitch_m', 'is 5.5, must be in [1e-07, 0.001] m'), 'is 5500000, must be in [0.1, 1000] µm');
  assert.equal(human('inspection.goal.coverage', 'is 1.5, must be in (0, 1]'), 'is 150, must be in (0, 100] %');
  assert.equal(human('inspection.costs.stage_speed_m_per_s', 'is 200, must be in (0, 100] m/s'), 'is 200000, must be in (0, 100000] mm/s');
  assert.equal(human('inspection.measurement.camera_distance_m', 'is [0.05, 0.9], must lie inside [0.1, 0.8] m'),
      'is [50, 900], must lie inside [100, 800] mm');
  // Others stay as they are.
  assert.equal(human('inspection.measurement.triangulation_angle_deg', 'is 5, must be in [-80, -10] or [10, 80] deg'),
      'is 5, must be in [-80, -10] or [10, 80] deg');
  assert.equal(human('inspection.rig.scan_step_m', 'is missing'), 'is missing');
  assert.equal(human('inspection.measurement.camera_distance_m', 'has none of fixed, values, ranges, must have exactly one'),
      'has none of fixed, values, ranges, must have exactly one');
  assert.equal(humanDescription('is 5', undefined), 'is 5');
});
