// SPDX-License-Identifier: Apache-2.0
// The edge node at a real mosquitto, with a host application that decodes by Eclipse Tahu's library
// and holds every message against rules of the specification.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import net from 'node:net';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {after, before, test} from 'node:test';
import {fileURLToPath} from 'node:url';
import mqtt from 'mqtt';
import sparkplug from 'sparkplug-payload';

const PROGRAM = fileURLToPath(new URL('../sparkplug.js', import.meta.url));
const {encodePayload, decodePayload} = sparkplug.get('spBv1.0');
const work = mkdtempSync(path.join(tmpdir(), 'sparkplug-test-'));
const NODE = 'spBv1.0/factory/%/planning';
const topic = (type, device) => NODE.replace('%', type) + (device ? `/${device}` : '');

const received = [];  // {type, device, payload}, in order of arrival
const cancelled = [];  // requests to the service
let port;
let broker;
let edge;
let host;  // connection of the host application and of the service's events
let service;

async function freePort() {
  const server = net.createServer().listen(0, '127.0.0.1');
  await once(server, 'listening');
  const {port: found} = server.address();
  server.close();
  await once(server, 'close');
  return found;
}

async function until(condition, what) {
  for (let tries = 0; tries < 800; tries++) {
    if (condition()) return;
    await new Promise((resolve) => setTimeout(resolve, 25));
  }
  assert.fail(`${what} did not happen`);
}

function start(program, args) {
  const child = spawn(program, args, {stdio: ['ignore', 'ignore', 'inherit'], env: {...process.env, PATH: `${process.env.PATH}:/usr/sbin`}});
  child.ended = once(child, 'exit');
  return child;
}

async function startBroker() {
  broker = start('mosquitto', ['-c', path.join(work, 'mosquitto.conf')]);
  for (let tries = 0; tries < 400; tries++) {
    const socket = net.connect(port, '127.0.0.1');
    const is_open = await Promise.race([once(socket, 'connect').then(() => true), once(socket, 'error').then(() => false)]).catch(() => false);
    socket.destroy();
    if (is_open) return;
    await new Promise((resolve) => setTimeout(resolve, 25));
  }
  assert.fail('mosquitto did not start');
}

async function startHost() {
  host = mqtt.connect(`mqtt://127.0.0.1:${port}`, {reconnectPeriod: 100});
  host.on('error', () => {});
  await once(host, 'connect');
  host.on('message', (name, bytes, packet) => {
    const [, , type, , device] = name.split('/');
    if (type.endsWith('CMD')) return;
    received.push({type, device, payload: decodePayload(bytes), qos: packet.qos, retain: packet.retain});
  });
  await host.subscribeAsync('spBv1.0/#', {qos: 1});
}

const startEdge = () => {
  edge = start(process.execPath, [PROGRAM, path.join(work, 'sparkplug.json')]);
};

const publish = (event_id, type, job) => host.publishAsync(`sightline/jobs/${job.job_id}/${type}`, JSON.stringify({event_id: String(event_id),
  type, time: '2026-01-31T12:00:00.000000Z', job: {kind: 'plan', client: 'mes', state: 'RUNNING', ...job}}), {qos: 1});
const values = ({payload}) => Object.fromEntries((payload.metrics ?? []).map(({name, value}) => [name, value]));
const seqOf = ({payload}) => Number(payload.seq);
const ofType = (type) => received.filter((message) => message.type === type);

before(async () => {
  port = await freePort();
  writeFileSync(path.join(work, 'mosquitto.conf'),
      `log_type none\nlistener ${port} 127.0.0.1\nallow_anonymous true\npersistence true\npersistence_location ${work}/\nuser root\n`);
  service = createServer((request, response) => {
    cancelled.push(`${request.method} ${request.url}`);
    response.writeHead(200).end('{}');
  }).listen(0, '127.0.0.1');
  await once(service, 'listening');
  writeFileSync(path.join(work, 'sparkplug.json'), JSON.stringify({group: 'factory', node: 'planning', state: 'state.json',
    broker: {url: `mqtt://127.0.0.1:${port}`}, service: {url: `http://127.0.0.1:${service.address().port}`}}));
  await startBroker();
  await startHost();
  await host.publishAsync('sightline/status', 'online', {qos: 1, retain: true});
  startEdge();
});

