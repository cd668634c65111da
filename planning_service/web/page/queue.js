// SPDX-License-Identifier: Apache-2.0
// What a queued job waits for.

// Whether `other` starts before `job`: higher priority first, then the older one.
function startsBefore(other, job) {
  const priority = (other.priority ?? 0) - (job.priority ?? 0);
  if (priority !== 0) return priority > 0;
  return Date.parse(other.created_at) < Date.parse(job.created_at);
}

const jobs = (count) => `${count} ${count === 1 ? 'job' : 'jobs'}`;

// A sentence. `queued` and `running`: the jobs in these states that the viewer may see, which leaves
// out those of other clients. `more`: there are more of them than were listed.
export function queueText(job, queued, running, more = false) {
  const ahead = queued.filter((other) => other.job_id !== job.job_id && startsBefore(other, job)).length;
  const least = more ? 'at least ' : '';
  const parts = [];
  if (ahead > 0) parts.push(`${least}${jobs(ahead)} ahead of it in the queue`);
  if (running.length > 0) parts.push(`${least}${jobs(running.length)} running`);
  return parts.length > 0 ? `Waiting: ${parts.join(', ')}.` : 'Waiting to start: none of your jobs is ahead of it.';
}
