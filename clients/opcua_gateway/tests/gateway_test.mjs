// SPDX-License-Identifier: Apache-2.0
// The gateway before a service in memory, as clients see it: the simulated MES of examples/factory,
// which knows nothing of the gateway's code.
import assert from 'node:assert/strict';
import {createHash} from 'node:crypto';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {after, before, test} from 'node:test';
import {fileURLToPath} from 'node:url';
import opcua from 'node-opcua';
import tar from 'tar-stream';
import {hashPassword} from '../src/password.js';
import {start} from '../src/server.js';
import {FakeService} from './fake_service.mjs';
import {freePort} from './free_port.mjs';

const {AttributeIds, DataType, OPCUACertificateManager, UserTokenType} = opcua;
const HERE = path.dirname(fileURLToPath(import.meta.url));
const ROOT = process.env.SIGHTLINE_PROTO ? path.dirname(process.env.SIGHTLINE_PROTO) : path.join(HERE, '../../..');
const MACHINE = ['VisionStateMachine'];
const AUTOMATIC = [...MACHINE, 'AutomaticModeStateMachine'];
const MAX_SESSIONS = 12;
const CAUSE = [{dataType: DataType.Int32, value: 0}, {dataType: DataType.String, value: ''}];

const work = mkdtempSync(path.join(tmpdir(), 'gateway-test-'));
process.env.MES_PACKAGES = path.join(HERE, '..');
process.env.MES_PKI = path.join(work, 'mes_pki');
const {connect} = await import(path.join(ROOT, 'examples/factory/order_plan.mjs'));

const service = new FakeService(`unix:${work}/service.sock`);
const user = (userName, password = `${userName}'s password`) => ({type: UserTokenType.UserName, userName, password});
const clients = new Set();
let gateway;
let certificates;
let mes;  // {client, session, vision} of the user mes
const events = [];

// Waits as long as it takes: a busy machine fails no test.
async function until(condition) {
  while (!await condition()) await new Promise((resolve) => setTimeout(resolve, 50));
}

async function login(identity, system = 'mes') {
  const connection = await connect(gateway.url, system, identity);
  clients.add(connection.client);
  return connection;
}

async function logout({session, client}) {
  await session.close();
  await client.disconnect();
  clients.delete(client);
}

// Status code that a call is refused with; 'Good' when it is not.
const statusOf = (call) => call.then(() => 'Good', (error) => error.status?.name ?? error.message);
const becomes = (state) => until(async () => await mes.vision.state() === state);

async function recipe(files) {
  const archive = tar.pack();
  for (const [name, text] of files) archive.entry({name}, text);
  archive.finalize();
  const blocks = [];
  for await (const block of archive) blocks.push(block);
  return Buffer.concat(blocks);
}

async function certificate(name, dates) {
  const manager = new OPCUACertificateManager({rootFolder: path.join(work, 'users')});
  await manager.initialize();
  const file = path.join(work, `${name}.pem`);
  await manager.createSelfSignedCertificate({applicationUri: `urn:${name}`, subject: `/CN=${name}`, outputFile: file, dns: [],
    ...dates});
  const privateKey = readFileSync(manager.privateKey, 'utf8');
  const der = Buffer.from(readFileSync(file, 'utf8').replace(/-----[^-]*-----|\s/g, ''), 'base64');
  await manager.dispose();
  return {digest: createHash('sha256').update(der).digest('hex'), identity: {type: UserTokenType.Certificate, certificateData: der, privateKey}};
}

before(async () => {
  await service.start();
  certificates = {known: await certificate('known', {startDate: new Date(), validity: 10}),
    unknown: await certificate('unknown', {startDate: new Date(), validity: 10}),
    expired: await certificate('expired', {startDate: new Date('2020-01-01'), validity: 10})};
  const file = path.join(work, 'gateway.json');
  const hash = (name) => hashPassword(`${name}'s password`);
  writeFileSync(file, JSON.stringify({service: {address: service.address}, host: '127.0.0.1', port: await freePort(),
    data: 'data', accept_unknown_certificates: true, max_sessions: MAX_SESSIONS, min_free_bytes: 0,
    clients: [{name: 'mes', users: {mes: hash('mes')}, certificates: [certificates.known.digest, certificates.expired.digest]},
      {name: 'line', users: {line: hash('line')}}]}));
  gateway = await start(file);
  mes = await login(user('mes'));
  await mes.vision.subscribe((event) => events.push(event));
});

