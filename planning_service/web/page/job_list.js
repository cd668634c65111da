// SPDX-License-Identifier: Apache-2.0
// All jobs, newest first, page by page.
import {listJobs} from './api.js';
import {h, kindTitle, STATES, stateBadge, timeText} from './dom.js';
import {isFinished} from './event_stream.js';
import {queueText} from './queue.js';
import {KINDS} from './task_model.js';

const REFRESH_S = 4;

function waitsOrDoes(job) {
  if (isFinished(job)) return '';
  return job.state === 'QUEUED' ? queueText(job) : job.message ?? '';
}

export class JobListView {
  constructor() {
    this.heading = h('h1', {tabindex: '-1'}, 'Jobs');
    this.error = h('p', {class: 'error', role: 'alert'});
    this.body = h('tbody');
    this.empty = h('p', {class: 'soft', hidden: true}, 'No such jobs. ', h('a', {href: '#/new'}, 'Submit one.'));
    this.table = h('div', {class: 'table-wrap', hidden: true}, h('table', {class: 'jobs'},
        h('caption', {class: 'visually-hidden'}, 'Jobs, newest first'),
        h('thead', {}, h('tr', {}, ['Job', 'State', 'Progress', 'Message', 'Client', 'Accepted'].map((title) =>
          h('th', {scope: 'col', class: title.toLowerCase()}, title)))), this.body));
    this.newer = h('button', {type: 'button', onclick: () => this.turn(-1)}, '← Newer');
    this.older = h('button', {type: 'button', onclick: () => this.turn(1)}, 'Older →');
    this.pageText = h('span', {class: 'soft', 'aria-live': 'polite'});
    this.pager = h('nav', {class: 'pager', 'aria-label': 'Pages', hidden: true}, this.newer, this.pageText, this.older);
    const filter = (label, choices) => {
      const select = h('select', {onchange: () => this.restart()},
          h('option', {value: ''}, 'all'), choices.map(([value, text]) => h('option', {value}, text)));
      return [select, h('label', {}, label, ' ', select)];
    };
    const [state, stateLabel] = filter('State', Object.entries(STATES).map(([value, [word]]) => [value, word]));
    const [kind, kindLabel] = filter('Kind', Object.keys(KINDS).map((name) => [name, name]));
    this.allClients = h('input', {type: 'checkbox', onchange: () => this.restart()});
    Object.assign(this, {state, kind});
    const filters = h('p', {class: 'filters'}, stateLabel, kindLabel,
        h('label', {}, this.allClients, ' of all clients (for operators)'));
    this.element = h('div', {}, this.heading, filters, this.error, this.empty, this.table, this.pager);
    document.addEventListener('visibilitychange', () => { if (!document.hidden && this.stop) this.load(); });
  }

  show() {
    this.tokens = [''];
    this.stop = new AbortController();
    this.load();
  }

  hide() {
    this.stop?.abort();
    this.stop = null;
    clearTimeout(this.timer);
  }

  restart() {
    this.tokens = [''];
    this.load();
  }

  turn(step) {
    if (step > 0) {
      this.tokens.push(this.next);
    } else {
      this.tokens.pop();
    }
    this.load();
  }

  async load() {
    clearTimeout(this.timer);
    const {signal} = this.stop;
    const request = this.requests = (this.requests ?? 0) + 1;
    this.newer.disabled = this.tokens.length === 1;
    this.older.disabled = true;
    try {
      const {jobs = [], next_page_token: next = ''} = await listJobs({
        pageToken: this.tokens.at(-1), state: this.state.value, kind: this.kind.value,
        allClients: this.allClients.checked, signal,
      });
      if (signal.aborted || request !== this.requests) return;
      this.next = next;
      this.error.textContent = '';
      this.draw(jobs);
    } catch (error) {
      if (signal.aborted || request !== this.requests) return;
      this.error.textContent = error.message;
      if (error.status === 401) return;
    }
    if (!document.hidden) this.timer = setTimeout(() => this.load(), 1000 * REFRESH_S);
  }

  draw(jobs) {
    const focused = this.body.contains(document.activeElement) ? document.activeElement.getAttribute('href') : null;
    this.body.replaceChildren(...jobs.map((job) => {
      const percent = Math.round(100 * (job.progress ?? 0));
      return h('tr', {},
          h('th', {scope: 'row', class: 'job'}, h('a', {href: `#/jobs/${encodeURIComponent(job.job_id)}`},
              kindTitle(job.kind), ' ', h('code', {}, job.job_id))),
          h('td', {class: 'state-cell'}, stateBadge(job.state)),
          h('td', {class: 'progress'}, job.state === 'RUNNING' ?
              [h('progress', {max: 100, value: percent, 'aria-label': `${percent} %`}), h('span', {}, `${percent} %`)] : ''),
          h('td', {class: 'message-cell'}, job.failure?.message || waitsOrDoes(job)),
          h('td', {class: 'client'}, job.client ?? ''),
          h('td', {class: 'accepted'}, timeText(job.created_at)));
    }));
    if (focused) this.body.querySelector(`a[href="${CSS.escape(focused)}"]`)?.focus();
    this.table.hidden = jobs.length === 0;
    this.empty.hidden = jobs.length > 0;
    this.older.disabled = !this.next;
    this.pager.hidden = !this.next && this.tokens.length === 1;
    this.pageText.textContent = `Page ${this.tokens.length}`;
  }
}
