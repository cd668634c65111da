// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {queueText} from '../../../planning_service/web/page/queue.js';

test('the jobs ahead are told in words', () => {
  assert.equal(queueText({jobs_ahead: 0}), 'Waiting to start: next in the queue.');
  assert.equal(queueText({jobs_ahead: 1}), 'Waiting: 1 job ahead.');
  assert.equal(queueText({jobs_ahead: 3}), 'Waiting: 3 jobs ahead.');
});

test('a job of an event has no count', () => {
  assert.equal(queueText({state: 'QUEUED'}), 'Waiting to start.');
});