after(async () => {
  for (const client of clients) await client.disconnect();
  await gateway?.stop();
  service.stop();
  rmSync(work, {recursive: true, force: true});
});

test('every method in every state', async () => {
  const methods = {Stop: AUTOMATIC, Abort: AUTOMATIC, StartContinuous: AUTOMATIC, SimulationMode: AUTOMATIC, Halt: MACHINE, Reset: MACHINE};
  const no = 'BadInvalidState';
  const never = 'BadNotSupported';
  const expected = {Stop: no, Abort: no, StartContinuous: never, SimulationMode: never, Halt: never, Reset: no};
  const {vision} = mes;
  const id = (type) => vision.structure(type, {id: ''});
  const inputs = {StartContinuous: [await id('MeasIdDataType'), await id('PartIdDataType'), await id('RecipeIdExternalDataType'),
    await id('ProductIdDataType'), {dataType: DataType.Variant, arrayType: 1, value: []}],
    SimulationMode: [{dataType: DataType.Boolean, value: true}, ...CAUSE]};
  const check = async (state, changed = {}) => {
    await becomes(state);
    for (const [method, parent] of Object.entries(methods)) {
      const status = await statusOf(vision.call([...parent, method], inputs[method] ?? CAUSE));
      assert.equal(status, changed[method] ?? expected[method], `${method} in ${state}`);
    }
  };
  await check('Initialized');
  await vision.sendRecipe('plan', await recipe([['task.json', '{"kind": "plan"}']]));
  await check('Ready');
  service.stop();
  await check('Preoperational');
  await service.start();
  await becomes('Ready');
  await vision.startSingleJob('states', 'plan');
  assert.equal(await statusOf(vision.startSingleJob('second', 'plan')), no);
  await check('SingleExecution', {Stop: 'Good'});
  service.disk_is_full = true;
  await check('Error');
  service.disk_is_full = false;
  await check('Error', {Reset: 'Good'});
  await becomes('Ready');
});

const stop = () => mes.vision.call([...AUTOMATIC, 'Stop'], CAUSE);
const typesOf = (job_id) => events.filter((event) => event.job_id === job_id).map((event) => event.type);
const ENDED = ['JobStartedEventType', 'ResultReadyEventType', 'ReadyEventType'];

test('a job that waits behind others is SingleExecution and can be stopped', async () => {
  await mes.vision.startSingleJob('waits', 'plan');
  assert.equal(service.state(), 'READY');
  await new Promise((resolve) => setTimeout(resolve, 1000));
  assert.equal(await mes.vision.state(), 'SingleExecution');
  await stop();
  assert.equal(service.jobs.get('waits').state, 'CANCELLED');
  await becomes('Ready');
});

test('Stop of a job that the service has not confirmed cancels it when the service is back', async () => {
  service.lose_answers = Infinity;
  await mes.vision.startSingleJob('unconfirmed', 'plan');
  assert.equal(await statusOf(stop()), 'Good');
  service.stop();
  await becomes('Preoperational');
  assert.equal(service.jobs.get('unconfirmed').state, 'QUEUED');
  service.lose_answers = 0;
  await service.start();
  await becomes('Ready');
  assert.equal(service.jobs.get('unconfirmed').state, 'CANCELLED');
});

test('the event Ready finds the state Ready, 20 times; each order has its events once and in order', async () => {
  for (let i = 0; i < 20; i++) {
    const id = `order-${i}`;
    await mes.vision.startSingleJob(id, 'plan');
    service.jobs.get(id).state = 'RUNNING';
    service.end(service.jobs.get(id));
    await until(() => typesOf(id).includes('ReadyEventType'));
    assert.equal(await mes.vision.state(), 'Ready');
    assert.equal(await mes.vision.startSingleJob(id, 'plan'), id);
  }
  for (let i = 0; i < 20; i++) assert.deepEqual(typesOf(`order-${i}`), ENDED);
});

