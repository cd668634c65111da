#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// A simulated MES: orders a plan from a vision system of OPC 40100-1, follows it by events, and
// fetches its results. It knows the companion specification, and nothing of the gateway's code.
//
//   node order_plan.mjs ENDPOINT SYSTEM RECIPE.tar OUT_FOLDER [MEAS_ID]
//
// MES_USER, MES_PASSWORD: the user. MES_PKI: folder of this client's certificate. MES_PACKAGES: folder
// with node_modules/node-opcua; default: beside this script. MES_TRACE: file that gets the session, decoded.
// The same MEAS_ID again is the same job.
// OUT_FOLDER gets report.html, plan.json, plan.qif if there is one, order.json, what happened, and
// index.html, the page of the order.
import {randomUUID} from 'node:crypto';
import {appendFileSync} from 'node:fs';
import {mkdir, readFile, writeFile} from 'node:fs/promises';
import {createRequire} from 'node:module';
import path from 'node:path';
import {mesPage} from './mes_page.mjs';

const {MES_PACKAGES, MES_PASSWORD, MES_PKI, MES_TRACE, MES_USER} = process.env;
const require = createRequire(MES_PACKAGES ? path.join(path.resolve(MES_PACKAGES), 'x.js') : import.meta.url);
const {AttributeIds, constructEventFilter, DataType, MessageSecurityMode, OPCUACertificateManager, OPCUAClient,
  resolveNodeId, SecurityPolicy, UserTokenType} = require('node-opcua');

const MACHINE_VISION = 'http://opcfoundation.org/UA/MachineVision';
const SYSTEMS = 'urn:sightline:opcua-gateway';
const BLOCK_BYTES = 1 << 18;
const TIMEOUT_MS = 1_800_000;  // of the whole order
const CALL_TIMEOUT_MS = 120_000;  // of one call, also on a busy machine
const MAX_CONNECT_TRIES = 20;
const TOO_LATE = /premature disconnection|timed out|timeout/i;
const EVENT_FIELDS = ['EventId', 'EventType', 'Message', 'Severity', 'Time', 'JobId', 'ResultId', 'ResultState'];

// Numbers of the data types in the companion specification's NodeSet.
const DATA_TYPES = {RecipeIdExternalDataType: 3002, ProductIdDataType: 3003, PartIdDataType: 3004, RecipeTransferOptions: 3012,
  MeasIdDataType: 3015, ResultIdDataType: 3021, ResultTransferOptions: 3022};

const text = (dataType, value) => ({dataType, value});
const structure = (value) => ({dataType: DataType.ExtensionObject, value});

// Shows a value of an argument in the trace: structures by their fields, files by their size.
function decoded(value) {
  if (Buffer.isBuffer(value)) return `${value.length} bytes`;
  if (value instanceof Date) return value.toISOString();
  if (Array.isArray(value)) return `[${value.map(decoded).join(', ')}]`;
  if (value?.namespace !== undefined && value.identifierType !== undefined) return value.toString();
  if (typeof value !== 'object' || value === null) return JSON.stringify(value) ?? 'null';
  if (value.type === 'Buffer') return `${value.data.length} bytes`;
  if (value.dataType !== undefined && value.arrayType !== undefined) return decoded(value.value);
  const fields = Object.entries(value.toJSON?.() ?? value).filter(([, field]) => field !== null && field !== undefined);
  return `{${fields.map(([name, field]) => `${name}: ${decoded(field)}`).join(', ')}}`;
}

function trace(line) {
  if (MES_TRACE) appendFileSync(MES_TRACE, `${line}\n`);
}

class VisionClient {
  constructor(session, root, index) {
    Object.assign(this, {session, root, index});
    this.nodes = new Map();  // found before, by path
  }

  // The node below the vision system, by names of the companion specification.
  async node(names) {
    const key = names.join('/');
    if (this.nodes.has(key)) return this.nodes.get(key);
    let at = this.root;
    for (const name of names) {
      const found = await this.session.browse({nodeId: at, referenceTypeId: 'HierarchicalReferences', includeSubtypes: true, resultMask: 63});
      const next = found.references.find((reference) => reference.browseName.name === name);
      if (!next) throw new Error(`${name}: the vision system does not have it`);
      at = next.nodeId;
    }
    this.nodes.set(key, at);
    return at;
  }

  // Writes names, classes and types of the nodes down to `depth` below to the trace.
  async traceTree(nodeId = this.root, depth = 2, indent = '') {
    const {references} = await this.session.browse({nodeId, referenceTypeId: 'HierarchicalReferences', includeSubtypes: true, resultMask: 63});
    for (const {browseName, nodeClass, nodeId: child} of references) {
      trace(`${indent}  ${['', 'object', 'variable', '', 'method'][nodeClass] ?? ''} ${browseName.toString()}`);
      if (depth > 1 && nodeClass === 1) await this.traceTree(child, depth - 1, `${indent}  `);
    }
  }

