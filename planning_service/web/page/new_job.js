// SPDX-License-Identifier: Apache-2.0
// A new job: kind, files, form, JSON and submission of one task.
import {createJob, listJobs, newIdempotencyKey} from './api.js';
import {droppedFiles, filesOfInput} from './chosen_files.js';
import {h, timeText} from './dom.js';
import {FIELD_BY_PATH} from './fields.js';
import {humanDescription, locateErrors} from './field_errors.js';
import {FormView} from './form_view.js';
import {carriesUnit, isMeasuredName, isMeshName, neededFiles, roleOfJson, sentName, withSentNames} from './job_files.js';
import {PartPanel, refusedSize, sizeText} from './part_panel.js';
import {
  angleOfViewDeg, domainBounds, fieldOfView, getPath, KINDS, parseJsonObject, takesInspection, takesPlan,
  takesRecordings, taskOfKind, withFollowingAngle, withPath,
} from './task_model.js';
import {bytesText, METRES_PER_UNIT, roundedText, UNIT_NAMES} from './units.js';

const MAX_JSON_BYTES = 64e6;
const RETRY_WAITS_S = [1, 3];
// Places outside the form where errors can be shown.
const PLACES = ['kind', 'files', 'inspection', 'inspection.part.file', 'inspection.part.unit', 'plan', 'plan_job_id', 'recordings',
                'inspect_options.measured'];
const KNOWN_PATHS = new Set([...FIELD_BY_PATH.keys(), ...PLACES]);
const ANGLE_INPUTS = new Set(['inspection.camera.rows_px', 'inspection.camera.pixel_pitch_m',
                              'inspection.lens.focal_length_m', 'inspection.lens.focus_distance_m']);

function jsonText(inspection) { return JSON.stringify(inspection ?? {}, null, 2); }

export class NewJobView {
  constructor() {
    this.kind = 'plan';
    this.task = {inspection: {}};
    this.files = [];
    this.jsonError = '';
    // Name of a part file for which the service asked for the unit.
    this.partWithoutUnit = null;
    // For diagnose: whether the inspection is what recordings are compared with.
    this.usesInspection = false;
    this.key = null;
    this.form = new FormView((path, value) => this.take(path, value));
    this.panel = new PartPanel(() => this.showUnit());
    this.build();
    this.refresh();
  }