test('RepeatEvents raises them again in pieces, under the same ids', async () => {
  const count = events.length;
  const again = [];
  const second = await login(user('mes'));
  await second.vision.subscribe((event) => again.push(event));
  const number = (last) => ({dataType: DataType.UInt64, arrayType: 0, value: last});
  let last = [0, 0];
  for (let calls = 0; calls < 10; calls++) {
    const [next] = await second.vision.call(['RepeatEvents'], [number(last)]);
    if (next[1] === last[1]) break;
    last = next;
  }
  await until(() => again.length >= count);
  assert.deepEqual(again.map((event) => event.id), events.map((event) => event.id));
  assert.equal(parseInt(events.at(-1).id.slice(16), 16), last[1]);
  await logout(second);
});

test('ids that are wrong', async () => {
  const {vision} = mes;
  assert.equal(await statusOf(vision.startSingleJob('x'.repeat(129), 'plan')), 'BadInvalidArgument');
  assert.equal(await statusOf(vision.startSingleJob('new', 'nobody')), 'BadNotFound');
  for (const id of ['', '__proto__', '../../etc/passwd', 'x'.repeat(100)]) {
    assert.equal(await statusOf(vision.result(id)), 'BadNotFound', id);
    assert.equal(await statusOf(vision.fetch(id)), 'BadNotFound', id);
  }
  const {job_id} = service.jobs.get('order-0');
  assert.equal((await vision.fetch(`${job_id}/plan.json`)).toString(), service.result.toString());
  for (const name of ['../plan.json', '/plan.json', 'plan.json/', 'other']) {
    assert.equal(await statusOf(vision.fetch(`${job_id}/${name}`)), 'BadNotFound', name);
  }
});

test('recipes that are wrong', async () => {
  const {vision} = mes;
  for (const files of [[], [['other', '']], [['task.json', '{']], [['task.json', '{"kinds": "plan"}']], [['../task.json', '{}']],
    [['task.json', '{}'], ['a', 'x'], ['a', 'y']], [['task.json', '['.repeat(100_000)]]]) {
    assert.equal(await statusOf(vision.sendRecipe('wrong', await recipe(files))), 'BadInvalidArgument', JSON.stringify(files).slice(0, 60));
  }
  assert.equal(await statusOf(vision.sendRecipe('wrong', Buffer.from('no archive'.repeat(100)))), 'BadInvalidArgument');
  assert.equal(await vision.state(), 'Ready');
});

test('a recipe that is prepared and removed at the same time is gone or prepared, never half of it', async () => {
  const {vision} = mes;
  const archive = await recipe([['task.json', '{"kind": "plan"}']]);
  const external = await vision.structure('RecipeIdExternalDataType', {id: 'both'});
  const remove = () => vision.call(['RecipeManagement', 'RemoveRecipe'], [external]);
  for (let i = 0; i < 5; i++) {
    const prepare = vision.sendRecipe('both', archive);
    await Promise.all([statusOf(prepare), statusOf(remove()), statusOf(remove())]);
  }
  while (await statusOf(remove()) === 'Good');
  // A line that brings a recipe back after its removal would have no name.
  const ledger = readFileSync(path.join(work, 'data/clients/mes/ledger.jsonl'), 'utf8').trim().split('\n').map((line) => JSON.parse(line));
  const names = new Map();
  for (const {recipe: noted, removed_recipe} of ledger) {
    if (removed_recipe) names.delete(removed_recipe);
    if (!noted) continue;
    names.set(noted.internal_id, noted.external_id ?? names.get(noted.internal_id));
    assert.ok(names.get(noted.internal_id), JSON.stringify(noted));
  }
  assert.ok(![...names.values()].includes('both'));
  assert.ok(!service.recipes.has('both'));
});

test('another client sees states, and neither calls methods nor gets events or reasons', async () => {
  const other = await login(user('line'));
  let stolen = 0;
  await other.vision.subscribe(() => stolen++).catch(() => {});
  assert.equal(await other.vision.state(), 'Ready');
  assert.equal(await statusOf(other.vision.startSingleJob('theft', 'plan')), 'BadUserAccessDenied');
  const read = async ({session, vision}) =>
    (await session.read({nodeId: await vision.node(['LastRefusal']), attributeId: AttributeIds.Value})).statusCode.name;
  assert.equal(await read(mes), 'Good');
  assert.notEqual(await read(other), 'Good');
  await mes.vision.startSingleJob('private', 'plan');
  service.end(service.jobs.get('private'));
  await until(() => typesOf('private').length === 3);
  // Events of earlier recipes may still arrive.
  assert.equal(typesOf('private').length, 3);
  assert.equal(typesOf('theft').length, 0);
  assert.equal(stolen, 0);
  await logout(other);
});

