// SPDX-License-Identifier: Apache-2.0
import {readFileSync} from 'node:fs';

const TIMEOUT_MS = 20_000;

// Cancels a job of the client by the service's HTTP front end. `service`: {url, token_files}, a file with
// the token of each client. Throws an Error with the service's reason.
export async function cancelJob(service, client, job_id) {
  if (!service) throw new Error('service: is not configured, so commands are not taken');
  const file = service.token_files?.[client];
  const headers = file ? {authorization: `Bearer ${readFileSync(file, 'utf8').trim()}`} : {};
  const answer = await fetch(`${service.url}/v1/jobs/${encodeURIComponent(job_id)}`,
      {method: 'DELETE', headers, signal: AbortSignal.timeout(TIMEOUT_MS)});
  if (!answer.ok) throw new Error(`job ${job_id}: HTTP ${answer.status}: ${(await answer.text()).slice(0, 500)}`);
  console.log(`job ${job_id} is cancelled`);
}
