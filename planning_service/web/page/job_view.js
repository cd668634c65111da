// SPDX-License-Identifier: Apache-2.0
// One job: state, progress, results.
import {cancelJob, getJob, openEvents, resultPath, token} from './api.js';
import {confirmDialog, h, kindTitle, stateBadge, timeText} from './dom.js';
import {isFinished, watchJob} from './event_stream.js';
import {queueText} from './queue.js';
import {download, openReport} from './results.js';
import {bytesText} from './units.js';

const REPORT = 'report.html';
const QUEUE_REFRESH_S = 5;
// Kinds that go on from a plan.
const ON_A_PLAN = {optics: 'Choose optics for it', render: 'Render its images', evaluate: 'Evaluate it'};

export class JobView {
  constructor() {
    this.heading = h('h1', {tabindex: '-1'}, 'Job');
    this.error = h('p', {class: 'error', role: 'alert'});
    this.connection = h('p', {class: 'notice', role: 'status', hidden: true},
        'The connection to the server is lost. Trying again …');
    this.state = h('p', {class: 'job-state', 'aria-live': 'polite'});
    this.bar = h('progress', {max: 100, value: 0, 'aria-label': 'Progress'});
    this.percent = h('span', {class: 'percent'});
    this.barRow = h('div', {class: 'bar-row'}, this.bar, this.percent);
    this.message = h('p', {class: 'message'});
    this.failure = h('div', {class: 'failure', hidden: true});
    this.actions = h('p', {class: 'buttons'});
    this.facts = h('dl', {class: 'job-facts'});
    this.results = h('section', {'aria-labelledby': 'title-results', hidden: true});
    this.body = h('div', {hidden: true}, h('div', {class: 'card job-card'}, this.state, this.barRow, this.message, this.failure,
        this.actions), this.facts, this.results);
    this.element = h('div', {class: 'job-view'},
        h('p', {class: 'back'}, h('a', {href: '#/jobs'}, '← All jobs')),
        this.heading, this.error, this.connection, this.body);
  }

  show({id}) {
    this.id = id;
    this.job = null;
    this.drawn = '';
    this.body.hidden = true;
    this.error.textContent = '';
    this.heading.replaceChildren('Job ', h('code', {}, id));
    this.stop = new AbortController();
    this.follow(this.stop.signal);
  }

  hide() {
    this.stop?.abort();
    clearTimeout(this.queueTimer);
    this.queueTimer = null;
    this.showConnection(null);
    this.stop = null;
  }

  async follow(signal) {
    try {
      this.take(await getJob(this.id, signal), signal);
      if (isFinished(this.job)) return;
      await watchJob({
        open: (lastId, inner) => openEvents(this.id, lastId, inner),
        onJob: (job) => this.takeEvent(job, signal),
        onConnection: (error) => this.showConnection(error, signal),
        signal,
      });
      // With times and results.
      if (!signal.aborted) this.take(await getJob(this.id, signal), signal);
    } catch (error) {
      if (signal.aborted) return;
      this.error.textContent = error.reason === 'JOB_UNKNOWN' || error.status === 404 ?
          'There is no such job. It may have been removed after its time.' : error.message;
      if (error.isTransient) {
        // The first answer did not come; the stream mends itself later.
        setTimeout(() => {
          if (signal.aborted) return;
          this.error.textContent = '';
          this.follow(signal);
        }, 3000);
      }
    }
  }

  // An event lacks the time of the start, so the job is fetched.
  takeEvent(job, signal) {
    const isNew = job.state !== this.job?.state && !isFinished(job);
    this.take(job, signal);
    if (isNew) getJob(this.id, signal).then((whole) => this.take(whole, signal), () => {});
  }

  // A break that is mended at once is not worth a word.
  showConnection(error, signal) {
    if (error) {
      this.connectionTimer ??= setTimeout(() => { this.connection.hidden = signal.aborted; }, 2500);
    } else {
      clearTimeout(this.connectionTimer);
      this.connectionTimer = null;
      this.connection.hidden = true;
    }
  }

  take(job, signal) {
    if (signal.aborted) return;
    // Events repeated after a break are older than the shown state.
    if (this.job && Number(job.revision) < Number(this.job.revision)) return;
    this.job = {...this.job, ...job};
    this.draw();
    if (this.job.state === 'QUEUED') this.queueTimer ??= setTimeout(() => this.askAgain(signal), 1000 * QUEUE_REFRESH_S);
  }

  // The number of jobs ahead changes without an event of this job.
  async askAgain(signal) {
    const job = await getJob(this.id, signal).catch(() => this.job);
    if (signal.aborted) return;
    this.queueTimer = null;
    this.take(job, signal);
  }