test('an id that was used for something else, and exchanged arguments, are refused', async () => {
  const {vision} = mes;
  const call = async ({meas = ['MeasIdDataType', 'same'], part = '', product = '', recipe_type = 'RecipeIdExternalDataType'}) => {
    const structure = ([type, id]) => vision.structure(type, {id});
    return statusOf(vision.call([...AUTOMATIC, 'StartSingleJob'], [await structure(meas), await structure(['PartIdDataType', part]),
      await structure([recipe_type, 'same recipe']), await structure(['ProductIdDataType', product]),
      {dataType: DataType.Variant, arrayType: 1, value: []}]));
  };
  await vision.sendRecipe('same recipe', await recipe([['task.json', '{"kind": "plan"}']]));
  await becomes('Ready');
  assert.equal(await call({meas: ['PartIdDataType', 'same']}), 'BadTypeMismatch');
  assert.equal(await call({recipe_type: 'MeasIdDataType'}), 'BadTypeMismatch');
  assert.equal(await call({part: 'part 1'}), 'Good');
  service.end(service.jobs.get('same'));
  await becomes('Ready');
  assert.equal(await call({part: 'part 1'}), 'Good');
  assert.equal(await call({part: 'part 2'}), 'BadEntryExists');
  assert.equal(await call({part: 'part 1', product: 'product'}), 'BadEntryExists');
  await vision.sendRecipe('same recipe', await recipe([['task.json', '{"kind": "evaluate"}']]));
  assert.equal(await call({part: 'part 1'}), 'BadEntryExists');
  // Both contents, so that later tests have one recipe.
  for (let i = 0; i < 2; i++) {
    await statusOf(vision.call(['RecipeManagement', 'RemoveRecipe'], [await vision.structure('RecipeIdExternalDataType', {id: 'same recipe'})]));
  }
});

test('a second gateway with the same folder ends and leaves the ledgers of the first', async () => {
  const configuration = JSON.parse(readFileSync(path.join(work, 'gateway.json'), 'utf8'));
  const second = path.join(work, 'second.json');
  writeFileSync(second, JSON.stringify({...configuration, port: await freePort()}));
  await assert.rejects(start(second), /another gateway is running with this folder/);
  const ledger = () => readFileSync(path.join(work, 'data/clients/mes/ledger.jsonl'), 'utf8');
  await mes.vision.startSingleJob('after the second', 'plan');
  assert.match(ledger(), /after the second/);
  service.end(service.jobs.get('after the second'));
  await becomes('Ready');
});

test('users: a wrong password, nobody, certificates that are known, unknown and expired', async () => {
  for (const [identity, status] of [[user('mes', 'wrong'), /Rejected|Denied/], [user('nobody'), /Rejected|Denied/],
    [{type: UserTokenType.Anonymous}, /ANONYMOUS/], [certificates.unknown.identity, /Rejected/],
    [certificates.expired.identity, /Rejected/], [certificates.expired.identity, /Rejected/]]) {
    await assert.rejects(login(identity), status);
  }
  const known = await login(certificates.known.identity);
  assert.equal(await statusOf(known.vision.startSingleJob('by certificate', 'plan')), 'Good');
  await logout(known);
  await stop();
});

test('sessions and subscriptions have limits, and the next client is served after them', async () => {
  const refused = [];
  const opened = [];
  for (let i = 0; i < MAX_SESSIONS + 1; i++) {
    await login(user('mes')).then((connection) => opened.push(connection), (error) => refused.push(error.message));
  }
  assert.ok(opened.length > 5 && opened.length < MAX_SESSIONS);
  for (const reason of refused) assert.match(reason, /BadTooManySessions/);
  const subscribe = () => opened[0].vision.subscribe(() => {}).then(() => 'Good', (error) => error.message);
  const answers = [];
  for (let i = 0; i < 8; i++) answers.push(await subscribe());
  assert.equal(answers.filter((answer) => answer === 'Good').length, 5);
  for (const connection of opened) await logout(connection);
  await logout(await login(user('mes')));
});

