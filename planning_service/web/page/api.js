// SPDX-License-Identifier: Apache-2.0
// The service's HTTP interface. Addresses are relative, so that the page also works behind a proxy
// that puts the service below a folder.
import {ServiceError, errorOfAnswer} from './field_errors.js';

const TOKEN = 'sightline_token';

// Called when the token is set or forgotten.
const listeners = new Set();
export function onTokenChange(listener) { listeners.add(listener); }

export function token() { return sessionStorage.getItem(TOKEN) ?? ''; }
export function setToken(value) {
  if (value) {
    sessionStorage.setItem(TOKEN, value);
  } else {
    sessionStorage.removeItem(TOKEN);
  }
  for (const listener of listeners) listener();
}

// Set by the page: asks for a token, telling whether one was refused; resolves to whether one was
// given.
let askForToken = async () => false;
export function setTokenQuestion(ask) {
  let asking = null;
  // One question at a time, however many requests are refused.
  askForToken = (wasRefused) => asking ??= ask(wasRefused).finally(() => { asking = null; });
}

function authorization() { return token() ? {Authorization: `Bearer ${token()}`} : {}; }

// Calls `attempt` again after a token was given in answer to a 401.
async function withToken(attempt) {
  for (;;) {
    const used = token();
    try {
      return await attempt();
    } catch (error) {
      if (error.status !== 401) throw error;
      // Another request may have got a new token meanwhile.
      if (token() === used && !await askForToken(used !== '')) throw error;
    }
  }
}

const NO_ANSWER = 'The server does not answer.';

// The answer of a request; throws ServiceError if it is not 2xx.
export function request(path, {method = 'GET', headers = {}, signal} = {}) {
  return withToken(async () => {
    let answer;
    try {
      answer = await fetch(path, {method, headers: {...headers, ...authorization()}, signal, cache: 'no-store'});
    } catch (error) {
      if (signal?.aborted) throw error;
      throw new ServiceError({message: NO_ANSWER});
    }
    if (!answer.ok) throw errorOfAnswer(answer.status, await answer.text());
    return answer;
  });
}

async function json(path, options) {
  const answer = await request(path, options);
  try {
    return await answer.json();
  } catch {
    throw new ServiceError({status: answer.status, message: 'The server’s answer is not the service’s.'});
  }
}

export function jobPath(jobId) { return `v1/jobs/${encodeURIComponent(jobId)}`; }
export function resultPath(jobId, name) {
  return `${jobPath(jobId)}/results/${name.split('/').map(encodeURIComponent).join('/')}`;
}

export function getJob(jobId, signal) { return json(jobPath(jobId), {signal}); }
export function cancelJob(jobId) { return json(jobPath(jobId), {method: 'DELETE'}); }
// {jobs, next_page_token}; `state` and `kind` empty: all.
export function listJobs({pageToken = '', pageSize = 25, state = '', kind = '', allClients = false, signal} = {}) {
  const query = new URLSearchParams({page_size: pageSize});
  if (state) query.set('state', state);
  if (kind) query.set('kind', kind);
  if (allClients) query.set('all_clients', 'true');
  if (pageToken) query.set('page_token', pageToken);
  return json(`v1/jobs?${query}`, {signal});
}

// Answer whose body is the stream of events after `lastId`.
export function openEvents(jobId, lastId, signal) {
  const headers = {Accept: 'text/event-stream'};
  if (lastId) headers['Last-Event-ID'] = lastId;
  return request(`${jobPath(jobId)}/events`, {headers, signal});
}

// 128 random bits; crypto.randomUUID is missing on plain HTTP.
export function newIdempotencyKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, '0')).join('');
}

// Sends a task with files [{name, blob}]; `onProgress(fraction)` of the upload. Resolves to the job.
// Fetch does not report an upload's progress, so this is an XMLHttpRequest.
export function createJob({task, files, key, onProgress, signal}) {
  return withToken(() => new Promise((resolve, reject) => {
    const form = new FormData();
    form.append('task', JSON.stringify(task));
    for (const {name, blob} of files) form.append('file', blob, name);
    const call = new XMLHttpRequest();
    call.open('POST', 'v1/jobs');
    call.setRequestHeader('Idempotency-Key', key);
    for (const [name, value] of Object.entries(authorization())) call.setRequestHeader(name, value);
    call.upload.addEventListener('progress', (event) => {
      if (event.lengthComputable && event.total > 0) onProgress(event.loaded / event.total);
    });
    call.addEventListener('load', () => {
      if (call.status < 200 || call.status > 299) {
        reject(errorOfAnswer(call.status, call.responseText));
        return;
      }
      try {
        const answer = JSON.parse(call.responseText);
        // The job itself, or as gRPC has it: in a field.
        resolve(answer.job_id ? answer : answer.job);
      } catch {
        reject(new ServiceError({status: call.status, message: 'The server’s answer is not the service’s.'}));
      }
    });
    call.addEventListener('error', () => reject(new ServiceError({message: NO_ANSWER})));
    call.addEventListener('abort', () => reject(new ServiceError({code: 'CANCELLED', status: 499, message: 'Stopped.'})));
    signal.addEventListener('abort', () => call.abort(), {once: true});
    call.send(form);
  }));
}