  draw() {
    const {job} = this;
    this.body.hidden = false;
    this.error.textContent = '';
    const percent = Math.round(100 * (job.progress ?? 0));
    // Only a new state is announced, not every step.
    if (this.state.dataset.state !== job.state || this.drawn === '') {
      this.state.dataset.state = job.state;
      this.state.replaceChildren(stateBadge(job.state));
    }
    const isQueued = job.state === 'QUEUED';
    const message = isQueued ? queueText(job) : job.message;
    document.title = `${isFinished(job) ? '' : isQueued ? 'Queued · ' : `${percent} % · `}${kindTitle(job.kind)} · Sightline`;
    this.heading.replaceChildren(`${kindTitle(job.kind)} `, h('code', {}, job.job_id));
    // A percentage would say that it has begun.
    this.barRow.hidden = isFinished(job) || isQueued;
    this.bar.value = percent;
    this.percent.textContent = `${percent} %`;
    this.message.textContent = message ?? '';
    // The last progress message of a finished job is of no interest.
    this.message.hidden = !message || isFinished(job);
    const failure = job.state === 'FAILED' ? job.failure ?? {} : null;
    this.failure.hidden = !failure;
    if (failure) {
      this.failure.replaceChildren(h('p', {class: 'error'}, failure.message || job.message || 'It failed.'),
          h('p', {class: 'soft'}, [failure.code, failure.reason].filter(Boolean).join(' · ')));
    }
    const facts = [['Client', job.client], ['Request', job.request_id], ['Accepted', timeText(job.created_at)],
                   ['Started', timeText(job.started_at)], ['Finished', timeText(job.finished_at)],
                   ['Attempts', job.attempts > 1 ? job.attempts : ''], ['Priority', job.priority || '']];
    this.facts.replaceChildren(...facts.filter(([, value]) => value).map(([name, value]) =>
      h('div', {}, h('dt', {}, name), h('dd', {}, String(value)))));
    // Buttons and links keep the focus while the numbers move.
    const drawn = JSON.stringify([job.state, job.results ?? []]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.drawActions(job);
    this.drawResults(job);
  }

  drawActions(job) {
    const hadFocus = this.actions.contains(document.activeElement);
    const buttons = [];
    if (!isFinished(job)) {
      buttons.push(h('button', {type: 'button', class: 'danger', onclick: () => this.cancel()}, 'Cancel job …'));
    }
    if ((job.results ?? []).some(({name}) => name === REPORT)) {
      const path = resultPath(job.job_id, REPORT);
      buttons.push(h('a', {class: 'button primary', href: path, target: '_blank', rel: 'noopener', onclick: (event) => {
        // A link cannot carry a token.
        if (!token()) return;
        event.preventDefault();
        openReport(path).catch((error) => { this.error.textContent = error.message; });
      }}, 'Open the report'));
    }
    if (job.kind === 'plan' && job.state === 'SUCCEEDED') {
      for (const [kind, text] of Object.entries(ON_A_PLAN)) {
        buttons.push(h('a', {class: 'button', href: `#/new?kind=${kind}&plan=${encodeURIComponent(job.job_id)}`}, text));
      }
    }
    this.actions.replaceChildren(...buttons);
    this.actions.hidden = buttons.length === 0;
    if (hadFocus) (buttons[0] ?? this.heading).focus();
  }

  drawResults(job) {
    const isReport = ({name}) => name === REPORT;
    const files = [...(job.results ?? []).filter(isReport), ...(job.results ?? []).filter((file) => !isReport(file))];
    this.results.hidden = files.length === 0;
    this.results.replaceChildren(h('h2', {id: 'title-results'}, 'Results'),
        h('div', {class: 'table-wrap results', tabindex: files.length > 20 ? '0' : null, role: 'group', 'aria-labelledby': 'title-results'},
            h('table', {}, h('thead', {}, h('tr', {},
                h('th', {scope: 'col'}, 'File'), h('th', {scope: 'col', class: 'number'}, 'Size'),
                h('th', {scope: 'col'}, 'SHA-256'))),
            h('tbody', {}, files.map(({name, size_bytes: size, digest = ''}) => h('tr', {},
                h('th', {scope: 'row'}, h('a', {
                  href: resultPath(job.job_id, name), download: name.split('/').at(-1),
                  onclick: (event) => {
                    if (!token()) return;
                    event.preventDefault();
                    download(resultPath(job.job_id, name), name).catch((error) => { this.error.textContent = error.message; });
                  },
                }, name)),
                h('td', {class: 'number'}, bytesText(size ?? 0)),
                h('td', {}, digest ? h('code', {title: digest}, `${digest.slice(0, 12)}…`) : '')))))));
  }

  async cancel() {
    const isSure = await confirmDialog({
      title: 'Cancel this job?', text: 'It stops and gives no results. It cannot be taken up again.',
      action: 'Cancel job', keep: 'Keep it',
    });
    if (!isSure) return;
    try {
      const answer = await cancelJob(this.id);
      if (this.stop && answer.state) this.take(answer.job ?? answer, this.stop.signal);
    } catch (error) {
      this.error.textContent = error.message;
    }
  }
}
