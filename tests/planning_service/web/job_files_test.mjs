// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {isMeshName, neededFiles, roleOfJson, sentName, withSentNames} from '../../../planning_service/web/page/job_files.js';

test('names stay inside the job’s folder', () => {
  assert.equal(sentName('../catalogue/./cameras/a.json'), 'catalogue/cameras/a.json');
  assert.equal(sentName('/etc/passwd'), 'etc/passwd');
  assert.equal(sentName('C:\\parts\\a.stl'), 'parts/a.stl');
  assert.equal(sentName('a/../../b.stl'), 'b.stl');
});

test('the files a task needs are found among the chosen ones', () => {
  const task = {
    kind: 'render',
    inspection: {
      part: {file: '../parts/head.glb'}, camera: {sensor_file: 'camera.json'},
      materials: [{part_material: 'a', file: 'materials/steel.json'}, {part_material: 'b', file: 'materials/steel.json'}],
      obstacles: [{name: 'table', file: 'table.stl'}],
    },
  };
  const material = {path: 'materials/steel.json', json: {conductor: {refractive_index_file: '../curves/steel.csv'}}};
  const chosen = [{path: 'head.glb'}, material, {path: 'folder/steel.csv'}, {path: 'a/table.stl'}, {path: 'b/table.stl'}];
  const needed = neededFiles(task, chosen);
  assert.deepEqual(needed.map(({name, path, file}) => [name, path, file?.path ?? null]), [
    ['parts/head.glb', 'inspection.part.file', 'head.glb'],
    ['camera.json', 'inspection.camera.sensor_file', null],
    ['materials/steel.json', 'inspection.materials[0].file', 'materials/steel.json'],
    // Two of that name are there: which one is not guessed.
    ['table.stl', 'inspection.obstacles[0].file', null],
    // Relative to the material's file.
    ['curves/steel.csv', 'inspection.materials[0].file: conductor.refractive_index_file', 'folder/steel.csv'],
  ]);
  assert.equal(withSentNames(task).inspection.part.file, 'parts/head.glb');
  assert.equal(task.inspection.part.file, '../parts/head.glb');
});

test('files of the same name in several folders are not mixed up', () => {
  const chosen = [{path: 'x/000.png'}, {path: 'y/000.png'}];
  const [first, second, third] = neededFiles({recordings: {recordings: [{file: 'x/000.png'}, {file: 'y/000.png'}, {file: 'z/000.png'}]}}, chosen);
  assert.equal(first.file, chosen[0]);
  assert.equal(second.file, chosen[1]);
  assert.equal(third.file, null);
});

test('a raster of measured points comes with its description', () => {
  const needed = neededFiles({inspect_options: {measured: [{file: 'scan_01.ply'}, {file: 'scan_02.tif'}]}}, []);
  assert.deepEqual(needed.map(({name}) => name), ['scan_01.ply', 'scan_02.tif', 'scan_02.json']);
});

test('what a JSON file is', () => {
  assert.equal(roleOfJson({part: {file: 'a'}}), 'inspection');
  assert.equal(roleOfJson({format: 'laser-line-recordings', part: {file: 'a'}}), 'recordings');
  assert.equal(roleOfJson({scans: []}), 'plan');
  assert.equal(roleOfJson({sensor_type: 'mono'}), 'other');
  assert.equal(roleOfJson(null), 'other');
  assert.ok(isMeshName('A.STL') && isMeshName('a.step') && !isMeshName('a.txt'));
});