  build() {
    this.kindBox = h('fieldset', {class: 'kinds'},
        h('legend', {class: 'visually-hidden'}, 'Kind of job'),
        Object.entries(KINDS).map(([kind, {title, text}]) => h('label', {class: 'kind'},
            h('input', {type: 'radio', name: 'kind', value: kind, checked: kind === this.kind,
                        onchange: () => this.setKind(kind)}),
            h('span', {}, h('strong', {}, title), h('small', {}, text)))));
    const button = (text, input) => {
      input.addEventListener('change', () => { this.add(filesOfInput(input)); input.value = ''; });
      return h('button', {type: 'button', onclick: () => input.click()}, text);
    };
    const fileInput = h('input', {type: 'file', multiple: true, id: 'file-input', hidden: true,
                                  'aria-label': 'Files of the job'});
    const folderInput = h('input', {type: 'file', webkitdirectory: true, id: 'folder-input', hidden: true,
                                    'aria-label': 'Folder with the files of the job'});
    this.dropText = h('p', {class: 'drop-text'});
    this.drop = h('div', {class: 'drop', id: 'drop'}, this.dropText,
        h('p', {class: 'buttons'}, button('Choose files …', fileInput), button('Choose a folder …', folderInput)),
        fileInput, folderInput);
    this.acceptDrops(this.drop);
    this.acceptDrops(this.panel.stage);
    this.fileList = h('ul', {class: 'files', 'aria-label': 'Files'});
    this.filesError = h('p', {class: 'error', id: 'files-error', hidden: true});
    this.fileNews = h('p', {class: 'soft news', 'aria-live': 'polite'});
    this.unitBox = h('fieldset', {class: 'units', hidden: true, 'aria-describedby': 'unit-error'});
    this.unitError = h('p', {class: 'error', id: 'unit-error', hidden: true});
    this.filesCard = h('section', {class: 'card', 'aria-labelledby': 'title-files'},
        h('h2', {id: 'title-files', tabindex: '-1'}, 'Part and files'),
        this.drop, this.filesError, this.fileNews, this.fileList, this.unitBox, this.unitError);

    this.planInput = h('input', {
      type: 'text', id: 'plan-job', list: 'plan-jobs', autocomplete: 'off', spellcheck: 'false',
      placeholder: 'id of a plan job', 'aria-describedby': 'plan-error',
      oninput: () => {
        const id = this.planInput.value.trim();
        this.markPlace('plan', '');
        this.change(withPath(this.task, 'plan_job_id', id || undefined));
      },
    });
    this.planChoices = h('datalist', {id: 'plan-jobs'});
    this.planNote = h('p', {class: 'soft help'});
    this.planError = h('p', {class: 'error', id: 'plan-error', hidden: true});
    this.planCard = h('section', {class: 'card', 'aria-labelledby': 'title-plan'},
        h('h2', {id: 'title-plan'}, 'Scans'),
        h('div', {class: 'fields'}, h('div', {class: 'field wide'},
            h('label', {for: 'plan-job'}, 'On the plan of job'), this.planInput, this.planChoices,
            this.planNote, this.planError)));

    this.nullModelInput = h('input', {type: 'checkbox', onchange: () => {
      this.usesInspection = this.nullModelInput.checked;
      this.refresh();
    }});
    this.nullModelCard = h('div', {class: 'card'}, h('div', {class: 'field'}, h('label', {class: 'flag'}, this.nullModelInput,
        ' Compare with an inspection (inspection.json, or the JSON below) instead of what the recordings of the part say')));

    this.jsonBox = h('textarea', {id: 'json', spellcheck: 'false', rows: 18, autocomplete: 'off',
                                  'aria-describedby': 'json-help json-error', oninput: () => this.takeJson()});
    this.jsonErrorText = h('p', {class: 'error', id: 'json-error', hidden: true});
    this.jsonDiscard = h('button', {type: 'button', hidden: true, onclick: () => this.discardJson()},
        'Back to what the form has');
    this.jsonCard = h('details', {class: 'card', id: 'json-card'},
        h('summary', {}, h('h2', {}, 'Advanced: the whole inspection as JSON')),
        h('p', {class: 'soft help', id: 'json-help'},
            'In step with the form, in the service’s units (m, s, fractions). What the form does not show, such as obstacles or regions, is written here.'),
        h('label', {for: 'json', class: 'visually-hidden'}, 'Inspection as JSON'),
        this.jsonBox, this.jsonErrorText, this.jsonDiscard);
    this.formLock = h('fieldset', {class: 'bare'}, this.form.element);
    this.formNote = h('p', {class: 'notice', hidden: true},
        'The JSON below cannot be read. Mend it, or go back to what the form has.');

    this.summary = h('div', {class: 'summary', role: 'alert'});
    this.upload = h('progress', {max: 1, value: 0, hidden: true, 'aria-label': 'Upload'});
    this.submitState = h('p', {class: 'soft', 'aria-live': 'polite'});
    this.submitButton = h('button', {type: 'submit', class: 'primary'}, 'Submit job');
    this.stopButton = h('button', {type: 'button', hidden: true, onclick: () => this.stop?.abort()}, 'Stop');
    const submit = h('div', {class: 'card submit'}, this.summary,
        h('p', {class: 'buttons'}, this.submitButton, this.stopButton), this.upload, this.submitState);

    this.heading = h('h1', {tabindex: '-1'}, 'New job');
    this.element = h('form', {class: 'new-job', novalidate: true, onsubmit: (event) => {
      event.preventDefault();
      this.submit();
    }},
        h('div', {class: 'intro-area'}, this.heading, this.kindBox, this.filesCard),
        this.panel.element,
        h('div', {class: 'form-area'}, this.planCard, this.nullModelCard,
            h('p', {class: 'soft empty-hint'}, 'A field left empty takes the value shown in it.'),
            this.formNote, this.formLock, this.jsonCard, submit));
  }