  // A structure such as RecipeIdExternalDataType.
  async structure(name, fields) {
    return structure(await this.session.constructExtensionObject(resolveNodeId(`ns=${this.index};i=${DATA_TYPES[name]}`), fields));
  }

  // Values that the method gives back. Throws with the status code otherwise.
  async call(names, inputArguments, parent = undefined) {
    const objectId = parent ?? await this.node(names.slice(0, -1));
    const methodId = parent ? await this.childOf(parent, names.at(-1)) : await this.node(names);
    const result = await this.session.call({objectId, methodId, inputArguments});
    const list = (values) => (values ?? []).map(({value}) => decoded(value)).join(', ');
    trace(`call ${names.join('/')}(${list(inputArguments)})\n  ${result.statusCode.name} ${list(result.outputArguments)}`);
    if (result.statusCode.isNotGood()) {
      const error = new Error(`${names.at(-1)}: ${result.statusCode.name}`);
      error.status = result.statusCode;
      throw error;
    }
    return result.outputArguments.map((output) => output.value);
  }

  async childOf(nodeId, name) {
    const {references} = await this.session.browse({nodeId, referenceTypeId: 'HierarchicalReferences', includeSubtypes: true, resultMask: 63});
    return references.find((reference) => reference.browseName.name === name).nodeId;
  }

  async state() {
    const read = async (names) => (await this.session.read({nodeId: await this.node(names), attributeId: AttributeIds.Value})).value.value?.text ?? '';
    const automatic = await read(['VisionStateMachine', 'AutomaticModeStateMachine', 'CurrentState']);
    return automatic || read(['VisionStateMachine', 'CurrentState']);
  }

  async sendRecipe(external_id, archive) {
    const [internalId] = await this.call(['RecipeManagement', 'AddRecipe'], [
      await this.structure('RecipeIdExternalDataType', {id: external_id}), await this.structure('ProductIdDataType', {id: ''})]);
    const [file, handle] = await this.call(['RecipeManagement', 'RecipeTransfer', 'GenerateFileForWrite'],
        [await this.structure('RecipeTransferOptions', {internalId})]);
    for (let at = 0; at < archive.length; at += BLOCK_BYTES) {
      await this.call(['Write'], [text(DataType.UInt32, handle), text(DataType.ByteString, archive.subarray(at, at + BLOCK_BYTES))], file);
    }
    await this.call(['RecipeManagement', 'RecipeTransfer', 'CloseAndCommit'], [text(DataType.UInt32, handle)]);
    const [prepared] = await this.call(['RecipeManagement', 'PrepareRecipe'],
        [await this.structure('RecipeIdExternalDataType', {id: external_id}), structure(internalId)]);
    return prepared;
  }

  async startSingleJob(meas_id, external_id) {
    const [job] = await this.call(['VisionStateMachine', 'AutomaticModeStateMachine', 'StartSingleJob'], [
      await this.structure('MeasIdDataType', {id: meas_id}), await this.structure('PartIdDataType', {id: ''}),
      await this.structure('RecipeIdExternalDataType', {id: external_id}), await this.structure('ProductIdDataType', {id: ''}),
      {dataType: DataType.Variant, arrayType: 1, value: []}]);
    return job.id;
  }

  async result(result_id) {
    const [, result] = await this.call(['ResultManagement', 'GetResultById'],
        [await this.structure('ResultIdDataType', {id: result_id}), text(DataType.Int32, 0)]);
    return result;
  }

  async fetch(id) {
    const [file, handle] = await this.call(['ResultManagement', 'ResultTransfer', 'GenerateFileForRead'],
        [await this.structure('ResultTransferOptions', {id: {id}})]);
    const blocks = [];
    for (;;) {
      const [block] = await this.call(['Read'], [text(DataType.UInt32, handle), text(DataType.Int32, BLOCK_BYTES)], file);
      if (block.length === 0) break;
      blocks.push(block);
    }
    await this.call(['Close'], [text(DataType.UInt32, handle)], file);
    return Buffer.concat(blocks);
  }

  // Calls `on_event` for each new event; events that come again have the same EventId.
  async subscribe(on_event) {
    const subscription = await this.session.createSubscription2({requestedPublishingInterval: 200, requestedLifetimeCount: 600,
      requestedMaxKeepAliveCount: 20, maxNotificationsPerPublish: 0, publishingEnabled: true, priority: 1});
    const q = (name) => ['JobId', 'ResultId', 'ResultState'].includes(name) ? `${this.index}:${name}` : name;
    // Fields of several types: the type that has them all.
    const filter = constructEventFilter(EVENT_FIELDS.map(q));
    const item = await subscription.monitor({nodeId: this.root, attributeId: AttributeIds.EventNotifier},
        {filter, discardOldest: false, queueSize: 10_000, samplingInterval: 0}, 0);
    const seen = new Set();
    const names = new Map();
    item.on('changed', async (values) => {
      const event = Object.fromEntries(EVENT_FIELDS.map((name, i) => [name, values[i].value]));
      const id = event.EventId.toString('hex');
      if (seen.has(id)) return;
      seen.add(id);
      const type = event.EventType.toString();
      if (!names.has(type)) names.set(type, (await this.session.read({nodeId: type, attributeId: AttributeIds.BrowseName})).value.value.name);
      trace(`event ${names.get(type)} ${decoded(Object.fromEntries(EVENT_FIELDS.slice(2).map((name) => [name, event[name]])))}`);
      on_event({id, type: names.get(type), time: event.Time, message: event.Message?.text ?? '', job_id: event.JobId?.id,
        result_id: event.ResultId?.id, result_state: event.ResultState});
    });
    return subscription;
  }
}

