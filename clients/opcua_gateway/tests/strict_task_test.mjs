// SPDX-License-Identifier: Apache-2.0
// A task.json is sent as it is written, or refused by the name of its field.
import assert from 'node:assert/strict';
import {readdirSync, readFileSync} from 'node:fs';
import path from 'node:path';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';
import protoLoader from '@grpc/proto-loader';
import {checkTask} from '../src/orders/strict_task.js';

const PROTO = process.env.SIGHTLINE_PROTO ?? fileURLToPath(new URL('../../../proto', import.meta.url));
const contract = protoLoader.loadSync('sightline/v1/planning_service.proto',
    {includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, defaults: true});

test('inspections of the examples pass', () => {
  const examples = path.join(PROTO, '../examples');
  const names = readdirSync(examples).filter((name) => name.startsWith('cylinder_head'));
  let count = 0;
  for (const name of names) {
    const file = path.join(examples, name, 'inspection.json');
    try {
      checkTask(contract, {kind: 'plan', inspection: JSON.parse(readFileSync(file, 'utf8'))});
      count++;
    } catch (error) {
      if (!(error instanceof SyntaxError) && error.code !== 'ENOENT') throw error;
    }
  }
  assert.ok(count > 2);
});

test('what the contract does not have is refused by name', () => {
  for (const [task, reason] of [
    [{gaol: 1}, /task\.json: gaol: is no field of PlanningTask/],
    [{planOptions: {}}, /planOptions: is no field/],
    [{plan_options: [1]}, /plan_options: must be an object/],
    [{plan_options: {max_scans: 4294967299}}, /plan_options\.max_scans: is 4294967299, must be a whole number/],
    [{plan_options: {max_scans: 2.7}}, /max_scans: is 2\.7/],
    [{plan_options: {max_scans: '3x'}}, /max_scans: is "3x"/],
    [{plan_options: {no_pictures: 'false'}}, /no_pictures: is "false", must be true or false/],
    [{inspection: {rig: {part_holding: 'PART_HOLDING_FIXTUER'}}}, /part_holding: is "PART_HOLDING_FIXTUER", must be one of/],
    [{inspection: {goal: {coverage: 'abc'}}}, /inspection\.goal\.coverage: is "abc", must be a number/],
    [{inspection: {obstacles: {}}}, /inspection\.obstacles: must be a list/],
    [{inspection: {obstacles: [{fil: ''}]}}, /inspection\.obstacles\[0\]\.fil: is no field/],
    [[], /must be an object/],
  ]) assert.throws(() => checkTask(contract, task), reason);
});