  acceptDrops(element) {
    let depth = 0;
    const over = (change) => {
      depth = Math.max(0, depth + change);
      element.classList.toggle('over', depth > 0);
    };
    element.addEventListener('dragenter', (event) => { event.preventDefault(); over(1); });
    element.addEventListener('dragover', (event) => event.preventDefault());
    element.addEventListener('dragleave', () => over(-1));
    element.addEventListener('drop', async (event) => {
      event.preventDefault();
      depth = 0;
      over(0);
      this.add(await droppedFiles(event.dataTransfer));
    });
  }

  // --- routes -------------------------------------------------------------------------------------

  show({kind, plan} = {}) {
    if (kind && KINDS[kind]) this.setKind(kind);
    if (plan) {
      this.change(withPath(this.task, 'plan_job_id', plan));
    }
    this.offerPlans();
  }

  hide() {}

  async offerPlans() {
    if (!takesPlan(this.kind)) return;
    try {
      const {jobs = []} = await listJobs({pageSize: 100, kind: 'plan', state: 'SUCCEEDED'});
      this.planChoices.replaceChildren(...jobs.map((job) =>
        h('option', {value: job.job_id}, `plan of ${timeText(job.finished_at)}`)));
    } catch { /* The id can be typed. */ }
  }

  setKind(kind) {
    this.kind = kind;
    for (const input of this.kindBox.querySelectorAll('input')) input.checked = input.value === kind;
    this.clearErrors();
    this.refresh();
    this.offerPlans();
  }

  // --- the task -----------------------------------------------------------------------------------

  // From an input of the form.
  take(path, value) {
    let task = withPath(this.task, path, value);
    if (ANGLE_INPUTS.has(path)) {
      task = {...task, inspection: withFollowingAngle(this.task.inspection ?? {}, task.inspection ?? {})};
    }
    this.change(task);
  }

  // `fromJson`: the text stays as its author wrote it.
  change(task, fromJson = false) {
    this.task = {...task, inspection: task.inspection ?? {}};
    if (!fromJson) this.jsonBox.value = jsonText(this.task.inspection);
    this.refresh();
  }

  takeJson() {
    const {value, error} = parseJsonObject(this.jsonBox.value);
    this.setJsonError(error);
    if (!error) this.change({...this.task, inspection: value}, true);
  }

  setJsonError(error) {
    this.jsonError = error ?? '';
    this.markPlace('inspection', this.jsonError);
    this.jsonDiscard.hidden = !error;
    this.formLock.disabled = Boolean(error);
    this.formNote.hidden = !error;
  }

  discardJson() {
    this.jsonBox.value = jsonText(this.task.inspection);
    this.setJsonError('');
    this.jsonBox.focus();
  }

  // --- files --------------------------------------------------------------------------------------

  async add(added) {
    const news = [];
    const chosen = [];
    for (const {path, blob} of added) {
      let json = null;
      if (/\.json$/i.test(path) && blob.size <= MAX_JSON_BYTES) {
        const {value, error} = parseJsonObject(await blob.text());
        if (error) {
          news.push(`${path}: ${error}.`);
          continue;
        }
        json = value;
      }
      const role = json ? roleOfJson(json) : 'other';
      if (role === 'inspection') {
        this.setJsonError('');
        if (this.kind === 'diagnose') this.usesInspection = true;
        this.change({...this.task, inspection: json});
        news.push(`${path} is in the form now.`);
      } else if (role === 'recordings' || role === 'plan') {
        this.change({...this.task, [role]: json, ...(role === 'plan' ? {plan_job_id: undefined} : {})});
        if (role === 'recordings' && !takesRecordings(this.kind)) {
          news.push(`${path} belongs to the kinds Verify, Diagnose and Render.`);
        }
        if (role === 'plan' && !takesPlan(this.kind)) {
          news.push(`${path} belongs to the kinds Evaluate, Inspect, Optics and Render.`);
        }
      } else {
        chosen.push({path, blob, json});
      }
    }
    for (const file of chosen) {
      this.files = [...this.files.filter(({path}) => path !== file.path), file];
    }
    if (this.kind === 'inspect') this.addMeasured(chosen);
    // A mesh that nothing names is the part.
    for (const file of chosen) {
      const isNamed = this.needed().some((needed) => needed.file === file);
      if (isNamed || !isMeshName(file.path) || !takesInspection(this.kind) || this.kind === 'diagnose') continue;
      const before = getPath(this.task, 'inspection.part.file');
      let task = withPath(this.task, 'inspection.part.file', sentName(file.path));
      if (before !== sentName(file.path) || carriesUnit(file.path)) task = withPath(task, 'inspection.part.unit', undefined);
      this.files = this.files.filter(({path}) => path === file.path || !before || sentName(path) !== sentName(before));
      this.change(task);
    }
    this.markPlace('files', '');
    this.fileNews.textContent = news.join(' ');
    this.refresh();
  }

