// SPDX-License-Identifier: Apache-2.0
// Calls of the planning service in the name of one of its clients.
import {createHash} from 'node:crypto';
import {createReadStream, readFileSync} from 'node:fs';
import {open} from 'node:fs/promises';
import path from 'node:path';
import {fileURLToPath} from 'node:url';
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import {checkTask} from './strict_task.js';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const PROTO = process.env.SIGHTLINE_PROTO ?? path.join(HERE, '..', '..', '..', '..', 'proto');
const CALL_TIMEOUT_MS = 20_000;
const TRANSFER_TIMEOUT_MS = 600_000;
const CHUNK_BYTES = 1 << 20;

export async function describeFile(file) {
  const hash = createHash('sha256');
  let size_bytes = 0;
  for await (const block of createReadStream(file)) {
    hash.update(block);
    size_bytes += block.length;
  }
  return {digest: hash.digest('hex'), size_bytes};
}

export class ServiceClient {
  // `service`: {address, root_certificates}; `client`: {token_file, certificate, key}; PEM files.
  constructor(service, client) {
    const contract = protoLoader.loadSync('sightline/v1/planning_service.proto',
        {includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, defaults: true});
    this.contract = contract;
    const {PlanningService} = grpc.loadPackageDefinition(contract).sightline.v1;
    const read = (file) => file ? readFileSync(file) : null;
    const credentials = service.root_certificates ?
        grpc.credentials.createSsl(read(service.root_certificates), read(client.key), read(client.certificate)) :
        grpc.credentials.createInsecure();
    this.name = client.name;
    this.address = service.address;
    this.token_file = client.token_file;
    this.stub = new PlanningService(service.address, credentials, {
      'grpc.max_receive_message_length': 64 << 20,
      'grpc.initial_reconnect_backoff_ms': 100,
      'grpc.max_reconnect_backoff_ms': 2000,
    });
  }

  // Read for every call, so that a token can be replaced while the gateway runs.
  metadata() {
    const result = new grpc.Metadata();
    if (this.token_file) {
      result.set('authorization', `Bearer ${readFileSync(this.token_file, 'utf8').trim()}`);
    }
    return result;
  }

  call(method, request) {
    return new Promise((resolve, reject) => {
      this.stub[method](request, this.metadata(), {deadline: new Date(Date.now() + CALL_TIMEOUT_MS)},
          (error, answer) => error ? reject(error) : resolve(answer));
    });
  }

  upload(file, header) {
    return new Promise((resolve, reject) => {
      const stream = this.stub.UploadFile(this.metadata(),
          {deadline: new Date(Date.now() + TRANSFER_TIMEOUT_MS)},
          (error, answer) => error ? reject(error) : resolve(answer));
      const send = async () => {
        stream.write({header});
        for await (const chunk of createReadStream(file, {highWaterMark: CHUNK_BYTES})) {
          if (!stream.write({chunk})) await new Promise((ready) => stream.once('drain', ready));
        }
        stream.end();
      };
      stream.on('error', () => {});  // the callback has it
      send().catch((error) => {
        stream.cancel();
        reject(error);
      });
    });
  }

  // Prepares a recipe and uploads those of its files that the service does not have. `files`: paths
  // by the names that the task uses.
  // Throws an Error with code INVALID_ARGUMENT where the task has a field or a value that the contract
  // does not have.
  async prepareRecipe(recipe_id, task, files) {
    try {
      checkTask(this.contract, task);
    } catch (error) {
      throw Object.assign(error, {code: grpc.status.INVALID_ARGUMENT});
    }
    const request = {recipe_id, task, files: []};
    const missing = new Map();
    for (const [name, file] of Object.entries(files)) {
      const header = await describeFile(file);
      request.files.push({name, ...header});
      missing.set(header.digest, {file, header});
    }
    for (;;) {
      try {
        return await this.call('PrepareRecipe', request);
      } catch (error) {
        const digest = /\b[0-9a-f]{64}\b/.exec(error.details ?? '')?.[0];
        if (error.code !== grpc.status.NOT_FOUND || !missing.has(digest)) throw error;
        const {file, header} = missing.get(digest);
        missing.delete(digest);
        await this.upload(file, header);
      }
    }
  }

  // Saves a result and compares its digest.
  async fetchResult(job_id, name, target) {
    const stream = this.stub.StreamResult({job_id, name}, this.metadata(),
        {deadline: new Date(Date.now() + TRANSFER_TIMEOUT_MS)});
    const file = await open(target, 'w');
    const hash = createHash('sha256');
    let digest = '';
    try {
      for await (const {header, chunk} of stream) {
        if (header) digest = header.digest;
        if (!chunk) continue;
        await file.write(chunk);
        hash.update(chunk);
      }
    } finally {
      await file.close();
    }
    if (digest && hash.digest('hex') !== digest) throw new Error(`${name} arrived damaged`);
  }

  // The state that the state machine follows; a service that does not answer is preoperational.
  async visionState() {
    try {
      const {state} = await this.call('GetVisionState', {});
      this.report('');
      return state;
    } catch (error) {
      this.report(error.details || error.message);
      return 'PREOPERATIONAL';
    }
  }

  // The log has a reason once, as long as it stays the same.
  report(reason) {
    if (reason && reason !== this.reason) console.error(`${this.name}: the service ${this.address} does not answer: ${reason}`);
    if (!reason && this.reason) console.error(`${this.name}: the service ${this.address} answers again`);
    this.reason = reason;
  }

  close() {
    this.stub.close();
  }
}
