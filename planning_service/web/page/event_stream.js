// SPDX-License-Identifier: Apache-2.0
// Server-sent events read from a fetch: unlike EventSource it can send a token.

const MAX_EVENT_CHARS = 4 << 20;

// https://html.spec.whatwg.org/multipage/server-sent-events.html, without `retry`.
export class EventStreamParser {
  constructor() {
    this.rest = '';
    this.lastId = '';
    this.reset();
  }

  reset() {
    this.data = [];
    this.type = '';
  }

  // Events that the text completes: [{id, type, data}]. Throws if one grows without end.
  push(text) {
    const events = [];
    this.rest += text;
    // A carriage return at the end may be the first half of a line end.
    const lines = this.rest.split(/\r\n|\n|\r(?!$)/);
    this.rest = lines.pop();
    if (this.rest.length > MAX_EVENT_CHARS) throw new Error('an event of the server is too long');
    for (const line of lines) {
      if (line === '') {
        if (this.data.length) {
          events.push({id: this.lastId, type: this.type || 'message', data: this.data.join('\n')});
        }
        this.reset();
        continue;
      }
      const colon = line.indexOf(':');
      if (colon === 0) continue;
      const name = colon < 0 ? line : line.slice(0, colon);
      const value = colon < 0 ? '' : line.slice(colon + 1).replace(/^ /, '');
      if (name === 'data') this.data.push(value);
      if (name === 'event') this.type = value;
      if (name === 'id' && !value.includes('\0')) this.lastId = value;
    }
    return events;
  }
}

export function isFinished(job) { return ['SUCCEEDED', 'FAILED', 'CANCELLED'].includes(job?.state); }

const SILENCE_S = 60;
const WAITS_S = [0.5, 1, 2, 5, 10];

function wait(seconds, signal) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, 1000 * seconds);
    signal.addEventListener('abort', () => { clearTimeout(timer); resolve(); }, {once: true});
  });
}

// Follows a job until it is finished or `signal` aborts. `open(lastId, signal)` gives the answer of
// the events' address; `onJob(job)` gets every state, `onConnection(error)` the connection's error, and null when it is
// well again. Breaks are mended from the last event on;
// errors that stay (an unknown job) are thrown.
export async function watchJob({open, onJob, onConnection, signal}) {
  let lastId = '';
  let failures = 0;
  while (!signal.aborted) {
    const attempt = new AbortController();
    const stop = () => attempt.abort();
    signal.addEventListener('abort', stop, {once: true});
    let timer = setTimeout(stop, 1000 * SILENCE_S);
    try {
      const answer = await open(lastId, attempt.signal);
      onConnection(null);
      // No content: the job is finished, and all its events were sent before.
      if (answer.status === 204) return;
      const parser = new EventStreamParser();
      parser.lastId = lastId;
      const decoder = new TextDecoder();
      const reader = answer.body.getReader();
      for (;;) {
        const {done, value} = await reader.read();
        if (done) break;
        clearTimeout(timer);
        timer = setTimeout(stop, 1000 * SILENCE_S);
        for (const event of parser.push(decoder.decode(value, {stream: true}))) {
          lastId = event.id;
          failures = 0;
          const job = JSON.parse(event.data);
          onJob(job);
          if (isFinished(job)) {
            attempt.abort();
            return;
          }
        }
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error.status && !error.isTransient) throw error;
      onConnection(error);
    } finally {
      clearTimeout(timer);
      signal.removeEventListener('abort', stop);
    }
    await wait(WAITS_S[Math.min(failures++, WAITS_S.length - 1)], signal);
  }
}
