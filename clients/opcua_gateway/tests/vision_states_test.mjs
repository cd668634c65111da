// SPDX-License-Identifier: Apache-2.0
// The table of transitions against the companion specification's NodeSet, and a random walk.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import path from 'node:path';
import test from 'node:test';
import {follow, OPERATIONAL_STATES, topState, TRANSITIONS} from '../src/orders/vision_states.js';

const OBSERVED = ['PREOPERATIONAL', 'ERROR', 'INITIALIZED', 'READY', 'SINGLE_EXECUTION'];
const CAUSES = [undefined, undefined, 'PrepareRecipe', 'UnprepareRecipe', 'StartSingleJob', 'Stop', 'Abort', 'Reset'];

// Name, from and to of each transition of the NodeSet, read from its XML.
function standardTransitions() {
  const require = createRequire(import.meta.url);
  const folder = path.dirname(require.resolve('node-opcua-nodesets/package.json'));
  const xml = readFileSync(path.join(folder, 'nodesets', 'Opc.Ua.MachineVision.NodeSet2.xml'), 'utf8');
  const names = new Map();
  const objects = [...xml.matchAll(/<UAObject NodeId="([^"]*)" BrowseName="1:([^"]*)"[^>]*>(.*?)<\/UAObject>/gs)];
  for (const [, id, name] of objects) names.set(id, name);
  const end = (body, type) => names.get(new RegExp(`ReferenceType="${type}">([^<]*)<`).exec(body)?.[1]);
  return new Map(objects.filter(([, , , body]) => /ReferenceType="FromState"/.test(body))
      .map(([, , name, body]) => [name, [end(body, 'FromState'), end(body, 'ToState')]]));
}

// A sequence that is the same in every run.
function* numbers(seed) {
  for (let state = seed;;) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    yield state / 2 ** 32;
  }
}

test('every transition is one of the standard', () => {
  const standard = standardTransitions();
  assert.ok(standard.size > 30, `only ${standard.size} transitions were read`);
  for (const [name, from, to] of TRANSITIONS) assert.deepEqual(standard.get(name), [from, to], name);
});

test('10 000 random steps take only transitions of the table and end where the service is', () => {
  const table = new Map(TRANSITIONS.map(([name, ...ends]) => [name, ends]));
  const random = numbers(1);
  const pick = (list) => list[Math.floor(random.next().value * list.length)];
  const taken = new Set();
  let state = 'Preoperational';
  for (let i = 0; i < 10_000; i++) {
    const observed = pick(OBSERVED);
    const cause = pick(CAUSES);
    const before = state;
    for (const step of follow(state, observed, cause)) {
      const [from, to] = table.get(step.transition) ?? assert.fail(`${step.transition} is not in the table`);
      assert.equal(OPERATIONAL_STATES.includes(from) ? state : topState(state), from, step.transition);
      assert.equal(OPERATIONAL_STATES.includes(to) ? step.state : topState(step.state), to, step.transition);
      // Operational is entered at Initialized.
      if (to === 'Operational') assert.equal(step.state, 'Initialized');
      state = step.state;
      taken.add(step.transition);
    }
    if (before === 'Error' && (cause !== 'Reset' || observed === 'ERROR')) {
      assert.equal(state, 'Error');
    } else {
      const wanted = {PREOPERATIONAL: 'Preoperational', ERROR: 'Error', INITIALIZED: 'Initialized', READY: 'Ready',
        SINGLE_EXECUTION: 'SingleExecution'};
      assert.equal(state, wanted[observed]);
    }
  }
  const never = TRANSITIONS.map(([name]) => name).filter((name) => !taken.has(name));
  assert.deepEqual(never, ['ErrorToPreoperationalAuto']);
});
