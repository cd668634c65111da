// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {FIELDS, SECTIONS} from '../../../planning_service/web/page/fields.js';
import {
  angleOfViewDeg, domainBounds, fieldOfView, getPath, KINDS, parseJsonObject, taskOfKind, withFollowingAngle, withPath,
} from '../../../planning_service/web/page/task_model.js';

test('values are put in and taken out by path', () => {
  const task = withPath({}, 'inspection.rig.scan_step_m', 0.001);
  assert.deepEqual(task, {inspection: {rig: {scan_step_m: 0.001}}});
  assert.equal(getPath(task, 'inspection.rig.scan_step_m'), 0.001);
  assert.equal(getPath(task, 'inspection.camera.rows_px'), undefined);
  // Messages that become empty go too, the others stay.
  const both = withPath(task, 'inspection.rig.stage_travel_m', 1);
  assert.deepEqual(withPath(both, 'inspection.rig.scan_step_m', undefined), {inspection: {rig: {stage_travel_m: 1}}});
  assert.deepEqual(withPath(task, 'inspection.rig.scan_step_m', undefined), {});
  assert.deepEqual(task, {inspection: {rig: {scan_step_m: 0.001}}});
});

test('only what a kind takes is sent', () => {
  const task = {
    inspection: {part: {file: 'a.glb'}}, plan_options: {strategy: 'refined'}, render_options: {layers: true},
    plan: {scans: []}, plan_job_id: '7', recordings: {recordings: []}, seed: 2,
  };
  assert.deepEqual(taskOfKind('plan', task),
      {kind: 'plan', inspection: task.inspection, plan_options: task.plan_options, seed: 2});
  // The job's plan goes before one of a file: not both.
  assert.deepEqual(taskOfKind('render', task),
      {kind: 'render', inspection: task.inspection, plan_job_id: '7', render_options: {layers: true}, seed: 2});
  assert.deepEqual(taskOfKind('evaluate', {...task, plan_job_id: undefined}),
      {kind: 'evaluate', inspection: task.inspection, plan: {scans: []}, seed: 2});
  // Whether a plan of another part is taken goes with a plan.
  assert.deepEqual(taskOfKind('optics', {...task, other_part: true}),
      {kind: 'optics', inspection: task.inspection, plan_job_id: '7', other_part: true, seed: 2});
  assert.deepEqual(taskOfKind('plan', {...task, other_part: true}), taskOfKind('plan', task));
  assert.deepEqual(taskOfKind('verify', task), {kind: 'verify', recordings: task.recordings, seed: 2});
  const inspect_options = {measured: [{file: 'scan_01.ply'}]};
  assert.deepEqual(taskOfKind('inspect', {...task, inspect_options}),
      {kind: 'inspect', inspection: task.inspection, plan_job_id: '7', inspect_options, seed: 2});
  // A flat plate instead of a part.
  assert.deepEqual(taskOfKind('render', {inspection: {}, recordings: task.recordings}),
      {kind: 'render', recordings: task.recordings});
  assert.deepEqual(taskOfKind('diagnose', {inspection: {}, recordings: task.recordings}),
      {kind: 'diagnose', recordings: task.recordings});
});

test('JSON errors say where', () => {
  assert.deepEqual(parseJsonObject('{"a": 1}'), {value: {a: 1}});
  const missingComma = `{\n  "name": "${'x'.repeat(80)}"\n  "seed": 1\n}`;
  assert.match(parseJsonObject(missingComma).error, /line 3/);
  assert.match(parseJsonObject('[]').error, /object/);
  assert.match(parseJsonObject('null').error, /object/);
});

test('comments of inspection files are passed over', () => {
  assert.deepEqual(parseJsonObject('// one\n{"a": "b // c \\" // d", // e\n "f": 1} //'),
      {value: {a: 'b // c " // d', f: 1}});
  assert.match(parseJsonObject('{ // a\n "b" 1}').error, /line 2/);
});

test('the angle of view follows from pixel size, rows and focal length', () => {
  const camera = {camera: {rows_px: 1024, pixel_pitch_m: 5.5e-6}};
  assert.equal(angleOfViewDeg(camera), undefined);
  const full = {...camera, lens: {focal_length_m: 0.016}};
  assert.equal(angleOfViewDeg(full), 19.964);
  assert.equal(angleOfViewDeg({...full, camera: {...full.camera, sensor_file: 'camera.json'}}), undefined);
  // Focused near, the image is farther from the lens.
  assert.ok(angleOfViewDeg({...full, lens: {focal_length_m: 0.016, focus_distance_m: 0.1}}) < 19.964);

  const first = withFollowingAngle(camera, full);
  assert.equal(first.camera.vertical_fov_deg, 19.964);
  const longer = withFollowingAngle(first, withPath(first, 'lens.focal_length_m', 0.032));
  assert.equal(longer.camera.vertical_fov_deg, angleOfViewDeg(longer));
  // Stated values stay. An angle that was left out stays so: the service works it out.
  const stated = withPath(full, 'camera.vertical_fov_deg', 40);
  assert.equal(withFollowingAngle(stated, withPath(stated, 'lens.focal_length_m', 0.032)).camera.vertical_fov_deg, 40);
  assert.equal(withFollowingAngle(full, withPath(full, 'camera.rows_px', 2048)).camera.vertical_fov_deg, undefined);
  assert.equal(withFollowingAngle(first, withPath(first, 'lens', undefined)).camera.vertical_fov_deg, undefined);
});

