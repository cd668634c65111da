// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {EventStreamParser, watchJob} from '../../../planning_service/web/page/event_stream.js';

test('events in any pieces', () => {
  const text = ': hello\n\nid: 7\nevent: progress\ndata: {"a":\ndata: 1}\n\r\nid: 8\r\ndata:x\r\n\r\nevent: nothing\n\n';
  const expected = [{id: '7', type: 'progress', data: '{"a":\n1}'}, {id: '8', type: 'message', data: 'x'}];
  for (let size = 1; size <= text.length; ++size) {
    const parser = new EventStreamParser();
    const events = [];
    for (let i = 0; i < text.length; i += size) events.push(...parser.push(text.slice(i, i + size)));
    assert.deepEqual(events, expected, `pieces of ${size}`);
  }
});

test('an event without end is refused', () => {
  const parser = new EventStreamParser();
  assert.throws(() => { for (let i = 0; i < 10; ++i) parser.push('x'.repeat(1 << 20)); }, /too long/);
});

function answerOf(...texts) {
  return new Response(new ReadableStream({
    start(controller) {
      for (const text of texts) {
        if (text instanceof Error) {
          controller.error(text);
          return;
        }
        controller.enqueue(new TextEncoder().encode(text));
      }
      controller.close();
    },
  }));
}

const event = (id, job) => `id: ${id}\nevent: progress\ndata: ${JSON.stringify(job)}\n\n`;

test('a broken stream is taken up after its last event', async () => {
  const answers = [
    () => answerOf(event(1, {state: 'QUEUED'}), event(2, {state: 'RUNNING', message: 'µ'}), 'id: 3\nda'),
    () => { throw new TypeError('no network'); },
    () => answerOf(event(3, {state: 'SUCCEEDED'})),
  ];
  const asked = [], jobs = [], troubles = [];
  await watchJob({
    open: async (lastId) => { asked.push(lastId); return answers[asked.length - 1](); },
    onJob: (job) => jobs.push(job), onConnection: (error) => troubles.push(error?.message ?? null),
    signal: new AbortController().signal,
  });
  assert.deepEqual(asked, ['', '2', '2']);
  assert.deepEqual(jobs.map(({state}) => state), ['QUEUED', 'RUNNING', 'SUCCEEDED']);
  assert.equal(jobs[1].message, 'µ');
  assert.deepEqual(troubles, [null, 'no network', null]);
});

test('no content ends it, and an error that stays is thrown', async () => {
  const base = {onJob() { assert.fail(); }, onConnection() {}, signal: new AbortController().signal};
  await watchJob({...base, open: async () => new Response(null, {status: 204})});
  const unknown = Object.assign(new Error('unknown'), {status: 404, isTransient: false});
  await assert.rejects(watchJob({...base, open: async () => { throw unknown; }}), /unknown/);
});
