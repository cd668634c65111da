#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// Load on the gateway, in a process of its own, before a service in memory.
//
//   node bench/gateway_bench.mjs sessions [--count 200]
//   node bench/gateway_bench.mjs memory [--minutes 20] [--clients 10]
//
// sessions: opens as many sessions as the gateway allows. The next one is refused, those that are there
// go on, and one that ends makes room. Exit code 1 if not.
// memory: clients subscribe to events and states, and begin again once a minute, while a job is ordered
// every five seconds. Prints resident memory once a minute and its slope at the end.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';
import {parseArgs} from 'node:util';
import opcua from 'node-opcua';
import tar from 'tar-stream';
import {hashPassword} from '../src/password.js';
import {FakeService} from '../tests/fake_service.mjs';
import {freePort} from '../tests/free_port.mjs';

const {AttributeIds, UserTokenType} = opcua;
const HERE = path.dirname(fileURLToPath(import.meta.url));
const KEPT_ORDERS = 5000;
const AT_ONCE = 4;
const JOB_EVERY_MS = 5000;
const SAMPLE_EVERY_MS = 10_000;
const MS_OF_MINUTE = 60_000;

const work = mkdtempSync(path.join(tmpdir(), 'gateway-bench-'));
process.env.MES_PACKAGES = path.join(HERE, '..');
process.env.MES_PKI = path.join(work, 'mes_pki');
const {connect} = await import(path.join(HERE, '../../../examples/factory/order_plan.mjs'));
const PASSWORD = 'a password of the bench';
const USER = {type: UserTokenType.UserName, userName: 'mes', password: PASSWORD};
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// As many finished orders as the gateway keeps, so that its memory does not grow by them.
function fillLedger(folder) {
  mkdirSync(folder, {recursive: true});
  const lines = [{ledger: '00112233aabbccdd', last_number: 0, raised_number: 3 * KEPT_ORDERS}];
  for (let i = 0; i < KEPT_ORDERS; i++) {
    const request_id = `before-${i}`;
    const job = {job_id: `job-before-${i}`, state: 'SUCCEEDED', results: [{name: 'plan.json', size_bytes: 1, digest: '0'.repeat(64)}]};
    const types = ['JobStarted', 'ResultReady', 'Ready'];
    lines.push({order: {request_id, meas_id: request_id, part_id: '', product_id: '', external_recipe_id: 'plan', is_closed: true,
      is_started: true, job_id: job.job_id, job},
    events: types.map((type, k) => ({number: 3 * i + k + 1, type, request_id, time: '2026-01-01T00:00:00.000Z', result_state: 1}))});
  }
  writeFileSync(path.join(folder, 'ledger.jsonl'), lines.map((line) => JSON.stringify(line) + '\n').join(''));
}

// Returns {url, pid, end()}.
async function startGateway(service, max_sessions) {
  const port = await freePort();
  const file = path.join(work, 'gateway.json');
  fillLedger(path.join(work, 'data/clients/mes'));
  writeFileSync(file, JSON.stringify({service: {address: service.address}, host: '127.0.0.1', port, data: 'data',
    accept_unknown_certificates: true, max_sessions, min_free_bytes: 0, clients: [{name: 'mes', users: {mes: hashPassword(PASSWORD)}}]}));
  const process_of = spawn(process.execPath, [path.join(HERE, '../gateway.js'), file], {stdio: ['ignore', 'pipe', 'inherit']});
  const url = await new Promise((resolve, reject) => {
    let said = '';
    process_of.stdout.on('data', (text) => {
      said += text;
      const found = /listening on (\S+)/.exec(said);
      if (found) resolve(found[1]);
    });
    process_of.once('exit', () => reject(new Error('the gateway did not start')));
  });
  const ended = new Promise((resolve) => process_of.once('exit', resolve));
  process.once('exit', () => process_of.kill());
  return {url, pid: process_of.pid, end: () => {
    process_of.kill();
    return ended;
  }};
}

async function recipe() {
  const archive = tar.pack();
  archive.entry({name: 'task.json'}, '{"kind": "plan"}');
  archive.finalize();
  const blocks = [];
  for await (const block of archive) blocks.push(block);
  return Buffer.concat(blocks);
}

async function until(condition) {
  while (!await condition()) await sleep(50);
}

// Orders a job, which ends at once, and waits until the state machine is ready again.
async function orderJob(service, vision, id) {
  await vision.startSingleJob(id, 'plan');
  service.end(service.jobs.get(id));
  await until(async () => await vision.state() === 'Ready');
  service.jobs.delete(id);  // the memory of the service in this process
}

const login = (gateway) => connect(gateway.url, 'mes', USER);

async function logout({session, client}) {
  await session.close();
  await client.disconnect();
}

