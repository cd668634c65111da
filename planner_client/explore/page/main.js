// SPDX-License-Identifier: Apache-2.0
// The explorer's page: sliders to the server, its numbers, picture and plan to the screen.
import {get, post} from './api.js';
import {Controls} from './controls.js';
import {Legend, PartView} from './part_view.js';
import {PlanList} from './plan_list.js';
import {tidy} from './parameter.js';

const $ = (id) => document.getElementById(id);
const percent = (fraction, digits = 1) => `${(100 * fraction).toFixed(digits)} %`;
const cssPercent = (fraction) => `${(100 * fraction).toFixed(3)}%`;

// Time without a move after which the exact numbers are asked for, though the slider is still held.
const REST_MS = 180;
// Time between two looks at how far a search is.
const PROGRESS_MS = 250;

class Explorer {
  async start() {
    this.setup = await get('api/setup');
    document.title = `${this.setup.name || this.setup.part} · Sightline explorer`;
    $('name').textContent = this.setup.name || this.setup.part;
    this.controls = new Controls(this.setup, $('parameters'), $('settings'), (released) => this.moved(released));
    $('settings-note').textContent = this.settingsNote();
    this.legend = new Legend($('legend'));
    this.list = new PlanList($('scans'), $('no-scans'), (action, index, to) => this.change({action, index, ...(to === null ? {} : {to})}));
    this.loaded = null;  // index of the plan's scan that is in the sliders to be replaced
    this.asked = 0;      // number of the latest question; answers to earlier ones are dropped
    this.connect();
    this.showState(await get('api/state'));
    for (const element of document.querySelectorAll('.uncertainty')) element.hidden = !this.setup.for_uncertainty;
    this.controls.show(this.state.position);
    await this.openView();
    this.moved(true);
  }

  settingsNote() {
    if (this.setup.settings.length === 0) return 'The inspection has no lens.';
    return this.setup.blur_limited ?
      'They change the picture. The gain is that of the inspection’s own f-number and focus.' :
      'They change the picture, and are saved with the scan. The gain does not depend on them.';
  }

  async openView() {
    try {
      this.view = this.legend.view = new PartView($('canvas'), $('frame'), await get('api/scene'));
    } catch (error) {
      console.warn(error);
      this.view = null;
      $('no-webgl').hidden = false;
    }
  }

  connect() {
    for (const button of document.querySelectorAll('[data-view]')) {
      button.addEventListener('click', () => this.view?.view(button.dataset.view));
    }
    $('stage').addEventListener('input', () => {
      this.view?.setStage(this.stage);
      this.showStage();
    });
    $('stage').addEventListener('change', () => this.draw());
    $('add').addEventListener('click', () => this.change({action: 'add', ...this.controls.read()}));
    $('replace').addEventListener('click', () => this.change({action: 'replace', index: this.loaded, ...this.controls.read()}));
    $('release').addEventListener('click', () => {
      this.loaded = null;
      this.showState(this.state);
      this.moved(true);
    });
    $('save').addEventListener('click', () => this.save(false));
    $('suggest-here').addEventListener('click', () => this.suggest('here'));
    $('suggest-anywhere').addEventListener('click', () => this.suggest('anywhere'));
    $('suggest-cancel').addEventListener('click', () => this.attempt(() => post('api/suggestion/cancel')));
    $('picture-draw').addEventListener('click', () => this.draw(true));
    $('picture-auto').addEventListener('change', () => this.draw());
  }

  get stage() {
    return Number($('stage').value) / 1000;
  }

  /** Runs requests to the server and shows their errors. */
  async attempt(action) {
    try {
      const result = await action();
      this.trouble('');
      return result;
    } catch (error) {
      this.trouble(error.message);
      if (error.reason === 'STATE_CHANGED') this.showState(await get('api/state'));
      return null;
    }
  }

  trouble(text) {
    $('trouble').textContent = text;
    $('trouble').hidden = text === '';
  }

  // ---- the scan in the sliders

  /** A control has changed. While a slider moves estimates come; exact numbers once it rests. */
  moved(released) {
    this.movedAt = performance.now();
    clearTimeout(this.rest);
    if (!this.controls.read()) return this.showUnknown();
    if (released && !this.evaluating) return this.ask(true);
    this.rest = setTimeout(() => this.ask(true), REST_MS);
    // One estimate under way at a time; the next is of the newest position.
    if (this.estimating) this.estimateAgain = true;
    else this.ask(false);
  }

