// SPDX-License-Identifier: Apache-2.0
// The stage with the part, and its size.
import {h} from './dom.js';
import {PartView} from './part_view.js';
import {METRES_PER_UNIT, roundedText} from './units.js';

// Reading takes several times the file's size in memory.
const MAX_SHOWN_BYTES = 400e6;

export function sizeText(size, unit) {
  return `${size.map((length) => roundedText(1e3 * length * METRES_PER_UNIT[unit])).join(' × ')} mm`;
}

// 'large' or 'small' if the service refuses a part of that size; else empty.
export function refusedSize(size, unit) {
  const largest_m = Math.max(...size) * METRES_PER_UNIT[unit];
  return largest_m > 10 ? 'large' : largest_m < 1e-3 ? 'small' : '';
}

export class PartPanel {
  // `onRead(part)` once a file is read; null if it cannot be.
  constructor(onRead) {
    this.onRead = onRead;
    this.note = h('p', {class: 'stage-note'}, 'The part appears here.');
    this.stage = h('div', {class: 'stage'}, this.note);
    this.facts = h('p', {class: 'facts', 'aria-live': 'polite'});
    this.element = h('aside', {class: 'part-panel', 'aria-label': 'The part'},
        h('div', {class: 'stage-card'}, this.stage, this.facts));
    this.blob = null;
    this.requests = 0;
  }

  // Shows a file; null: none.
  async show(file, name) {
    if ((file ?? null) === this.blob) return;
    this.blob = file ?? null;
    this.part = null;
    const request = ++this.requests;
    this.view?.clear();
    this.facts.textContent = '';
    this.say(file ? 'Reading the part …' : 'The part appears here.');
    this.onRead(null);
    if (!file) return;
    if (file.size > MAX_SHOWN_BYTES) {
      this.say('The file is too large to be shown here. It can be submitted all the same.');
      return;
    }
    try {
      const part = await this.read(request, name, await file.arrayBuffer());
      if (request !== this.requests) return;
      this.part = part;
      this.draw(part);
      this.onRead(part);
    } catch (error) {
      if (request !== this.requests) return;
      this.say(`The part cannot be shown: ${error.message}.`);
    }
  }

  // A new worker for every file: one that is busy with the file before is of no use.
  read(request, name, bytes) {
    this.worker?.terminate();
    this.worker = new Worker('assets/part_reader.js');
    return new Promise((resolve, reject) => {
      this.worker.addEventListener('message', ({data}) => {
        if (data.id !== request) return;
        if (data.part) {
          resolve(data.part);
        } else {
          reject(new Error(data.error));
        }
        this.worker.terminate();
      });
      this.worker.addEventListener('error', (event) => reject(new Error(event.message || 'it cannot be read')));
      this.worker.postMessage({id: request, name, bytes}, [bytes]);
    });
  }

  draw(part) {
    try {
      this.view ??= new PartView(this.stage);
    } catch {
      this.say('The view needs WebGL, which is not available here.');
      return;
    }
    this.note.hidden = true;
    this.view.show(part);
  }

  say(text) {
    this.note.textContent = text;
    this.note.hidden = false;
  }

  // The unit as it is stated; empty: not yet.
  setUnit(unit) {
    const metres = METRES_PER_UNIT[unit] ?? null;
    this.view?.setMetresPerUnit(metres);
    if (!this.part) {
      this.facts.textContent = '';
      return;
    }
    const {size, positions} = this.part;
    const triangles = `${(positions.length / 9).toLocaleString('en')} triangles`;
    const warning = metres === null ? '' : {
      large: 'Larger than 10 m: the service will refuse it. Is the unit right?',
      small: 'Smaller than 1 mm: the service will refuse it. Is the unit right?',
    }[refusedSize(size, unit)] ?? '';
    this.facts.replaceChildren(
        h('strong', {}, metres === null ? 'Size not known yet: choose the unit' : sizeText(size, unit)),
        h('span', {class: 'soft'}, ` · ${triangles}`),
        warning ? h('span', {class: 'error'}, warning) : '');
    this.view?.canvas.setAttribute('aria-label', metres === null ?
        'The part. Arrow keys turn it, plus and minus zoom.' :
        `The part, ${sizeText(size, unit)}. Arrow keys turn it, plus and minus zoom.`);
  }
}