const BLOCKS = ['MachineryBuildingBlocks'];
const CONTROL = [...BLOCKS, 'JobManagement', 'JobOrderControl'];
const RESPONSES = [...BLOCKS, 'JobManagement', 'JobOrderResults'];
const MACHINERY_RESULTS = [...BLOCKS, 'ResultManagement'];
const valueOf = async ({session, vision}, names) => session.read({nodeId: await vision.node(names), attributeId: AttributeIds.Value});
const textOf = (value) => ({dataType: DataType.String, value});
const COMMENT = {dataType: DataType.LocalizedText, arrayType: 1, value: []};
const PREFIX = {jobs: 'http://opcfoundation.org/UA/ISA95-JOBCONTROL_V2/', results: 'http://opcfoundation.org/UA/Machinery/Result/'};

// A structure of OPC 10031-4 or OPC 40001-101, by the number of its data type in the NodeSet.
async function structureOf(uri, number, fields) {
  const namespaces = (await mes.session.read({nodeId: 'i=2255', attributeId: AttributeIds.Value})).value.value;
  const type = opcua.resolveNodeId(`ns=${namespaces.indexOf(uri)};i=${number}`);
  return {dataType: DataType.ExtensionObject, value: await mes.session.constructExtensionObject(type, fields)};
}

const jobOrder = (jobOrderID, ...recipes) => structureOf(PREFIX.jobs, 3008, {jobOrderID, workMasterID: recipes.map((ID) => ({ID}))});
const storeAndStart = async (...order) => mes.vision.call([...CONTROL, 'StoreAndStart'], [await jobOrder(...order), COMMENT]);
const responseTo = async (id) => (await mes.vision.call([...RESPONSES, 'RequestJobResponseByJobOrderID'], [textOf(id)]))[0];

test('a system is one of the machines, with a nameplate that stays the same', async () => {
  const names = async (nodeId, mask = 0) => (await mes.session.browse({nodeId, referenceTypeId: 'HierarchicalReferences',
    includeSubtypes: true, nodeClassMask: mask, resultMask: 63})).references.map((reference) => reference.browseName.name);
  const index = (await mes.session.read({nodeId: 'i=2255', attributeId: AttributeIds.Value})).value.value
      .indexOf('http://opcfoundation.org/UA/Machinery/');
  assert.deepEqual((await names(`ns=${index};i=1001`)).sort(), ['line', 'mes']);
  const nameplate = {};
  for (const name of await names(await mes.vision.node(['Identification']))) {
    nameplate[name] = (await valueOf(mes, ['Identification', name])).value.value;
  }
  const [first] = readFileSync(path.join(work, 'data/clients/mes/ledger.jsonl'), 'utf8').split('\n');
  assert.equal(nameplate.SerialNumber, JSON.parse(first).ledger);
  assert.equal(nameplate.ProductInstanceUri, `urn:sightline:opcua-gateway:${nameplate.SerialNumber}`);
  assert.equal(nameplate.Manufacturer.text, 'Sightline');
});

test('a job order of OPC 40001-3 is a single job: its states, its response and its result', async () => {
  const state = async () => (await valueOf(mes, [...BLOCKS, 'MachineryItemState', 'CurrentState'])).value.value.text;
  const listed = async () => (await valueOf(mes, [...CONTROL, 'JobOrderList'])).value.value
      .find((entry) => entry.jobOrder.jobOrderID === 'job order')?.state[0].stateText.text;
  await becomes('Ready');
  assert.equal(await state(), 'NotExecuting');
  assert.deepEqual((await valueOf(mes, [...CONTROL, 'WorkMaster'])).value.value.map(({ID}) => ID), ['plan']);
  assert.deepEqual(await storeAndStart('job order', 'plan'), [[0, 1]]);
  assert.equal(await state(), 'Executing');
  assert.equal(await listed(), 'AllowedToStart');
  const job = service.jobs.get('job order');
  job.state = 'RUNNING';
  await until(async () => await listed() === 'Running');
  assert.equal((await responseTo('job order')).jobState[0].stateNumber, 3);
  service.end(job);
  await until(async () => await listed() === 'Ended');
  const response = await responseTo('job order');
  assert.equal(response.jobResponseID, job.job_id);
  assert.deepEqual(response.jobResponseData.map(({ID, value}) => [ID, value.value]), [['JobResult', 1]]);
  const latest = await mes.vision.call([...MACHINERY_RESULTS, 'GetLatestResult'], [CAUSE[0]]);
  const byId = await mes.vision.call([...MACHINERY_RESULTS, 'GetResultById'], [textOf(job.job_id), CAUSE[0]]);
  for (const [, result] of [latest, byId]) {
    assert.equal(result.resultMetaData.jobId, 'job order');
    assert.equal(result.resultMetaData.resultState, 1);
    assert.equal(JSON.parse(result.resultContent[0].value).files[0].name, 'plan.json');
  }
  await becomes('Ready');
  assert.ok(typesOf('job order').length <= 3);
  await until(() => typesOf('job order').includes('ReadyEventType'));
  assert.deepEqual(typesOf('job order'), ENDED);
});