test('field of view', () => {
  const {width_mm, height_mm, pixel_mm} = fieldOfView({camera: {columns_px: 1024, vertical_fov_deg: 90}}, 0.5);
  assert.ok(Math.abs(height_mm - 1000) < 1e-9 && Math.abs(width_mm - 2000) < 1e-9 && Math.abs(pixel_mm - 1000 / 512) < 1e-9);
  assert.equal(fieldOfView({camera: {vertical_fov_deg: 180}}, 0.5), null);
  // An angle that is not stated follows from the pixels and the lens, as the service has it: 16 mm at 1 m.
  const byLens = fieldOfView({camera: {rows_px: 1024, pixel_pitch_m: 5.5e-6}, lens: {focal_length_m: 0.016}}, 1);
  assert.ok(Math.abs(byLens.height_mm - 1024 * 5.5e-3 / 0.016 / 1) < 0.1);
  assert.deepEqual(domainBounds({ranges: [{min: 0.2, max: 0.5}]}, [0, 1]), [0.2, 0.5]);
  assert.deepEqual(domainBounds({fixed: 0.3}, [0, 1]), [0.3, 0.3]);
  assert.deepEqual(domainBounds(undefined, [0, 1]), [0, 1]);
});

// Message of a field's type, and the fields of each message, from the schema.
function schema() {
  const messages = new Map();
  for (const file of ['planning_task', 'inspection', 'acceptance', 'camera', 'laser', 'rig', 'targets', 'measurement', 'uncertainty', 'part']) {
    const text = readFileSync(new URL(`../../../proto/sightline/v1/${file}.proto`, import.meta.url), 'utf8').replace(/\/\/.*$/gm, '');
    for (const [, name, body] of text.matchAll(/^message (\w+) \{([\s\S]*?)^\}/gm)) {
      messages.set(name, new Map([...body.matchAll(/^ +(?:optional |repeated )?([\w.]+) (\w+) = \d+;/gm)].map(([, type, field]) => [field, type])));
    }
  }
  return messages;
}

test('every field of the form is one of the schema, in its unit', () => {
  const messages = schema();
  const suffixes = {mm: ['_m'], 'µm': ['_m'], 'mm/s': ['_m_per_s'], ms: ['_s'], s: ['_s'], deg: ['_deg'], px: ['_px'],
                    Hz: ['_hz'], 'deg/s': ['_deg_per_s']};
  for (const {path, unit, exponent} of FIELDS) {
    let type = 'PlanningTask';
    for (const name of path.split('.')) {
      assert.ok(messages.get(type)?.has(name), `${path}: ${type} has ${name}`);
      type = messages.get(type).get(name);
    }
    if (suffixes[unit]) assert.ok(suffixes[unit].some((suffix) => path.endsWith(suffix)), `${path} is in ${unit}`);
    assert.equal(exponent, {mm: -3, 'µm': -6, '%': -2, 'mm/s': -3, ms: -3}[unit] ?? 0, path);
  }
  for (const {kinds = []} of SECTIONS) for (const kind of kinds) assert.ok(KINDS[kind]);
  assert.equal(new Set(FIELDS.map(({path}) => path)).size, FIELDS.length);
});

// A row of docs/plan-a-part.md such as "| `scan_step_m` | m of … | 0.001 | … |".
test('defaults are those of the documentation', () => {
  const text = readFileSync(new URL('../../../docs/plan-a-part.md', import.meta.url), 'utf8');
  let compared = 0;
  for (const {path, fallback, exponent, type} of FIELDS) {
    if (type !== 'number' || !/^inspection\.(rig|camera|laser|targets|goal)\./.test(path) || !/^[\d.]+$/.test(fallback)) continue;
    const name = path.split('.').at(-1);
    const row = text.split('\n').find((line) => line.startsWith('|') && line.split('|')[1].includes(`${name}\``) &&
        /^[\d.]+$/.test(line.split('|')[3]?.trim() ?? ''));
    if (!row) continue;
    assert.equal(Number(`${fallback}e${exponent}`), Number(row.split('|')[3].trim()), path);
    compared += 1;
  }
  assert.ok(compared >= 12, `${compared} compared`);
});