const userOfEnvironment = () => ({type: UserTokenType.UserName, userName: MES_USER, password: MES_PASSWORD});

async function connectOnce(endpoint, user) {
  const clientCertificateManager = new OPCUACertificateManager({rootFolder: path.resolve(MES_PKI ?? 'mes_pki'),
    automaticallyAcceptUnknownCertificate: true});
  await clientCertificateManager.initialize();
  const client = OPCUAClient.create({applicationName: 'Simulated MES', clientCertificateManager, endpointMustExist: false,
    securityMode: MessageSecurityMode.SignAndEncrypt, securityPolicy: SecurityPolicy.Basic256Sha256,
    transportTimeout: CALL_TIMEOUT_MS, defaultTransactionTimeout: CALL_TIMEOUT_MS, keepSessionAlive: true,
    connectionStrategy: {initialDelay: 200, maxDelay: 2000, maxRetry: 30}});
  client.on('backoff', () => console.log('waiting for the gateway'));
  try {
    await client.connect(endpoint);
    return {client, session: await client.createSession(user)};
  } catch (error) {
    await client.disconnect();
    throw error;
  }
}

// A session of the user, and the vision system of that name. A gateway that answers too late is asked again.
export async function connect(endpoint, system, user = userOfEnvironment()) {
  let connection;
  for (let tries = 1; connection === undefined; tries++) {
    connection = await connectOnce(endpoint, user).catch((error) => {
      if (tries === MAX_CONNECT_TRIES || !TOO_LATE.test(error.message)) throw error;
      return undefined;
    });
  }
  const {client, session} = connection;
  const namespaces = (await session.read({nodeId: 'i=2255', attributeId: AttributeIds.Value})).value.value;
  const vision = new VisionClient(session, `ns=${namespaces.indexOf(SYSTEMS)};s=${system}`, namespaces.indexOf(MACHINE_VISION));
  return {client, session, vision};
}

async function main([endpoint, system, recipe_file, folder, meas_id = randomUUID()]) {
  if (!folder) throw new Error('usage: order_plan.mjs ENDPOINT SYSTEM RECIPE.tar OUT_FOLDER [MEAS_ID]');
  const {client, session, vision} = await connect(endpoint, system);
  if (MES_TRACE) {
    trace(`browse ${vision.root}`);
    await vision.traceTree();
  }
  const events = [];
  let finish;
  const finished = new Promise((resolve) => {
    finish = resolve;
  });
  await vision.subscribe((event) => {
    events.push(event);
    console.log(`event ${event.type} ${event.message}`);
    if (event.type === 'ReadyEventType' && event.job_id === meas_id) finish();
  });
  console.log(`state ${await vision.state()}`);
  await vision.sendRecipe('plan', await readFile(recipe_file));
  console.log(`state ${await vision.state()}: the recipe is prepared`);
  const job_id = await vision.startSingleJob(meas_id, 'plan');
  console.log(`job ${job_id}`);
  const timer = setTimeout(() => {
    console.error('the job did not end in time');
    process.exit(1);
  }, TIMEOUT_MS);
  await finished;
  clearTimeout(timer);
  const ready = events.find((event) => event.type === 'ResultReadyEventType' && event.job_id === meas_id);
  if (ready?.result_state !== 1) throw new Error(`the job failed: ${events.map((event) => event.message).join('; ')}`);
  const result = await vision.result(ready.result_id);
  const {files} = JSON.parse(result.resultContent[0].value);
  await mkdir(folder, {recursive: true});
  const saved = ['report.html', 'plan.json', 'plan.qif'].filter((name) => files.some((file) => file.name === name));
  for (const name of saved) {
    await writeFile(path.join(folder, name), await vision.fetch(`${ready.result_id}/${name}`));
    console.log(`saved ${path.join(folder, name)}`);
  }
  const plan = JSON.parse(await readFile(path.join(folder, 'plan.json'), 'utf8'));
  const order = {job_id, result_id: ready.result_id, files, events};
  await writeFile(path.join(folder, 'order.json'), JSON.stringify(order, null, 1));
  await writeFile(path.join(folder, 'index.html'), mesPage({order, plan, saved: [...saved, 'order.json']}));
  await session.close();
  await client.disconnect();
  console.log(`plan fetched: ${plan.scans.length} scans`);
}

if (process.argv[1]?.endsWith('order_plan.mjs')) {
  main(process.argv.slice(2)).then(() => process.exit(0), (error) => {
    console.error(error.message);
    process.exit(1);
  });
}