  async ask(exact) {
    if (exact) clearTimeout(this.rest);
    // One exact evaluation under way at a time: more would only hold up each other, and the last.
    if (exact && this.evaluating) {
      this.evaluateAgain = true;
      return;
    }
    const position = this.controls.read();
    if (!position) return;
    const number = ++this.asked;
    const movedAt = this.movedAt;
    this[exact ? 'evaluating' : 'estimating'] = true;
    const answer = await this.attempt(() => post('api/scan', {...position, exact, ...this.insteadOf()}));
    if (exact) {
      this.evaluating = false;
      if (this.evaluateAgain) {
        this.evaluateAgain = false;
        return this.ask(true);
      }
    }
    if (!exact) {
      this.estimating = false;
      if (this.estimateAgain) {
        this.estimateAgain = false;
        if (number === this.asked) {
          if (answer) this.showEvaluation(answer, movedAt);
          return this.ask(false);
        }
      }
    }
    if (!answer || number !== this.asked) return;
    this.showEvaluation(answer, movedAt);
    if (!exact) return;
    this.judge(position);
    this.draw();
  }

  /** For an uncertainty goal: what the plan makes known admissibly, without and with this scan. */
  async judge(position) {
    if (!this.setup.for_uncertainty) return;
    const number = this.judging = (this.judging ?? 0) + 1;
    const answer = await this.attempt(() => post('api/admissible', {measurement: position.measurement, ...this.insteadOf()}));
    if (!answer || answer.cancelled || number !== this.judging) return;
    const share = (settled) => percent(settled / Math.max(1, answer.judged));
    $('admissible').textContent = `${share(answer.before)} → ${share(answer.with)} of ${answer.judged} judged targets`;
    $('admissible').dataset.kind = 'exact';
  }

  insteadOf() {
    return this.loaded === null ? {} : {instead_of: this.loaded};
  }

  showUnknown() {
    ++this.asked;
    this.evaluation = null;
    $('gain').dataset.kind = 'none';
    $('gain-kind').textContent = 'not known';
    $('gain-new').textContent = '–';
    $('verdict').textContent = 'A field holds a value that is not allowed.';
    $('verdict').className = 'verdict wrong';
    $('add').disabled = $('replace').disabled = true;
  }

  showEvaluation(e, movedAt) {
    this.evaluation = e;
    const took = performance.now() - movedAt;
    const box = $('gain');
    box.dataset.kind = e.exact ? 'exact' : 'estimate';
    this.judging = (this.judging ?? 0) + 1;
    $('admissible').textContent = '…';
    $('admissible').dataset.kind = 'none';
    box.dataset.milliseconds = took.toFixed(0);
    $('gain-kind').textContent = e.exact ? `exact, ${(took / 1000).toFixed(2)} s` : 'estimate';
    $('gain-new').textContent = `+${e.new_targets}`;
    $('gain-unit').textContent = `new targets (${percent(e.gain)})`;
    const feasible = e.feasibility === 'feasible';
    $('verdict').textContent = feasible ? 'This scan can be made.' : `Cannot be made – ${e.obstacle}.`;
    $('verdict').className = `verdict ${feasible ? 'right' : 'wrong'}`;
    $('gain-covered').textContent = `${e.covered} of ${this.setup.measurable}`;
    $('gain-with').textContent = `${percent(e.coverage_before)} → ${percent(e.coverage_with)}`;
    $('gain-frames').textContent = e.frames ? `${e.frames}, ${tidy(1e3 * (e.view.stage_end_m - e.view.stage_start_m))} mm of travel` : '–';
    $('coverage-gain').style.left = cssPercent(e.coverage_before);
    $('coverage-gain').style.width = cssPercent(e.gain);
    $('add').disabled = $('replace').disabled = !feasible && e.exact;
    this.legend.show(e.new_targets, e.plan_covered, this.setup.measurable, this.setup.targets);
    this.view?.show(e);
    this.showStage();
  }

  showStage() {
    const view = this.evaluation?.view;
    if (!view) return;
    const at = view.stage_start_m + this.stage * (view.stage_end_m - view.stage_start_m);
    $('stage-output').textContent = `${(1e3 * at).toFixed(0)} mm`;
  }

  // ---- the picture

  /** asked: by the button; otherwise only if the picture follows. */
  async draw(asked = false) {
    const e = this.evaluation;
    if (!this.setup.pictures) {
      $('picture-note').textContent = `No picture: ${this.setup.no_pictures}`;
      $('picture-box').dataset.state = 'missing';
      $('picture-draw').disabled = $('picture-auto').disabled = true;
      return;
    }
    if (!asked && !$('picture-auto').checked) return;
    const position = this.controls.read();
    if (!e || !position) return;
    const number = this.drawing = (this.drawing ?? 0) + 1;
    const started = performance.now();
    $('picture-box').dataset.state = 'drawing';
    $('picture-wait').hidden = false;
    const request = {...position};
    if (e.frames > 1) request.frame = Math.round(this.stage * (e.frames - 1));
    const picture = await this.attempt(() => post('api/picture', request));
    if (number !== this.drawing) return;
    $('picture-wait').hidden = true;
    if (!picture || picture.cancelled) {
      $('picture-box').dataset.state = 'none';
      return;
    }
    const took = (performance.now() - started) / 1000;
    const image = $('picture');
    image.src = `data:image/png;base64,${picture.png}`;
    image.alt = `Draft of frame ${picture.frame + 1} of ${picture.frames}`;
    image.hidden = false;
    $('picture-box').dataset.state = 'drawn';
    $('picture-box').dataset.milliseconds = (1000 * took).toFixed(0);
    $('picture-kind').textContent = `draft, ${took.toFixed(1)} s`;
    const joined = picture.reduction > 1 ? `${picture.reduction} × ${picture.reduction} pixels joined to one, ` : '';
    $('picture-note').textContent = `Frame ${picture.frame + 1} of ${picture.frames}. Draft: ${joined}no speckle, one reflection. ` +
      `${percent(picture.clipped_fraction, 2)} of it is clipped.` +
      picture.warnings.map((warning) => ` ${warning}.`).join('');
  }

