#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// Jobs by OPC UA while gateway and service are killed by SIGKILL at random moments.
//
//   node bench/faults_bench.mjs [--jobs 50] [--seed 1] [--mean-s 8] [--task FILE]
//
// SIGHTLINE_BIN: folder with the program sightline; default build/release/bin. The client knows only the
// companion specification: it logs in again after each loss, asks for missed events by RepeatEvents, and
// orders with the same MeasId until the event Ready. --mean-s: mean time between kills. Exit code 1 if
// an order or an event is lost or comes twice, if its events are out of order, if a result cannot be
// fetched, or if the service has more or fewer jobs than were ordered.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';
import {parseArgs} from 'node:util';
import opcua from 'node-opcua';
import tar from 'tar-stream';
import {ServiceClient} from '../src/orders/service_client.js';
import {hashPassword} from '../src/password.js';
import {freePort} from '../tests/free_port.mjs';

const {DataType, UserTokenType} = opcua;
const ROOT = fileURLToPath(new URL('../../..', import.meta.url));
const BIN = process.env.SIGHTLINE_BIN ?? path.join(ROOT, 'build/release/bin');
const RECIPE = path.join(ROOT, 'examples/factory/recipe');
const PASSWORD = 'a password of the bench';
const USER = {type: UserTokenType.UserName, userName: 'mes', password: PASSWORD};
const EVENTS_OF_ORDER = ['JobStartedEventType', 'ResultReadyEventType', 'ReadyEventType'];
const LOGOUT_MS = 3000;

const {values: options} = parseArgs({options: {jobs: {type: 'string', default: '50'}, seed: {type: 'string', default: '1'},
  'mean-s': {type: 'string', default: '8'}, task: {type: 'string', default: path.join(RECIPE, 'task.json')}}});
const work = mkdtempSync(path.join(tmpdir(), 'faults-bench-'));
process.env.MES_PACKAGES = path.join(ROOT, 'clients/opcua_gateway');
process.env.MES_PKI = path.join(work, 'mes_pki');
const {connect} = await import(path.join(ROOT, 'examples/factory/order_plan.mjs'));
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

let random_state = Number(options.seed);
function random() {
  random_state = (Math.imul(random_state, 1664525) + 1013904223) >>> 0;
  return random_state / 2 ** 32;
}

// A process that is started again after each kill.
class Victim {
  constructor(name, command, args) {
    Object.assign(this, {name, command, args, kills: 0});
  }

  start() {
    const child = spawn(this.command, this.args, {stdio: ['ignore', 'pipe', 'ignore'], cwd: work});
    this.child = child;
    this.ended = new Promise((resolve) => child.once('exit', resolve));
    let said = '';
    return new Promise((resolve) => {
      child.stdout.on('data', (text) => {
        said += text;
        if (said.includes('listening on')) resolve();
      });
      child.once('exit', resolve);
    });
  }

  async kill(signal) {
    this.child.kill(signal);
    await this.ended;
  }
}

const orders = Array.from({length: Number(options.jobs)}, (_, i) => `order-${i + 1}`);
const events = new Map();  // by EventId, in the order of arrival
const types = (order) => [...events.values()].filter((event) => event.job_id === order).map((event) => event.type);
const isReady = (order) => types(order).includes('ReadyEventType');

const last = {number: [0, 0]};
function note(event) {
  events.set(event.id, event);
  const number = Number.parseInt(event.id.slice(16), 16);
  if (number > last.number[0] * 2 ** 32 + last.number[1]) last.number = [Math.floor(number / 2 ** 32), number % 2 ** 32];
}

// Events that were raised while nobody listened, or that got lost with a connection.
async function repeatEvents(vision, after) {
  for (let from = after;;) {
    const [next] = await vision.call(['RepeatEvents'], [{dataType: DataType.UInt64, arrayType: 0, value: from}]);
    if (next[0] === from[0] && next[1] === from[1]) return;
    from = next;
  }
}

async function recipe() {
  const archive = tar.pack();
  archive.entry({name: 'task.json'}, readFileSync(options.task));
  archive.entry({name: 'block.stl'}, readFileSync(path.join(RECIPE, 'block.stl')));
  archive.finalize();
  const blocks = [];
  for await (const block of archive) blocks.push(block);
  return Buffer.concat(blocks);
}

