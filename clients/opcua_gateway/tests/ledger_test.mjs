// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {spawnSync} from 'node:child_process';
import {appendFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import test from 'node:test';
import {ClientJobs} from '../src/orders/client_jobs.js';
import {Ledger} from '../src/orders/ledger.js';

function folder(t) {
  const result = mkdtempSync(path.join(tmpdir(), 'ledger-'));
  t.after(() => rmSync(result, {recursive: true}));
  return result;
}

const away = () => Object.assign(new Error('away'), {code: 14, details: 'away'});

// A service in memory that goes away at random, before or after it did what it was asked.
class UnreliableService {
  constructor(seed) {
    this.random = seed;
    this.jobs = new Map();
  }

  chance() {
    this.random = (Math.imul(this.random, 1664525) + 1013904223) >>> 0;
    return this.random / 2 ** 32;
  }

  async call(method, request) {
    if (this.chance() < 0.2) throw away();
    const answer = this[method](request);
    if (this.chance() < 0.2) throw away();
    return answer;
  }

  StartJob({request_id}) {
    if (!this.jobs.has(request_id)) {
      this.jobs.set(request_id, {job_id: `job-${this.jobs.size}`, state: 'QUEUED', results: [], looks: 0});
    }
    return {job: this.jobs.get(request_id)};
  }

  GetPlanningJob({job_id}) {
    const job = [...this.jobs.values()].find((j) => j.job_id === job_id);
    job.state = ['QUEUED', 'RUNNING', 'SUCCEEDED'][Math.min(2, ++job.looks)];
    return {job: {...job}};
  }

  async visionState() {
    return 'READY';
  }
}

test('a line that a crash cut off does not count', (t) => {
  const at = folder(t);
  const ledger = new Ledger(at);
  ledger.write({order: {request_id: 'a'}, events: [{type: 'JobStarted', request_id: 'a'}]});
  appendFileSync(path.join(at, 'ledger.jsonl'), '{"order":{"request_id":"b"');
  const again = new Ledger(at);
  assert.deepEqual([...again.orders.keys()], ['a']);
  assert.equal(again.last_number, 1);
  assert.deepEqual(again.eventId(1), ledger.eventId(1));
  again.write({events: [{type: 'Ready', request_id: 'a'}]});
  assert.deepEqual(new Ledger(at).events.map((event) => event.number), [1, 2]);
});

// A bug found: a damaged line in the middle was left out, and with it orders and events.
test('a damaged line is refused by its number, and the file stays', (t) => {
  const at = folder(t);
  const ledger = new Ledger(at);
  for (const id of ['a', 'b']) ledger.write({order: {request_id: id}, events: [{type: 'Ready', request_id: id}]});
  const file = path.join(at, 'ledger.jsonl');
  const lines = readFileSync(file, 'utf8').split('\n');
  for (let i = 0; i < lines.length - 1; i++) {
    for (const damaged of [lines[i].slice(1), 'null', '{"events":7}', '']) {
      const bytes = [...lines.slice(0, i), damaged, ...lines.slice(i + 1)].join('\n');
      writeFileSync(file, bytes);
      assert.throws(() => new Ledger(at), new RegExp(`ledger\\.jsonl: line ${i + 1} is damaged`));
      assert.equal(readFileSync(file, 'utf8'), bytes);
    }
  }
});

// The ledger's file as any kill may leave it: cut behind any byte.
test('numbers stay in order wherever the file was cut', (t) => {
  const at = folder(t);
  const ledger = new Ledger(at);
  for (const id of ['a', 'b', 'c']) ledger.write({order: {request_id: id}, events: [{type: 'Ready', request_id: id}]});
  const bytes = readFileSync(path.join(at, 'ledger.jsonl'));
  for (let size = 0; size <= bytes.length; size += 7) {
    const cut = folder(t);
    appendFileSync(path.join(cut, 'ledger.jsonl'), bytes.subarray(0, size));
    const found = new Ledger(cut).events.map((event) => event.number);
    assert.deepEqual(found, [1, 2, 3].slice(0, found.length));
  }
});

test('50 orders with both sides failing: each starts once and ends once', async (t) => {
  const at = folder(t);
  const service = new UnreliableService(7);
  const nothing = {on_state() {}, on_events() {}};
  for (let i = 0; i < 50; i++) {
    // A new gateway in the middle of every order.
    const first = new ClientJobs(service, new Ledger(at), nothing);
    await first.start({request_id: `order-${i}`, external_recipe_id: 'plan'});
    await first.look();
    for (let looks = 0; looks < 100; looks++) {
      const jobs = new ClientJobs(service, new Ledger(at), nothing);
      await jobs.start({request_id: `order-${i}`, external_recipe_id: 'plan'});
      await jobs.look();
      if (jobs.openOrders().length === 0) break;
    }
  }
  const ledger = new Ledger(at);
  assert.equal(service.jobs.size, 50);
  assert.deepEqual(ledger.events.map((event) => event.number), ledger.events.map((event, i) => i + 1));
  for (let i = 0; i < 50; i++) {
    const types = ledger.events.filter((event) => event.request_id === `order-${i}`).map((event) => event.type);
    assert.deepEqual(types, ['JobStarted', 'ResultReady', 'Ready']);
  }
});

// The limit of a file's size is a disk that takes no more: a write ends in the middle of a line.
test('a full disk changes nothing, and the ledger goes on when there is room', (t) => {
  const at = folder(t);
  const program = `
    import {Ledger} from ${JSON.stringify(new URL('../src/orders/ledger.js', import.meta.url))};
    const ledger = new Ledger(${JSON.stringify(at)});
    let count = 0;
    try {
      for (;; count++) ledger.write({order: {request_id: 'order-' + count}, events: [{type: 'Ready', request_id: 'order-' + count}]});
    } catch (error) {
      console.log(JSON.stringify({count, code: error.code, orders: ledger.orders.size, last_number: ledger.last_number}));
    }`;
  const fill = () => JSON.parse(spawnSync('bash', ['-c', 'ulimit -f 8; exec "$0" --input-type=module --eval "$1"', process.execPath, program],
      {encoding: 'utf8'}).stdout);
  const {count, code, orders, last_number} = fill();
  assert.equal(code, 'EFBIG');
  assert.ok(count > 10);
  assert.deepEqual([orders, last_number], [count, count]);
  // A restart on the full disk.
  const again = fill();
  assert.deepEqual([again.count, again.orders], [0, count]);
  const ledger = new Ledger(at);
  assert.equal(ledger.orders.size, count);
  ledger.write({events: [{type: 'Ready', request_id: 'order-0'}]});
  assert.deepEqual(new Ledger(at).events.map((event) => event.number), Array.from({length: count + 1}, (_, i) => i + 1));
});

test('the file is made shorter while the gateway runs', (t) => {
  const at = folder(t);
  const ledger = new Ledger(at);
  ledger.write({order: {request_id: 'a'}, events: [{type: 'Ready', request_id: 'a'}]});
  for (let number = 0; number < 50; number++) ledger.write({raised_number: number});
  const before = ledger.size;
  ledger.appended = 1e9;
  ledger.write({raised_number: 50});
  assert.ok(ledger.size < before / 2);
  assert.equal(ledger.raised_number, 50);
  assert.equal(ledger.size, readFileSync(path.join(at, 'ledger.jsonl')).length);
  ledger.write({order: {request_id: 'b'}});
  assert.deepEqual([...new Ledger(at).orders.keys()], ['a', 'b']);
});
