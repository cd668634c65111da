// SPDX-License-Identifier: Apache-2.0
// The planning service in memory, by gRPC: jobs end when a test says so, and the service can go away
// and come back.
import {createHash} from 'node:crypto';
import {fileURLToPath} from 'node:url';
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';

const PROTO = process.env.SIGHTLINE_PROTO ?? fileURLToPath(new URL('../../../proto', import.meta.url));
const contract = protoLoader.loadSync('sightline/v1/planning_service.proto',
    {includeDirs: [PROTO], keepCase: true, longs: Number, enums: String, defaults: true});
const {PlanningService} = grpc.loadPackageDefinition(contract).sightline.v1;
const digestOf = (bytes) => createHash('sha256').update(bytes).digest('hex');
const refusal = (code, details) => Object.assign(new Error(details), {code, details});

export class FakeService {
  constructor(address) {
    this.address = address;
    this.recipes = new Map();
    this.jobs = new Map();  // by request id
    this.disk_is_full = false;
    this.lose_answers = 0;  // so many StartJob calls do their work and answer UNAVAILABLE
    this.result = Buffer.from('{"scans": []}');
  }

  async start() {
    this.server = new grpc.Server();
    const unary = (action) => (call, callback) => {
      try {
        callback(null, action(call.request));
      } catch (error) {
        callback(error);
      }
    };
    this.server.addService(PlanningService.service, {
      UploadFile: (call, callback) => call.on('data', () => {}).on('end', () => callback(null, {})),
      PrepareRecipe: unary((request) => this.prepare(request)),
      UnprepareRecipe: unary(({recipe_id}) => {
        this.recipes.delete(recipe_id);
        return {};
      }),
      StartJob: unary((request) => this.startJob(request)),
      GetPlanningJob: unary(({job_id}) => ({job: this.find(job_id)})),
      CancelPlanningJob: unary(({job_id}) => ({job: this.end(this.find(job_id), 'CANCELLED')})),
      GetVisionState: unary(() => ({state: this.state()})),
      StreamResult: (call) => {
        call.write({header: {digest: digestOf(this.result), size_bytes: this.result.length}});
        call.write({chunk: this.result});
        call.end();
      },
    });
    await new Promise((resolve, reject) => this.server.bindAsync(this.address, grpc.ServerCredentials.createInsecure(),
        (error) => error ? reject(error) : resolve()));
  }

  stop() {
    this.server.forceShutdown();
  }

  prepare({recipe_id, task}) {
    const digest = digestOf(JSON.stringify(task));
    this.recipes.set(recipe_id, digest);
    return {recipe_id, digest};
  }

  startJob({request_id, recipe_id}) {
    if (!this.jobs.has(request_id)) {
      if (!this.recipes.has(recipe_id)) throw refusal(grpc.status.NOT_FOUND, 'RECIPE_UNKNOWN');
      this.jobs.set(request_id, {job_id: `job-${this.jobs.size + 1}`, request_id, state: 'QUEUED', results: []});
    }
    if (this.lose_answers-- > 0) throw refusal(grpc.status.UNAVAILABLE, 'the answer got lost');
    return {job: this.jobs.get(request_id)};
  }

  find(job_id) {
    const job = [...this.jobs.values()].find((known) => known.job_id === job_id);
    if (!job) throw refusal(grpc.status.NOT_FOUND, 'JOB_UNKNOWN');
    return job;
  }

  end(job, state = 'SUCCEEDED') {
    if (['QUEUED', 'RUNNING'].includes(job.state)) {
      Object.assign(job, {state, finished_at: {seconds: 1, nanos: 0}});
      if (state === 'SUCCEEDED') {
        job.results = [{name: 'plan.json', size_bytes: this.result.length, digest: digestOf(this.result)}];
      }
    }
    return job;
  }

  state() {
    if (this.disk_is_full) return 'ERROR';
    if ([...this.jobs.values()].some((job) => job.state === 'RUNNING')) return 'SINGLE_EXECUTION';
    return this.recipes.size > 0 ? 'READY' : 'INITIALIZED';
  }
}