// One session: goes on with the orders until all are ready or the connection breaks.
async function work_on(connection, isLost) {
  const {vision} = connection;
  const after = last.number;
  await vision.subscribe(note);
  await repeatEvents(vision, after);
  for (const order of orders) {
    while (!isReady(order)) {
      if (isLost()) return;
      const state = await vision.state();
      if (state === 'Initialized') await vision.sendRecipe('plan', await recipe());
      if (state === 'Ready' && !isReady(order)) await vision.startSingleJob(order, 'plan').catch((error) => {
        // The state may have changed since.
        if (error.status?.name !== 'BadInvalidState') throw error;
      });
      await sleep(100);
    }
  }
}

async function followOrders(url) {
  let logins = 0;
  while (!orders.every(isReady)) {
    const lost = {};
    try {
      const connection = await connect(url, 'mes', USER);
      logins++;
      const is_lost = new Promise((resolve) => {
        for (const sign of ['connection_lost', 'close', 'abort']) connection.client.on(sign, () => {
          lost.now = true;
          resolve();
        });
      });
      const working = work_on(connection, () => lost.now);
      working.catch(() => {});  // calls that end after the connection is lost
      await Promise.race([working, is_lost]);
      const leave = connection.session.close().catch(() => {}).then(() => connection.client.disconnect());
      await Promise.race([leave.catch(() => {}), sleep(LOGOUT_MS)]);
    } catch (error) {
      console.log(`again: ${error.message.split('\n')[0]}`);
      await sleep(200);
    }
  }
  return logins;
}

async function killAtRandom(victims, isOver) {
  while (!isOver()) {
    const wait_ms = -Math.log(1 - random()) * 1000 * Number(options['mean-s']);
    for (let waited = 0; waited < wait_ms && !isOver(); waited += 100) await sleep(100);
    if (isOver()) return;
    const victim = victims[Math.floor(random() * victims.length)];
    await victim.kill('SIGKILL');
    victim.kills++;
    console.log(`killed ${victim.name}; ${orders.filter(isReady).length} of ${orders.length} orders are ready`);
    await victim.start();
  }
}

async function allJobs(address) {
  const client = new ServiceClient({address}, {name: 'bench'});
  const {jobs} = await client.call('ListPlanningJobs', {page_size: 1000});
  client.close();
  return jobs;
}

async function bench() {
  const address = `unix:${work}/planning.sock`;
  const port = await freePort();
  writeFileSync(path.join(work, 'gateway.json'), JSON.stringify({service: {address}, host: '127.0.0.1', port, data: 'gateway',
    accept_unknown_certificates: true, clients: [{name: 'mes', users: {mes: hashPassword(PASSWORD)}}]}));
  const service = new Victim('service', path.join(BIN, 'sightline'), ['serve', '--data', path.join(work, 'data'), '--listen', address]);
  const gateway = new Victim('gateway', process.execPath, [path.join(ROOT, 'clients/opcua_gateway/gateway.js'), path.join(work, 'gateway.json')]);
  const victims = [service, gateway];
  for (const victim of victims) await victim.start();
  process.once('exit', () => victims.forEach((victim) => victim.child.kill()));
  const started = Date.now();
  let is_over = false;
  const killing = killAtRandom(victims, () => is_over);
  const url = `opc.tcp://127.0.0.1:${port}/sightline`;
  const logins = await followOrders(url);
  is_over = true;
  await killing;
  for (const order of orders) assert.deepEqual(types(order), EVENTS_OF_ORDER, order);
  const {client, session, vision} = await connect(url, 'mes', USER);
  for (const {result_id, type} of events.values()) {
    if (type !== 'ResultReadyEventType') continue;
    const plan = JSON.parse(await vision.fetch(`${result_id}/plan.json`));
    assert.ok(plan.scans.length > 0);
  }
  await session.close();
  await client.disconnect();
  const jobs = await allJobs(address);
  assert.deepEqual(jobs.map((job) => job.request_id).sort(), [...orders].sort());
  console.log(`${orders.length} orders in ${Math.round((Date.now() - started) / 1000)} s, ${gateway.kills} kills of the gateway, ` +
      `${service.kills} of the service, ${logins} logins: 0 lost, 0 twice; ${orders.length} plans fetched`);
  for (const victim of [...victims].reverse()) await victim.kill('SIGTERM');
}

// The OPC UA library raises errors of connections that were cut outside the calls that wait for them.
for (const kind of ['unhandledRejection', 'uncaughtException']) process.on(kind, (error) => console.log(`connection: ${error.message}`));
const failure = await bench().then(() => null, (error) => error);
rmSync(work, {recursive: true, force: true});
if (failure) console.error(failure);
process.exit(failure ? 1 : 0);