  // ---- the plan

  async change(request) {
    if ((request.action === 'add' || request.action === 'replace') && !request.measurement) return;
    const state = await this.attempt(() => post('api/plan', {revision: this.state.revision, ...request}));
    if (!state) return;
    if (request.action === 'load') this.loaded = request.index;
    else if (request.action !== 'move') this.loaded = null;
    else if (this.loaded === request.index) this.loaded = request.to;
    else if (this.loaded === request.to) this.loaded = request.index;
    this.showState(state);
    if (request.action === 'load') this.controls.show(state.position);
    this.moved(true);
  }

  showState(state) {
    this.state = state;
    if (this.loaded !== null && this.loaded >= state.scans.length) this.loaded = null;
    const {measurable, goal} = this.setup;
    $('coverage').textContent = percent(state.coverage);
    $('coverage-detail').textContent = `${state.covered} of ${measurable} measurable targets, ${state.scans.length} ${state.scans.length === 1 ? 'scan' : 'scans'}` +
      (this.setup.for_uncertainty ? '' : `; goal ${percent(goal, 0)}`);
    $('coverage-bar').style.width = cssPercent(state.coverage);
    $('coverage-goal').style.left = cssPercent(goal);
    $('coverage-goal').hidden = this.setup.for_uncertainty;
    this.list.show(state.scans, measurable, this.loaded);
    $('replace').hidden = $('release').hidden = this.loaded === null;
    if (this.loaded !== null) $('replace').textContent = `Replace scan ${this.loaded + 1}`;
    $('gain-heading').firstChild.textContent = this.loaded === null ? 'Gain of this scan ' : `Gain in place of scan ${this.loaded + 1} `;
    $('save').disabled = state.scans.length === 0;
    if (state.unsaved) $('saved').textContent = 'not saved yet';
  }

  async save(overwrite) {
    $('saved').textContent = 'saving …';
    try {
      const saved = await post('api/save', {overwrite});
      this.trouble('');
      this.showState(saved.state);
      $('saved').textContent = `saved: ${saved.files[0]}`;
      $('saved').title = saved.files.join('\n');
    } catch (error) {
      $('saved').textContent = 'not saved';
      if (error.reason === 'PLAN_EXISTS') return this.askToOverwrite();
      this.trouble(error.message);
    }
  }

  askToOverwrite() {
    const dialog = $('overwrite');
    $('overwrite-text').textContent = `${this.setup.folder} holds a plan.json already. Overwriting it loses that plan.`;
    dialog.returnValue = '';
    dialog.onclose = () => {
      if (dialog.returnValue === 'yes') this.save(true);
    };
    dialog.showModal();
    $('overwrite-no').focus();
  }

  async suggest(from) {
    const position = this.controls.read();
    if (!position) return;
    const number = this.search = (this.search ?? 0) + 1;
    const note = $('suggest-note');
    $('suggest-cancel').hidden = false;
    note.textContent = 'searching …';
    const watch = setInterval(async () => {
      const progress = await get('api/suggestion').catch(() => null);
      if (progress?.running && number === this.search) {
        note.textContent = `searching: ${percent(progress.evaluations / progress.budget, 0)}, best so far about +${progress.best}`;
      }
    }, PROGRESS_MS);
    const answer = await this.attempt(() => post('api/suggestion', {from, measurement: position.measurement, ...this.insteadOf()}));
    clearInterval(watch);
    if (number !== this.search) return;
    $('suggest-cancel').hidden = true;
    if (!answer || answer.cancelled) {
      note.textContent = answer ? 'cancelled' : '';
      return;
    }
    note.textContent = `+${answer.new_targets} found by ${answer.evaluations} estimates.`;
    this.movedAt = performance.now();
    this.controls.show({measurement: answer.measurement});
    this.moved(true);
  }
}

const explorer = new Explorer();
explorer.start().catch((error) => explorer.trouble(error.message));