after(async () => {
  edge?.kill('SIGKILL');
  await host?.endAsync(true);
  broker?.kill('SIGKILL');
  service?.close();
  rmSync(work, {recursive: true, force: true});
});

test('the node is born with its number and its rebirth command', async () => {
  await until(() => ofType('NBIRTH').length === 1, 'NBIRTH');
  const [birth] = ofType('NBIRTH');
  assert.deepEqual([birth.qos, birth.retain, seqOf(birth)], [0, false, 0]);
  assert.ok(Number(birth.payload.timestamp) > Date.UTC(2020, 0));
  const {bdSeq, ...others} = values(birth);
  assert.equal(Number(bdSeq), 0);
  assert.equal(others['Node Control/Rebirth'], false);
  assert.equal(birth.payload.metrics.find(({name}) => name === 'bdSeq').type, 'Int64');
});

test('a job becomes a device and data of it, each event once', async () => {
  await until(() => received.some((message) => values(message)['Service/Online'] === true), 'Service/Online');
  await publish(1, 'accepted', {job_id: 'j1', state: 'QUEUED', request_id: 'order-17'});
  await publish(2, 'progress', {job_id: 'j1', progress: 0.5});
  await publish(2, 'progress', {job_id: 'j1', progress: 0.5});
  await publish(3, 'failed', {job_id: 'j1', state: 'FAILED', failure: {code: 'RESOURCE_EXHAUSTED', reason: 'OUT_OF_MEMORY', message: 'needs 80 GB'}});
  await until(() => ofType('DDATA').length >= 2, 'DDATA');
  const [birth] = ofType('DBIRTH');
  assert.equal(birth.device, 'mes');
  assert.deepEqual([values(birth)['Job/Id'], values(birth)['Job/State'], values(birth)['Job/Request Id']], ['j1', 'QUEUED', 'order-17']);
  const names = new Set(birth.payload.metrics.map(({name}) => name));
  const [progress, failed] = ofType('DDATA');
  assert.equal(values(progress)['Job/Progress'], 0.5);
  assert.equal(values(failed)['Job/Failure'], 'OUT_OF_MEMORY: needs 80 GB');
  assert.equal(Number(failed.payload.metrics[0].timestamp), Date.UTC(2026, 0, 31, 12));
  for (const {name} of failed.payload.metrics) assert.ok(names.has(name), `${name} was not in the DBIRTH`);
  assert.equal(ofType('DDATA').length, 2);
});

test('messages that are no events are left out', async () => {
  for (const text of ['', 'no JSON', '{}', '{"event_id": 7, "type": "done"}', '{"event_id": "7"}', 'null']) {
    await host.publishAsync('sightline/jobs/x/done', text, {qos: 1});
  }
  await publish(4, 'done', {job_id: 'j2', state: 'SUCCEEDED'});
  await until(() => ofType('DDATA').length === 3, 'DDATA');
  assert.equal(values(ofType('DDATA')[2])['Job/Id'], 'j2');
});

test('sequence numbers count from 0 to 255 and again', async () => {
  for (let i = 0; i < 300; i++) await publish(10 + i, 'progress', {job_id: 'j3', progress: i / 300});
  await until(() => ofType('DDATA').length === 303, '300 events');
  const messages = received.filter(({type}) => type !== 'NDEATH');
  messages.forEach((message, i) => assert.equal(seqOf(message), i % 256));
});