async function benchSessions(service, count) {
  const gateway = await startGateway(service, count);
  const started = Date.now();
  const connections = [await login(gateway)];  // alone: it makes the client's certificate
  while (connections.length < count) {
    const group = Array.from({length: Math.min(AT_ONCE, count - connections.length)}, () => login(gateway));
    connections.push(...await Promise.all(group));
    if (connections.length % 20 === 1) console.log(`${connections.length} sessions`);
  }
  console.log(`${count} sessions after ${((Date.now() - started) / 1000).toFixed(1)} s, gateway ${memory(gateway)} MB`);
  const refusal = await login(gateway).then(() => 'none', (error) => error.message);
  console.log(`the next one: ${refusal}`);
  assert.match(refusal, /BadTooManySessions/);
  const [first, ...others] = connections;
  let events = 0;
  await first.vision.subscribe(() => events++);
  await first.vision.sendRecipe('plan', await recipe());
  await orderJob(service, first.vision, 'one of many');
  await until(() => events >= 4);
  const states = await Promise.all(others.map(({vision}) => vision.state()));
  console.log(`a job ran with ${events} events; ${states.filter((state) => state === 'Ready').length} other sessions read Ready`);
  assert.ok(states.every((state) => state === 'Ready'));
  await logout(connections.pop());
  connections.push(await login(gateway));
  console.log('one that ended made room for another');
  await Promise.all(connections.map(logout));
  await gateway.end();
}

// Resident memory of the gateway's process [MB].
function memory({pid}) {
  return Math.round(parseInt(/VmRSS:\s*(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'))[1], 10) / 1024);
}

// Slope of the least-squares line through points of time [min] and memory [MB].
function slope(samples) {
  const mean = (list) => list.reduce((sum, value) => sum + value, 0) / list.length;
  const [t, m] = [mean(samples.map(([time]) => time)), mean(samples.map(([, value]) => value))];
  const spread = samples.reduce((sum, [time]) => sum + (time - t) ** 2, 0);
  return samples.reduce((sum, [time, value]) => sum + (time - t) * (value - m), 0) / spread;
}

// Subscribes, and ends after a minute. Calls `on_event` at each event.
async function followForAMinute(gateway, isOver, on_event) {
  const connection = await login(gateway);
  const subscription = await connection.vision.subscribe(on_event);
  for (const name of ['CurrentState', 'LastTransition']) {
    const nodeId = await connection.vision.node(['VisionStateMachine', name]).catch(() => null);
    if (nodeId) await subscription.monitor({nodeId, attributeId: AttributeIds.Value}, {samplingInterval: 200, queueSize: 10}, 0);
  }
  const end = Date.now() + MS_OF_MINUTE;
  while (Date.now() < end && !isOver()) await sleep(500);
  await subscription.terminate();
  await logout(connection);
}

// Subscribes once a minute from the start, until `isOver()`; again at once where a connection is lost.
async function follow(gateway, isOver, phase, counts) {
  await sleep(phase * MS_OF_MINUTE);
  while (!isOver()) {
    await followForAMinute(gateway, isOver, () => counts.events++).catch(() => counts.lost++);
  }
}

async function benchMemory(service, minutes, count) {
  const gateway = await startGateway(service, 100);
  const orders = await login(gateway);
  await orders.vision.sendRecipe('plan', await recipe());
  const started = Date.now();
  const minute = () => (Date.now() - started) / MS_OF_MINUTE;
  const isOver = () => minute() >= minutes;
  const counts = {events: 0, lost: 0};
  // The client's library reads types of events in the background, and throws where the session ends meanwhile.
  process.on('uncaughtException', (error) => {
    if (!/Session has been closed|Transaction has been canceled/.test(error.message)) throw error;
    counts.lost++;
  });
  const followers = Array.from({length: count}, (_, i) => follow(gateway, isOver, i / count, counts));
  const samples = [];
  let jobs = 0;
  const sampling = setInterval(() => {
    samples.push([minute(), memory(gateway)]);
    if (samples.length % 6 === 0) console.log(`${minute().toFixed(1)} min: ${samples.at(-1)[1]} MB, ${jobs} jobs`);
  }, SAMPLE_EVERY_MS);
  while (!isOver()) {
    await orderJob(service, orders.vision, `order-${jobs++}`);
    await sleep(JOB_EVERY_MS);
  }
  clearInterval(sampling);
  await Promise.all(followers);
  const later = samples.filter(([time]) => time >= minutes / 2);
  console.log(`${count} clients, ${minutes} min, ${jobs} jobs, ${counts.events} events, ${counts.lost} connections lost; slope of the second half: ` +
      `${(60 * slope(later)).toFixed(1)} MB an hour, ${later[0][1]} to ${later.at(-1)[1]} MB`);
  await logout(orders);
  await gateway.end();
}

const {positionals: [what], values} = parseArgs({allowPositionals: true, options: {
  count: {type: 'string', default: '200'}, minutes: {type: 'string', default: '20'}, clients: {type: 'string', default: '10'}}});
const benches = {sessions: (service) => benchSessions(service, Number(values.count)),
  memory: (service) => benchMemory(service, Number(values.minutes), Number(values.clients))};
if (!benches[what]) {
  console.error('usage: node bench/gateway_bench.mjs sessions [--count N] | memory [--minutes N] [--clients N]');
  process.exit(2);
}
const service = new FakeService(`unix:${work}/service.sock`);
await service.start();
const failure = await benches[what](service).then(() => null, (error) => error);
service.stop();
rmSync(work, {recursive: true, force: true});
if (failure) console.error(failure);
process.exit(failure ? 1 : 0);
