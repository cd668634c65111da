// SPDX-License-Identifier: Apache-2.0
// A small stand-in for `sightline serve`, after its HTTP contract: the page can be worked on and
// tested without the service. What it plans is made up.
//
//   node mock_server.mjs FOLDER_OF_THE_PAGE [PORT]
import {createHash, randomBytes} from 'node:crypto';
import {readFile} from 'node:fs/promises';
import {createServer} from 'node:http';
import {fileURLToPath} from 'node:url';

const PAGE = {
  '/': ['index.html', 'text/html; charset=utf-8'],
  '/assets/page.css': ['assets/page.css', 'text/css; charset=utf-8'],
  '/assets/page.js': ['assets/page.js', 'text/javascript; charset=utf-8'],
  '/assets/part_reader.js': ['assets/part_reader.js', 'text/javascript; charset=utf-8'],
  '/assets/icon.svg': ['assets/icon.svg', 'image/svg+xml'],
  '/results_worker.js': ['results_worker.js', 'text/javascript; charset=utf-8'],
};
// No more than the service allows.
const PAGE_POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; " +
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'";
const REPORT_POLICY = "sandbox allow-scripts allow-downloads; default-src 'none'; img-src data: blob:; " +
    "style-src 'unsafe-inline'; script-src 'unsafe-inline'";
const KINDS = ['plan', 'evaluate', 'inspect', 'accept', 'optics', 'render', 'verify', 'diagnose'];
const STEPS = 8;

class Refusal extends Error {
  constructor(status, code, reason, message, fields = []) {
    super(message);
    Object.assign(this, {status, code, reason, fields});
  }
}

const EVENT_OF_STATE = {QUEUED: 'accepted', RUNNING: 'progress', SUCCEEDED: 'done', FAILED: 'failed', CANCELLED: 'cancelled'};

