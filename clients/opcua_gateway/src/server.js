// SPDX-License-Identifier: Apache-2.0
// The OPC UA server: security, limits, and a vision system for each client.
import {existsSync, mkdirSync, readFileSync, rmSync} from 'node:fs';
import path from 'node:path';
import opcua from 'node-opcua';
import {readConfiguration} from './configuration.js';
import {FileTransfers} from './nodes/file_transfer.js';
import {bindJobMethods} from './nodes/job_methods.js';
import {addMachinery} from './nodes/machinery.js';
import {addJobManagement} from './nodes/machinery_jobs.js';
import {addResultManagement} from './nodes/machinery_results.js';
import {lockFolder} from './orders/folder_lock.js';
import {Ledger} from './orders/ledger.js';
import {bindRecipeMethods} from './nodes/recipe_methods.js';
import {bindResultMethods} from './nodes/result_methods.js';
import {UserCertificates, Users} from './security.js';
import {ServiceClient} from './orders/service_client.js';
import {GATEWAY, VisionSystem} from './nodes/vision_system.js';

const {MessageSecurityMode, nodesets, OPCUACertificateManager, OPCUAServer, SecurityPolicy, UserTokenType} = opcua;
const NODESETS = ['standard', 'di', 'ia', 'machinery', 'isa95JobControl', 'machineryJobs', 'machineryResult', 'machineVision'];
const SUBSCRIPTIONS_PER_SESSION = 5;
const OPERATIONS_PER_CALL = 1000;

// These limits of one session and of all sessions together keep any from taking the memory of the others.
function capabilities(max_sessions) {
  const limit = OPERATIONS_PER_CALL;
  return {
    maxSessions: max_sessions,
    maxSubscriptionsPerSession: SUBSCRIPTIONS_PER_SESSION,
    maxSubscriptions: SUBSCRIPTIONS_PER_SESSION * max_sessions,
    maxMonitoredItemsPerSubscription: 1000,
    maxMonitoredItems: 1000 * max_sessions,
    maxMonitoredItemsQueueSize: 10_000,
    operationLimits: {maxNodesPerRead: limit, maxNodesPerWrite: limit, maxNodesPerBrowse: limit, maxNodesPerMethodCall: 100,
      maxNodesPerRegisterNodes: limit, maxNodesPerTranslateBrowsePathsToNodeIds: limit, maxMonitoredItemsPerCall: limit},
  };
}

// A gateway that was killed while it made its certificate or key left a part of the file, with which no
// later start would succeed.
function removeTornFiles(pki) {
  for (const name of ['certs/certificate.pem', 'private/private_key.pem']) {
    const file = path.join(pki, 'own', name);
    if (!existsSync(file) || /-----END [A-Z ]+-----\s*$/.test(readFileSync(file, 'latin1'))) continue;
    console.error(`${file}: is incomplete and is made anew`);
    rmSync(file);
  }
}

async function makeServer(configuration, users) {
  for (const folder of ['pki', 'user_pki']) removeTornFiles(path.join(configuration.data, folder));
  const serverCertificateManager = new OPCUACertificateManager({rootFolder: path.join(configuration.data, 'pki'),
    automaticallyAcceptUnknownCertificate: configuration.accept_unknown_certificates});
  const userCertificateManager = new UserCertificates(path.join(configuration.data, 'user_pki'), users);
  await serverCertificateManager.initialize();
  await userCertificateManager.initialize();
  return new OPCUAServer({
    port: configuration.port,
    host: configuration.host,
    alternateHostname: configuration.host ? [configuration.host] : [],
    resourcePath: '/sightline',
    serverInfo: {applicationName: {text: 'Sightline planning service'}, productUri: GATEWAY},
    buildInfo: {productName: 'Sightline OPC UA gateway', manufacturerName: 'Sightline'},
    nodeset_filename: NODESETS.map((name) => nodesets[name]),
    serverCertificateManager, userCertificateManager,
    securityPolicies: [SecurityPolicy.Basic256Sha256],
    securityModes: [MessageSecurityMode.SignAndEncrypt],
    allowAnonymous: false,
    userTokenTypes: [UserTokenType.UserName, UserTokenType.Certificate],
    userManager: {isValidUserAsync: (name, password, callback) =>
      users.isValid(name, password).then((is_valid) => callback(null, is_valid), callback)},
    serverCapabilities: capabilities(configuration.max_sessions),
    // A session has a connection of its own; some more may be asking for one.
    maxConnectionsPerEndpoint: configuration.max_sessions + 10,
  });
}

function makeSystem(configuration, client, address_space, users) {
  const folder = path.join(configuration.data, 'clients', client.name);
  const transfer_folder = path.join(folder, 'transfers');
  rmSync(transfer_folder, {recursive: true, force: true});
  mkdirSync(transfer_folder, {recursive: true, mode: 0o700});
  const system = new VisionSystem(address_space, client.name,
      {service: new ServiceClient(configuration.service, client), ledger: new Ledger(folder), users});
  system.transfers = new FileTransfers(address_space, system.node, transfer_folder, configuration.min_free_bytes);
  bindJobMethods(system);
  bindRecipeMethods(system, system.transfers, path.join(folder, 'recipes'));
  bindResultMethods(system, system.transfers);
  const blocks = addMachinery(system);
  addJobManagement(system, blocks);
  addResultManagement(system, blocks, system.transfers);
  return system;
}

// Starts the gateway. Returns its endpoint's address and a function that ends it in order. Throws an
// Error when the configuration or a ledger is wrong, another gateway has the folder `data`, or the port is taken.
export async function start(file) {
  const configuration = readConfiguration(file);
  mkdirSync(configuration.data, {recursive: true, mode: 0o700});
  const lock = await lockFolder(configuration.data);
  const users = new Users(configuration.clients);
  const server = await makeServer(configuration, users);
  await server.initialize();
  const address_space = server.engine.addressSpace;
  address_space.registerNamespace(GATEWAY);
  const systems = configuration.clients.map((client) => makeSystem(configuration, client, address_space, users));
  server.on('create_session', (session) => session.on('new_subscription', (subscription) =>
    subscription.on('monitoredItem', (item) => systems.forEach((system) => system.guard(session, subscription, item)))));
  server.on('session_closed', (session) => systems.forEach((system) => system.transfers.closeOf(session)));
  await server.start();
  for (const system of systems) system.jobs.run();
  const stop = async () => {
    for (const system of systems) await system.jobs.stop();
    await server.shutdown(200);
    for (const system of systems) {
      system.transfers.closeAll();
      system.service.close();
    }
    lock.close();
  };
  return {url: server.getEndpointUrl(), stop};
}

// Serves until SIGTERM or SIGINT.
export async function run(file) {
  const {url, stop} = await start(file);
  console.log(`listening on ${url}`);
  for (const signal of ['SIGTERM', 'SIGINT']) {
    process.once(signal, () => stop().then(() => process.exit(0), () => process.exit(1)));
  }
}
