// SPDX-License-Identifier: Apache-2.0
// Asks a planning service for a plan of examples/cylinder_head, follows it, and saves report.html
// and plan.json.
//
//   node plan_cylinder_head.js ADDRESS [OUT_FOLDER [REQUEST_ID]]
//
// The same REQUEST_ID again gives the same job, so that a program that was ended can go on.
// SIGHTLINE_TOKEN: the client's token. SIGHTLINE_ROOT_CERTIFICATES: PEM file, turns on TLS.
import {createHash, randomUUID} from 'node:crypto';
import {createReadStream} from 'node:fs';
import {mkdir, open, readFile, rename} from 'node:fs/promises';
import path from 'node:path';
import {setTimeout as sleep} from 'node:timers/promises';
import {fileURLToPath} from 'node:url';
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';

const ROOT = path.join(path.dirname(fileURLToPath(import.meta.url)), '..', '..');
const EXAMPLE = path.join(ROOT, 'examples', 'cylinder_head');
const CHUNK_BYTES = 1 << 20;
const CALL_TIMEOUT_MS = 30_000;
const UPLOAD_TIMEOUT_MS = 600_000;
const RETRY_FOR_MS = 60_000;
const FINISHED = ['SUCCEEDED', 'FAILED', 'CANCELLED'];

const contract = protoLoader.loadSync('sightline/v1/planning_service.proto', {
  includeDirs: [path.join(ROOT, 'proto')], keepCase: true, longs: String, enums: String, defaults: true,
});
const {PlanningService} = grpc.loadPackageDefinition(contract).sightline.v1;

const deadline = (ms) => new Date(Date.now() + ms);

function connect(address) {
  const roots = process.env.SIGHTLINE_ROOT_CERTIFICATES;
  return Promise.resolve(roots ? readFile(roots) : null).then((pem) => new PlanningService(
      address, pem ? grpc.credentials.createSsl(pem) : grpc.credentials.createInsecure(),
      {'grpc.max_receive_message_length': 64 << 20, 'grpc.enable_retries': 0}));
}

function metadata() {
  const result = new grpc.Metadata();
  if (process.env.SIGHTLINE_TOKEN) {
    result.set('authorization', `Bearer ${process.env.SIGHTLINE_TOKEN}`);
  }
  return result;
}

// Tries again while the service is away (it restarts), nothing else.
async function retrying(attempt) {
  const end = Date.now() + RETRY_FOR_MS;
  for (let delay_ms = 100;; delay_ms = Math.min(2 * delay_ms, 5000)) {
    try {
      return await attempt();
    } catch (error) {
      if (error.code !== grpc.status.UNAVAILABLE || Date.now() > end) throw error;
    }
    await sleep(delay_ms);
  }
}

function call(client, method, request) {
  return retrying(() => new Promise((resolve, reject) => {
    client[method](request, metadata(), {deadline: deadline(CALL_TIMEOUT_MS)},
        (error, answer) => error ? reject(error) : resolve(answer));
  }));
}

async function describe(file) {
  const hash = createHash('sha256');
  let size_bytes = 0;
  for await (const block of createReadStream(file)) {
    hash.update(block);
    size_bytes += block.length;
  }
  return {digest: hash.digest('hex'), size_bytes};
}

function upload(client, file, header) {
  return retrying(() => new Promise((resolve, reject) => {
    const stream = client.UploadFile(metadata(), {deadline: deadline(UPLOAD_TIMEOUT_MS)},
        (error, answer) => error ? reject(error) : resolve(answer));
    const send = async () => {
      stream.write({header});
      for await (const chunk of createReadStream(file, {highWaterMark: CHUNK_BYTES})) {
        if (!stream.write({chunk})) await new Promise((ready) => stream.once('drain', ready));
      }
      stream.end();
    };
    send().catch((error) => {
      stream.cancel();
      reject(error);
    });
  }));
}

// The digest of a file that the service does not have; undefined if that is not the error.
function unknownDigest(error) {
  const found = /\b[0-9a-f]{64}\b/.exec(error.details ?? '');
  return error.code === grpc.status.NOT_FOUND && found ? found[0] : undefined;
}

// `files`: paths by the names that the task uses.
async function create(client, request, files) {
  const missing = new Map();
  for (const [name, file] of Object.entries(files)) {
    const header = await describe(file);
    request.files.push({name, ...header});
    missing.set(header.digest, {file, header});
  }
  for (;;) {
    try {
      return (await call(client, 'CreatePlanningJob', request)).job;
    } catch (error) {
      const digest = unknownDigest(error);
      if (!missing.has(digest)) throw error;
      const {file, header} = missing.get(digest);
      missing.delete(digest);
      console.log(`uploading ${file}`);
      await upload(client, file, header);
    }
  }
}

// Watches anew when the watch breaks.
async function follow(client, job_id) {
  let job;
  for (;;) {
    try {
      await retrying(async () => {
        const stream = client.WatchPlanningJob({job_id}, metadata(), {deadline: deadline(60_000)});
        for await (const answer of stream) {
          if (job?.revision === answer.job.revision) continue;
          job = answer.job;
          console.log(`${job.state} ${(100 * job.progress).toFixed(0)} % ${job.message}`);
        }
      });
    } catch (error) {
      if (error.code !== grpc.status.DEADLINE_EXCEEDED) throw error;
    }
    if (job && FINISHED.includes(job.state)) return job;
    await sleep(100);
  }
}

async function save(client, job, name, folder) {
  const result = job.results.find((file) => file.name === name);
  if (!result) throw new Error(`the job has no result ${name}`);
  const target = path.join(folder, name);
  const file = await open(`${target}.part`, 'w');
  const hash = createHash('sha256');
  let offset = 0;
  try {
    await retrying(async () => {
      const stream = client.StreamResult({job_id: job.job_id, name, offset}, metadata(),
          {deadline: deadline(UPLOAD_TIMEOUT_MS)});
      for await (const {chunk} of stream) {
        if (!chunk) continue;
        await file.write(chunk);
        hash.update(chunk);
        offset += chunk.length;
      }
    });
  } finally {
    await file.close();
  }
  if (hash.digest('hex') !== result.digest) throw new Error(`${name} arrived damaged`);
  await rename(`${target}.part`, target);
  console.log(`saved ${target}`);
}

async function main([address, folder = 'plan', request_id = randomUUID()]) {
  if (!address) throw new Error('usage: node plan_cylinder_head.js ADDRESS [OUT [REQUEST_ID]]');
  const client = await connect(address);
  const inspection = JSON.parse(await readFile(path.join(EXAMPLE, 'inspection.json'), 'utf8'));
  const part = inspection.part.file;
  let job = await create(client, {request_id, task: {kind: 'plan', inspection}, files: []},
      {[part]: path.join(EXAMPLE, part)});
  console.log(`job ${job.job_id} of request ${request_id}`);
  job = await follow(client, job.job_id);
  if (job.state !== 'SUCCEEDED') {
    throw new Error(`${job.state}: ${job.failure?.reason ?? ''} ${job.failure?.message ?? ''}`);
  }
  await mkdir(folder, {recursive: true});
  for (const name of ['report.html', 'plan.json']) await save(client, job, name, folder);
  client.close();
}

main(process.argv.slice(2)).catch((error) => {
  console.error(error.message);
  process.exit(1);
});
