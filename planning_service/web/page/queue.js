// SPDX-License-Identifier: Apache-2.0
// Tells what a queued job waits for.

// A sentence. The server counts the jobs ahead of all clients and reveals nothing else about them; events
// come without the count.
export function queueText({jobs_ahead: ahead}) {
  if (ahead === undefined) return 'Waiting to start.';
  if (ahead === 0) return 'Waiting to start: next in the queue.';
  return `Waiting: ${ahead} ${ahead === 1 ? 'job' : 'jobs'} ahead.`;
}