  // Files of points that nothing names are measured, one for each scan, in the order of their names.
  addMeasured(chosen) {
    const news = chosen.filter((file) => isMeasuredName(file.path) && !this.needed().some((needed) => needed.file === file));
    const names = new Set((getPath(this.task, 'inspect_options.measured') ?? []).map(({file}) => file));
    for (const {path} of news) names.add(sentName(path));
    if (news.length) this.setMeasured([...names].sort());
  }

  setMeasured(names) {
    this.markPlace('inspect_options.measured', '');
    this.change(withPath(this.task, 'inspect_options.measured', names.length ? names.map((file) => ({file})) : undefined));
  }

  remove(file) {
    this.files = this.files.filter((other) => other !== file);
    const measured = (getPath(this.task, 'inspect_options.measured') ?? []).map((entry) => entry.file);
    if (measured.includes(sentName(file.path))) this.setMeasured(measured.filter((name) => name !== sentName(file.path)));
    if (sentName(getPath(this.task, 'inspection.part.file') ?? '') === sentName(file.path)) {
      this.change(withPath(this.task, 'inspection.part', undefined));
    }
    this.refresh();
    this.filesCard.querySelector('button').focus();
  }

  // Whether this job has an inspection, which the form may hold from another kind.
  hasInspection() { return takesInspection(this.kind) && (this.kind !== 'diagnose' || this.usesInspection); }
  sentTask() {
    return taskOfKind(this.kind, this.hasInspection() ? this.task : {...this.task, inspection: undefined});
  }
  needed() { return neededFiles(this.sentTask(), this.files); }

  // --- drawing ------------------------------------------------------------------------------------

  refresh() {
    this.form.fill(this.task);
    this.form.showKind(this.kind);
    if (!this.jsonError && !this.jsonBox.value) this.jsonBox.value = jsonText(this.task.inspection);
    this.planCard.hidden = !takesPlan(this.kind);
    this.nullModelCard.hidden = this.kind !== 'diagnose';
    this.nullModelInput.checked = this.usesInspection;
    this.jsonCard.hidden = !this.hasInspection();
    this.dropText.replaceChildren(...({
      verify: [h('strong', {}, 'Drop recordings.json and its images here')],
      diagnose: [h('strong', {}, 'Drop recordings.json and its images here'),
                 ', for recordings of a part also its mesh and inspection.json'],
      inspect: [h('strong', {}, 'Drop inspection.json, the part and the measured points here'),
                ' (scan_NN.ply, PCD, CSV of profiles or depth rasters)'],
    }[this.kind] ?? [h('strong', {}, 'Drop the part here'),
                     ' (GLB, STL, PLY, OBJ), or an inspection.json and the files it names']));
    if (this.planInput.value.trim() !== (this.task.plan_job_id ?? '')) this.planInput.value = this.task.plan_job_id ?? '';
    this.planNote.textContent = this.task.plan && !this.task.plan_job_id ? '' : ['evaluate', 'inspect'].includes(this.kind) ?
        'Or choose a plan.json above.' : 'Or choose a plan.json above. Empty: the inspection’s own arrangement.';
    this.element.classList.toggle('without-part', this.kind === 'verify' || this.kind === 'diagnose');
    this.drawFiles();
    this.drawDerived();
  }