test('job orders that are wrong, aborted and of others', async () => {
  const abort = (id) => statusOf(mes.vision.call([...CONTROL, 'Abort'], [textOf(id), COMMENT]));
  assert.equal(await statusOf(storeAndStart('', 'plan')), 'BadInvalidArgument');
  assert.equal(await statusOf(storeAndStart('two', 'plan', 'plan')), 'BadInvalidArgument');
  assert.equal(await statusOf(storeAndStart('x'.repeat(129), 'plan')), 'BadInvalidArgument');
  assert.equal(await statusOf(storeAndStart('new', 'nobody')), 'BadNotFound');
  assert.equal(await statusOf(storeAndStart('job order', 'nobody')), 'BadEntryExists');
  assert.equal(await statusOf(storeAndStart('job order', 'plan')), 'Good');
  assert.equal(await statusOf(responseTo('new')), 'BadNotFound');
  assert.equal(await abort('new'), 'BadNotFound');
  assert.equal(await abort('job order'), 'BadInvalidState');
  await storeAndStart('aborted', 'plan');
  assert.equal(await statusOf(storeAndStart('second', 'plan')), 'BadInvalidState');
  assert.equal(await abort('aborted'), 'Good');
  assert.equal((await responseTo('aborted')).jobState[0].stateText.text, 'Aborted');
  const inState = await structureOf(PREFIX.jobs, 3006, {stateNumber: 6});
  const [responses] = await mes.vision.call([...RESPONSES, 'RequestJobResponseByJobOrderState'],
      [{dataType: DataType.ExtensionObject, arrayType: 1, value: [inState.value]}]);
  assert.ok(responses.some(({jobOrderID}) => jobOrderID === 'aborted'));
  assert.ok(!responses.some(({jobOrderID}) => jobOrderID === 'job order'));
  await becomes('Ready');
});

test('another client can neither read nor monitor orders and reasons', async () => {
  const other = await login(user('line'));
  const subscription = await other.session.createSubscription2({requestedPublishingInterval: 50, requestedLifetimeCount: 600,
    requestedMaxKeepAliveCount: 5, publishingEnabled: true});
  const seen = [];
  for (const names of [['LastRefusal'], [...CONTROL, 'JobOrderList'], [...CONTROL, 'WorkMaster']]) {
    assert.equal((await valueOf(other, names)).statusCode.name, 'BadNotReadable', names.at(-1));
    for (const samplingInterval of [0, 50]) {
      const item = await subscription.monitor({nodeId: await mes.vision.node(names), attributeId: AttributeIds.Value},
          {samplingInterval, queueSize: 10, discardOldest: true}, 0).catch(() => null);
      item?.on('changed', (value) => seen.push([names.at(-1), value.statusCode.name, value.value.value]));
    }
  }
  // The state is public: its change says that later notifications would have come, too.
  const states = [];
  const state = await subscription.monitor({nodeId: await other.vision.node([...AUTOMATIC, 'CurrentState']), attributeId: AttributeIds.Value},
      {samplingInterval: 0, queueSize: 10, discardOldest: true}, 0);
  state.on('changed', (value) => states.push(value.value.value?.text));
  assert.equal(await statusOf(storeAndStart('secret', 'nobody')), 'BadNotFound');
  await storeAndStart('secret', 'plan');
  await until(() => states.includes('SingleExecution'));
  service.end(service.jobs.get('secret'));
  await until(() => states.at(-1) === 'Ready');
  assert.deepEqual(seen.filter(([, status]) => status === 'Good'), []);
  await subscription.terminate();
  await logout(other);
});