// `stepMs`: time of one step of a job's progress. `token`: wanted of every request if given.
// `settings` can be changed while it runs: `loseAnswers` (how many answers to POST get lost on their
// way), `cutStreams` (break each event stream after two events), `endsWhenRead` (a job ends only when
// a stream has asked for what comes after an event), `token`.
export async function startMockServer({pageFolder, port = 0, stepMs = 60, token = ''}) {
  const jobs = [];
  const byRequest = new Map();
  const settings = {loseAnswers: 0, cutStreams: true, endsWhenRead: false, token};
  const posts = [];
  const eventRequests = [];

  function change(job, changes) {
    Object.assign(job.shown, changes);
    job.shown.revision += 1;
    job.events.push({id: job.events.length + 1, type: EVENT_OF_STATE[job.shown.state], data: JSON.stringify(job.shown)});
    for (const wake of job.waiting.splice(0)) wake();
  }

  function resultsOf(job) {
    const report = `<!DOCTYPE html><html lang="en"><title>Plan</title><style>body{font:16px sans-serif}</style>` +
        `<h1 id="heading">no script</h1><script>document.getElementById('heading').textContent = 'Report of ${job.shown.job_id}';</script></html>`;
    return {
      'plan.json': JSON.stringify({inspection_name: job.task.inspection?.name ?? '', scans: [{index: 1}]}),
      'report.html': report, 'plan.csv': 'scan\n1\n', 'points/scan_01.ply': 'ply\n',
    };
  }

  // A plan of one scan is soon done; all others run until they are cancelled.
  function run(job) {
    const isShort = job.task.inspection?.goal?.max_scans === 1;
    let step = 0;
    const isRead = () => eventRequests.some(({job: id, after}) => id === job.shown.job_id && after > 0);
    job.timer = setInterval(() => {
      if (settings.endsWhenRead && step >= 2 && !isRead()) return;
      step += 1;
      if (job.fails && step > 2) {
        clearInterval(job.timer);
        change(job, {state: 'FAILED', failure: {code: 'INVALID_ARGUMENT', message: `${job.fails}: not a mesh`},
                     finished_at: new Date().toISOString()});
      } else if (isShort && step > STEPS) {
        clearInterval(job.timer);
        job.results = resultsOf(job);
        change(job, {
          state: 'SUCCEEDED', progress: 1,
          finished_at: new Date().toISOString(),
          results: Object.entries(job.results).map(([name, text]) => ({
            name, digest: createHash('sha256').update(text).digest('hex'), size_bytes: Buffer.byteLength(text),
          })),
        });
      } else {
        change(job, {
          state: 'RUNNING', started_at: job.shown.started_at ?? new Date().toISOString(), attempts: 1,
          progress: isShort ? step / (STEPS + 1) : 1 - 1 / (1 + step / 20),
          message: step < 4 ? 'building the visibility field' : `searching scan ${step - 3}`,
        });
      }
    }, stepMs);
  }

  function check(task, files) {
    if (!KINDS.includes(task.kind)) {
      throw invalid('kind', `is "${task.kind}", must be one of ${KINDS.join(', ')}`);
    }
    const {inspection} = task;
    if (inspection?.part?.file && !/\.(glb|gltf)$/i.test(inspection.part.file) && !inspection.part.unit) {
      throw invalid('inspection.part.unit', 'is missing: a .stl file states no unit, must be m, cm, mm, um or inch');
    }
    const step_m = inspection?.rig?.scan_step_m;
    if (step_m !== undefined && !(step_m >= 1e-5 && step_m <= 0.1)) {
      throw invalid('inspection.rig.scan_step_m', `is ${step_m}, must be in [1e-05, 0.1] m`);
    }
    for (const obstacle of inspection?.obstacles ?? []) {
      if (!obstacle.frame) {
        throw invalid('inspection.obstacles[0].frame', 'is missing, must be FRAME_PART, FRAME_STAGE, FRAME_TABLE or FRAME_WORLD');
      }
    }
    if (inspection?.part?.file && !files.has(inspection.part.file)) {
      throw new Refusal(404, 'NOT_FOUND', 'FILE_UNKNOWN', `inspection.part.file is "${inspection.part.file}": no such file came`,
          [{field: 'inspection.part.file', description: `is "${inspection.part.file}": no such file came`}]);
    }
    if (task.plan_job_id && !jobs.some((job) => job.shown.job_id === task.plan_job_id)) {
      throw invalid('plan_job_id', `is "${task.plan_job_id}": there is no such job`);
    }
  }

  function invalid(field, description) {
    return new Refusal(400, 'INVALID_ARGUMENT', 'INVALID_ARGUMENT', `${field} ${description}`, [{field, description}]);
  }

  async function create(request) {
    const chunks = [];
    for await (const chunk of request) chunks.push(chunk);
    const form = await new Response(Buffer.concat(chunks), {headers: {'content-type': request.headers['content-type']}}).formData();
    const task = JSON.parse(form.get('task'));
    const files = new Map();
    for (const value of form.values()) if (typeof value !== 'string') files.set(value.name, value);
    const key = request.headers['idempotency-key'] ?? '';
    posts.push({key, task, files: [...files.keys()]});
    check(task, files);
    const content = JSON.stringify([task, [...files].map(([name, file]) => [name, file.size])]);
    const before = key && byRequest.get(key);
    if (before) {
      if (before.content !== content) {
        throw new Refusal(409, 'ALREADY_EXISTS', 'REQUEST_ID_REUSED', 'the request id was used for something else');
      }
      return before;
    }
    const job = {
      task, content, events: [], waiting: [], results: {},
      shown: {job_id: randomBytes(8).toString('hex'), kind: task.kind, state: 'QUEUED', progress: 0, client: 'local',
              request_id: key, priority: 0, attempts: 0, created_at: new Date().toISOString(), revision: 0},
    };
    const part = files.get(task.inspection?.part?.file);
    if (part && part.size < 84) job.fails = part.name;
    jobs.unshift(job);
    if (key) byRequest.set(key, job);
    change(job, {});
    run(job);
    return job;
  }

  async function stream(request, response, job) {
    let next = Number(request.headers['last-event-id'] ?? 0);
    eventRequests.push({job: job.shown.job_id, after: next});
    if (['SUCCEEDED', 'FAILED', 'CANCELLED'].includes(job.shown.state) && next >= job.events.length) {
      response.writeHead(204).end();
      return;
    }
    const isCut = settings.cutStreams && next === 0;
    response.writeHead(200, {'content-type': 'text/event-stream', 'cache-control': 'no-store'});
    response.write(': here it comes\n\n');
    for (let sent = 0; !response.destroyed;) {
      const event = job.events[next];
      if (!event) {
        await new Promise((resolve) => { job.waiting.push(resolve); });
        continue;
      }
      response.write(`id: ${event.id}\nevent: ${event.type}\ndata: ${event.data}\n\n`);
      next += 1;
      sent += 1;
      if (isCut && sent === 2) {
        // A browser drops what it has not read when the connection breaks; each time it gets longer.
        setTimeout(() => response.destroy(), 100 * eventRequests.length);
        return;
      }
      if (['done', 'failed', 'cancelled'].includes(event.type)) {
        response.end();
        return;
      }
    }
  }

  function answer(response, status, value) {
    response.writeHead(status, {'content-type': 'application/json', 'cache-control': 'no-store'});
    response.end(JSON.stringify(value));
  }

  async function serve(request, response) {
    const url = new URL(request.url, 'http://localhost');
    const path = decodeURIComponent(url.pathname);
    if (PAGE[path] && request.method === 'GET') {
      const [file, type] = PAGE[path];
      response.writeHead(200, {'content-type': type, 'content-security-policy': PAGE_POLICY, 'cache-control': 'no-store'});
      response.end(await readFile(`${pageFolder}/${file}`));
      return;
    }
    if (settings.token && request.headers.authorization !== `Bearer ${settings.token}`) {
      throw new Refusal(401, 'UNAUTHENTICATED', 'CREDENTIALS_UNKNOWN', 'the credentials are not known');
    }
    if (path === '/v1/jobs' && request.method === 'POST') {
      const job = await create(request);
      if (settings.loseAnswers > 0) {
        settings.loseAnswers -= 1;
        response.destroy();
        return;
      }
      answer(response, 201, job.shown);
      return;
    }
    if (path === '/v1/jobs' && request.method === 'GET') {
      const start = Number(url.searchParams.get('page_token') || 0);
      const end = start + Number(url.searchParams.get('page_size') || 100);
      const isWanted = ({shown}) => ['state', 'kind'].every((name) =>
        !url.searchParams.has(name) || url.searchParams.getAll(name).includes(shown[name]));
      const wanted = jobs.filter(isWanted).map(({shown}) => shown);
      answer(response, 200, {jobs: wanted.slice(start, end), next_page_token: end < wanted.length ? String(end) : ''});
      return;
    }
    const [, id, rest = ''] = /^\/v1\/jobs\/([^/]+)(\/.*)?$/.exec(path) ?? [];
    const job = jobs.find(({shown}) => shown.job_id === id);
    if (!job) throw new Refusal(404, 'NOT_FOUND', 'JOB_UNKNOWN', 'there is no such job');
    if (rest === '' && request.method === 'GET') {
      answer(response, 200, job.shown);
    } else if (rest === '' && request.method === 'DELETE') {
      if (['QUEUED', 'RUNNING'].includes(job.shown.state)) {
        clearInterval(job.timer);
        change(job, {state: 'CANCELLED', finished_at: new Date().toISOString()});
      }
      answer(response, 200, job.shown);
    } else if (rest === '/events') {
      await stream(request, response, job);
    } else if (rest.startsWith('/results/') && job.results[rest.slice(9)] !== undefined) {
      const isReport = rest.endsWith('.html');
      response.writeHead(200, {
        'content-type': isReport ? 'text/html; charset=utf-8' : 'application/octet-stream',
        ...(isReport ? {'content-security-policy': REPORT_POLICY} : {}),
      });
      response.end(job.results[rest.slice(9)]);
    } else {
      throw new Refusal(404, 'NOT_FOUND', 'RESULT_UNKNOWN', 'there is no such result');
    }
  }

  const server = createServer((request, response) => {
    serve(request, response).catch((error) => {
      if (response.headersSent) {
        response.destroy();
        return;
      }
      request.resume();
      const {status = 500, code = 'INTERNAL', reason = '', message, fields = []} = error;
      answer(response, status, {error: {code, reason, message, fields}});
    });
  });
  await new Promise((resolve) => { server.listen(port, '127.0.0.1', resolve); });
  return {
    url: `http://127.0.0.1:${server.address().port}/`, settings, posts, eventRequests, jobs,
    async close() {
      for (const job of jobs) clearInterval(job.timer);
      server.closeAllConnections();
      await new Promise((resolve) => { server.close(resolve); });
    },
  };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const server = await startMockServer({pageFolder: process.argv[2], port: Number(process.argv[3] ?? 0), stepMs: 500});
  console.log(server.url);
}