  drawFiles() {
    const needed = this.needed();
    const row = (name, detail, remove, isMissing) => h('li', {class: isMissing ? 'missing' : ''},
        h('span', {class: 'name'}, name), h('span', {class: 'soft'}, detail),
        remove ? h('button', {type: 'button', class: 'quiet', 'aria-label': `Remove ${name}`, onclick: remove}, '✕') : null);
    const rows = [];
    for (const role of ['plan', 'recordings']) {
      const json = this.task[role];
      if (json === undefined || (role === 'plan' && this.task.plan_job_id)) continue;
      const isUsed = role === 'plan' ? takesPlan(this.kind) : takesRecordings(this.kind);
      const count = role === 'plan' ? `${json.scans?.length ?? 0} scans` : `${json.recordings?.length ?? 0} recordings`;
      rows.push(row(`${role}.json`, isUsed ? count : `${count}; not used by ${KINDS[this.kind].title}`,
          () => this.change(withPath(this.task, role, undefined))));
    }
    const MAX_ROWS = 12;
    const missing = needed.filter(({file}) => !file);
    for (const {name, path} of missing.slice(0, MAX_ROWS)) {
      rows.push(row(name, path === 'inspection.part.file' ? 'the part: not chosen yet' : `not chosen yet; named by ${path}`, null, true));
    }
    const roleOf = new Map(needed.filter(({file}) => file).map(({file, path}) => [file, path]));
    const unused = (file) => !roleOf.has(file);
    const files = [...this.files.filter((file) => !unused(file)), ...this.files.filter(unused)];
    for (const file of files.slice(0, MAX_ROWS)) {
      const path = roleOf.get(file);
      const use = path === 'inspection.part.file' ? 'part' : path?.startsWith('inspect_options.measured') ? 'measured points' : path ? 'named by the task' : 'not named by the task, not sent';
      rows.push(row(file.path, `${use} · ${bytesText(file.blob.size)}`, () => this.remove(file)));
    }
    const more = Math.max(0, missing.length - MAX_ROWS) + Math.max(0, this.files.length - MAX_ROWS);
    if (more) rows.push(h('li', { class: 'soft'}, `and ${more} more`));
    this.fileList.replaceChildren(...rows);
    this.fileList.hidden = rows.length === 0;
    const part = needed.find(({path}) => path === 'inspection.part.file')?.file;
    this.panel.show(part?.blob, part?.path ?? '');
    this.showUnit();
  }

  showUnit() {
    const name = getPath(this.task, 'inspection.part.file');
    const stated = getPath(this.task, 'inspection.part.unit') ?? '';
    const unit = stated || (name && carriesUnit(name) ? 'm' : '');
    this.panel.setUnit(unit);
    const isAsked = Boolean(name) && (!carriesUnit(name) || name === this.partWithoutUnit) && takesInspection(this.kind) && this.kind !== 'diagnose';
    const size = this.panel.part?.size;
    const state = JSON.stringify([isAsked, stated, size]);
    if (state === this.unitState) return;
    this.unitState = state;
    // The focus of a user who tabs through the page stays where it is while the part is read.
    const focused = this.unitBox.contains(document.activeElement) ? document.activeElement.value : null;
    this.unitBox.hidden = !isAsked;
    this.unitBox.replaceChildren(h('legend', {}, 'Unit of the file: which size is right?'),
        ...Object.keys(METRES_PER_UNIT).map((choice) => h('label', {},
            h('input', {type: 'radio', name: 'unit', value: choice, checked: choice === stated, onchange: () => {
              this.markPlace('inspection.part.unit', '');
              this.change(withPath(this.task, 'inspection.part.unit', choice));
            }}),
            h('span', {}, h('strong', {}, UNIT_NAMES[choice]), ...(size ? [` ${sizeText(size, choice)}`,
                h('span', {class: 'soft'}, refusedSize(size, choice) ? ` – too ${refusedSize(size, choice)}` : '')] : [])))));
    if (focused !== null) (this.unitBox.querySelector('input:checked') ?? this.unitBox.querySelector(`input[value="${focused}"]`))?.focus();
  }

