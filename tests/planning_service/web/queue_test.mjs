// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {queueText} from '../../../planning_service/web/page/queue.js';

const job = (id, priority, second) => ({job_id: id, priority, created_at: new Date(1000 * second).toISOString()});

test('every job that starts earlier is counted, and no other', () => {
  // In the order in which they start.
  const queued = [job('a', 5, 30), job('b', 5, 40), job('c', 0, 10), job('d', 0, 20), job('e', -1, 1)];
  for (const [ahead, one] of queued.entries()) {
    for (const order of [queued, queued.toReversed?.() ?? [...queued].reverse()]) {
      const text = queueText(one, order, []);
      assert.match(text, ahead === 0 ? /none of your jobs is ahead/ : new RegExp(`^Waiting: ${ahead} jobs? ahead of it`));
    }
  }
});

test('running jobs are named, and lists that were cut off', () => {
  const one = job('c', 0, 10);
  assert.equal(queueText(one, [one], [job('r', 0, 1)]), 'Waiting: 1 job running.');
  assert.equal(queueText(one, [one, job('a', 0, 1)], [job('r', 0, 1), job('s', 0, 2)]),
      'Waiting: 1 job ahead of it in the queue, 2 jobs running.');
  assert.match(queueText(one, [one, job('a', 0, 1)], [], true), /^Waiting: at least 1 job ahead/);
});