test('a rebirth request is answered by births with the last values', async () => {
  const count = received.length;
  await host.publishAsync(topic('NCMD'), 'no payload', {qos: 1});
  await host.publishAsync(topic('NCMD'), encodePayload({timestamp: 1, metrics: [{name: 'Node Control/Rebirth', type: 'Boolean', value: true}]}), {qos: 1});
  await until(() => received.length >= count + 2, 'births');
  const [node, device] = received.slice(-2);
  assert.deepEqual([node.type, seqOf(node), device.type, seqOf(device)], ['NBIRTH', 0, 'DBIRTH', 1]);
  assert.equal(Number(values(node).bdSeq), 0);
  assert.equal(values(device)['Job/Progress'], 299 / 300);
});

test('a command cancels a job', async () => {
  const metrics = [{name: 'Device Control/Cancel', type: 'String', value: 'j3/../x'}];
  await host.publishAsync(topic('DCMD', 'nobody'), encodePayload({timestamp: 1, metrics}), {qos: 1});
  await host.publishAsync(topic('DCMD', 'mes'), encodePayload({timestamp: 1, metrics}), {qos: 1});
  await until(() => cancelled.length > 0, 'the cancellation');
  assert.deepEqual(cancelled, ['DELETE /v1/jobs/j3%2F..%2Fx']);
});

test('devices die with the service and are born with it', async () => {
  await host.publishAsync('sightline/status', 'offline', {qos: 1, retain: true});
  await until(() => ofType('DDEATH').length === 1, 'DDEATH');
  assert.equal(ofType('DDEATH')[0].device, 'mes');
  await host.publishAsync('sightline/status', 'online', {qos: 1, retain: true});
  await until(() => received.at(-1).type === 'DBIRTH', 'DBIRTH');
});

test('kill -9: the broker sends the death of this birth, and the next birth has the next number', async () => {
  edge.kill('SIGKILL');
  await until(() => ofType('NDEATH').length === 1, 'NDEATH');
  const [death] = ofType('NDEATH');
  assert.equal(Number(values(death).bdSeq), 0);
  assert.ok(death.payload.seq === undefined || death.payload.seq === null);
  // Events of the time without a connection wait at the broker.
  await publish(1000, 'done', {job_id: 'j4', state: 'SUCCEEDED', client: 'line/3'});
  startEdge();
  await until(() => received.some(({type, device}) => type === 'DBIRTH' && device === 'line%2f3'), 'the new device');
  const birth = ofType('NBIRTH').at(-1);
  assert.deepEqual([Number(values(birth).bdSeq), seqOf(birth)], [1, 0]);
  const born = received.slice(received.indexOf(birth)).filter(({type}) => type === 'DBIRTH');
  assert.ok(born.some((message) => message.device === 'mes' && values(message)['Job/Id'] === 'j3'));
});

test('the broker is killed: the node is born anew', async () => {
  const count = ofType('NBIRTH').length;
  broker.kill('SIGKILL');
  await broker.ended;
  await host.endAsync(true);
  await startBroker();
  await startHost();
  await until(() => ofType('NBIRTH').length > count, 'NBIRTH');
  const birth = ofType('NBIRTH').at(-1);
  assert.ok(Number(values(birth).bdSeq) > 1);
  // A killed broker has forgotten its sessions: events count from when the program has subscribed again.
  let event_id = 1001;
  const timer = setInterval(() => publish(event_id++, 'progress', {job_id: 'j5'}).catch(() => {}), 200);
  await until(() => received.some((message) => values(message)['Job/Id'] === 'j5'), 'the event').finally(() => clearInterval(timer));
});

test('SIGTERM: the node says that it dies', async () => {
  const birth = ofType('NBIRTH').at(-1);
  edge.kill('SIGTERM');
  assert.deepEqual(await edge.ended, [0, null]);
  await until(() => received.at(-1).type === 'NDEATH', 'NDEATH');
  assert.equal(Number(values(received.at(-1)).bdSeq), Number(values(birth).bdSeq));
});