  // Shows the values derived from the camera's numbers.
  drawDerived() {
    const box = this.form.element.querySelector('#derived-camera');
    const {inspection} = this.task;
    const hasSensor = getPath(inspection, 'camera.sensor_file') || getPath(inspection, 'camera.sensor');
    box.hidden = Boolean(hasSensor);
    if (hasSensor) return;
    const [near_m, far_m] = domainBounds(getPath(inspection, 'measurement.camera_distance_m'), [0.1, 0.8]);
    const at = (distance_m) => {
      const view = fieldOfView(inspection, distance_m);
      return view && `${roundedText(view.width_mm)} × ${roundedText(view.height_mm)} mm at ${roundedText(1e3 * distance_m)} mm ` +
          `(${roundedText(view.pixel_mm)} mm per pixel)`;
    };
    const sights = (near_m === far_m ? [near_m] : [near_m, far_m]).map(at);
    const text = sights.every(Boolean) ? `Sees ${sights.join(', ')}.` : '';
    const angle_deg = angleOfViewDeg(inspection);
    const stated_deg = Number(getPath(inspection, 'camera.vertical_fov_deg') ?? angle_deg ?? 45);
    const differs = angle_deg !== undefined && Math.abs(stated_deg / angle_deg - 1) > 0.01;
    const content = [text];
    if (differs) {
      content.push(h('span', {class: 'warning'}, ` Pixel size, rows and focal length give ${roundedText(angle_deg)} deg, ` +
          `the angle of view is ${roundedText(stated_deg)} deg. `),
      h('button', {type: 'button', onclick: () => this.take('inspection.camera.vertical_fov_deg', angle_deg)},
          `Use ${roundedText(angle_deg)} deg`));
    }
    box.replaceChildren(...content);
  }

  // --- errors -------------------------------------------------------------------------------------

  // The elements that show an error outside the form: [text element, element to focus].
  place(path) {
    switch (path) {
      case 'inspection': return [this.jsonErrorText, this.jsonBox];
      case 'inspection.part.unit': return this.unitBox.hidden ? this.place('files') : [this.unitError, this.unitBox.querySelector('input')];
      case 'plan': case 'plan_job_id':
        return this.planCard.hidden ? this.place('files') : [this.planError, this.planInput];
      default: return [this.filesError, this.filesCard.querySelector('button')];
    }
  }

  markPlace(path, description) {
    const [text, target] = this.place(path);
    text.textContent = description;
    text.hidden = !description;
    if (target.matches('input, textarea')) {
      if (description) {
        target.setAttribute('aria-invalid', 'true');
      } else {
        target.removeAttribute('aria-invalid');
      }
    }
    if (description && path === 'inspection') this.jsonCard.open = true;
  }

  clearErrors() {
    this.form.clearMarks();
    for (const path of PLACES) {
      if (path !== 'inspection' || !this.jsonError) this.markPlace(path, '');
    }
    this.summary.replaceChildren();
  }

  // Marks errors [{path, field, description}] where they belong and lists them, the first in focus.
  showErrors(heading, errors) {
    // A STEP file usually states its unit; the service has found that this one does not.
    if (errors.some(({path}) => path === 'inspection.part.unit')) {
      this.partWithoutUnit = getPath(this.task, 'inspection.part.file');
      this.showUnit();
    }
    const items = errors.map(({path, field, description}) => {
      const control = path && this.form.isShown(path) ? path : null;
      if (control) {
        const text = humanDescription(description, FIELD_BY_PATH.get(path));
        this.form.mark(path, text);
        this.form.reveal(path);
        return {text: `${this.form.label(path)}: ${text}`, go: () => this.form.focus(path)};
      }
      const isOfInspection = /^(task\.)?inspection\./.test(field ?? '') || FIELD_BY_PATH.has(path);
      const place = PLACES.includes(path) ? path : isOfInspection && this.hasInspection() ? 'inspection' : null;
      const text = field && place !== 'plan_job_id' && !/^inspection\.part\.(file|unit)$/.test(place ?? '') && field !== 'files' ?
          `${field} ${description}` : description;
      if (!place) return {text};
      this.markPlace(place, text);
      const [, target] = this.place(place);
      return {text, go: () => { target.focus(); target.scrollIntoView({block: 'center'}); }};
    });
    this.summary.replaceChildren(h('p', {class: 'error'}, heading),
        items.length ? h('ul', {}, items.map(({text, go}) =>
          h('li', {}, go ? h('button', {type: 'button', class: 'link', onclick: go}, text) : text))) : '');
    items.find(({go}) => go)?.go();
  }

  // Errors that the page finds before anything is sent.
  ownErrors() {
    const errors = this.form.unread().map(({path, description}) => ({path, field: path, description}));
    if (this.jsonError && this.hasInspection()) {
      errors.push({path: 'inspection', field: '', description: this.jsonError});
    }
    const task = this.sentTask();
    if (['plan', 'evaluate', 'inspect', 'optics'].includes(this.kind) && !getPath(task, 'inspection.part.file')) {
      errors.push({path: 'inspection.part.file', field: '', description: 'Choose the part.'});
    }
    if (takesRecordings(this.kind) && !task.recordings && !getPath(task, 'inspection.part.file')) {
      errors.push({path: 'recordings', field: '', description: this.kind === 'render' ?
          'Choose the part, or a recordings.json.' : 'Choose a recordings.json.'});
    } else if (this.kind === 'diagnose' && !task.recordings) {
      errors.push({path: 'recordings', field: '', description: 'Choose a recordings.json.'});
    }
    if (this.kind === 'inspect' && !getPath(task, 'inspect_options.measured')) {
      errors.push({path: 'inspect_options.measured', field: '', description: 'Choose the measured points, a file for each scan.'});
    }
    if (['evaluate', 'inspect'].includes(this.kind) && !task.plan && !task.plan_job_id) {
      errors.push({path: 'plan_job_id', field: '', description: 'Give the job that made the plan, or choose a plan.json.'});
    }
    const part = getPath(task, 'inspection.part.file');
    if (part && !this.unitBox.hidden && !getPath(task, 'inspection.part.unit')) {
      errors.push({path: 'inspection.part.unit', field: '', description: 'Choose the unit: the file states none.'});
    }
    const missing = this.needed().filter(({file}) => !file).map(({name}) => name);
    if (missing.length) {
      const shown = missing.slice(0, 3).join(', ');
      errors.push({path: 'files', field: 'files', description:
          `Choose ${shown}${missing.length > 3 ? ` and ${missing.length - 3} more` : ''}: the task names ${missing.length > 1 ? 'them' : 'it'}.`});
    }
    return errors;
  }

  // --- submission ---------------------------------------------------------------------------------

  async submit() {
    if (this.stop) return;
    this.clearErrors();
    const own = this.ownErrors();
    if (own.length) {
      this.showErrors('Not submitted yet:', own);
      return;
    }
    const task = withSentNames(this.sentTask());
    const files = this.needed().map(({name, file}) => ({name, blob: file.blob}));
    // The same content keeps its key until the service has taken it: however often it is sent, it is
    // one job.
    const content = JSON.stringify([task, files.map(({name, blob}) => [name, blob.size, blob.lastModified])]);
    if (this.key?.content !== content) this.key = {content, value: newIdempotencyKey()};
    this.stop = new AbortController();
    this.busy(true);
    try {
      const job = await this.send(task, files);
      this.key = null;
      location.hash = `#/jobs/${encodeURIComponent(job.job_id)}`;
    } catch (error) {
      this.showRefusal(error);
    } finally {
      this.stop = null;
      this.busy(false);
    }
  }

  async send(task, files) {
    for (let attempt = 0; ; ++attempt) {
      this.submitState.textContent = attempt ? 'No answer; trying again …' : 'Sending …';
      try {
        return await createJob({task, files, key: this.key.value, signal: this.stop.signal, onProgress: (fraction) => {
          this.upload.value = fraction;
          if (fraction === 1) this.submitState.textContent = 'Sent; the service checks the task …';
        }});
      } catch (error) {
        if (!error.isTransient || attempt >= RETRY_WAITS_S.length || this.stop.signal.aborted) throw error;
        await new Promise((resolve) => { setTimeout(resolve, 1000 * RETRY_WAITS_S[attempt]); });
      }
    }
  }

  showRefusal(error) {
    if (error.code === 'CANCELLED') {
      this.showErrors('Stopped. Submitting again does not make a second job.', []);
    } else if (error.isTransient) {
      this.showErrors(`${error.message} Submitting again does not make a second job.`, []);
    } else {
      // A key that was used for something else is of no use.
      if (error.reason === 'REQUEST_ID_REUSED') this.key = null;
      const located = locateErrors(error, KNOWN_PATHS);
      this.showErrors(located.length ? 'The service did not take the job:' :
          `The service did not take the job: ${error.message || error.code}`, located);
    }
  }

  busy(isBusy) {
    this.submitButton.disabled = isBusy;
    this.stopButton.hidden = !isBusy;
    this.upload.hidden = !isBusy;
    this.upload.value = 0;
    if (!isBusy) this.submitState.textContent = '';
  }
}
