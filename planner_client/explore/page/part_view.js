// SPDX-License-Identifier: Apache-2.0
// The 3-D view: the report's scene, coloured by the targets that the plan and this scan measure.
import {hasBit, readScene} from '../../report/viewer/data.js';
import {COVERED, NEVER, NEW, PartScene, UNMEASURABLE} from '../../report/viewer/scene.js';

const LEGEND = [
  [NEW, '--new', 'new with this scan'],
  [COVERED, '--covered', 'covered by the plan'],
  [NEVER, '--never', 'not covered'],
  [UNMEASURABLE, '--unmeasurable', 'not measurable'],
];

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

/** One state per target. */
export function targetStates(count, measurable, plan, scan) {
  const states = new Uint8Array(count);
  for (let i = 0; i < count; ++i) {
    states[i] = !hasBit(measurable, i) ? UNMEASURABLE :
      hasBit(plan, i) ? COVERED :
      hasBit(scan, i) ? NEW : NEVER;
  }
  return states;
}

export class PartView {
  /** Fails if there is no WebGL. `sceneText` is a ReportScene in JSON. */
  static async open(canvas, frame, sceneText) {
    return new PartView(canvas, frame, await readScene(JSON.parse(sceneText)));
  }

  constructor(canvas, frame, data) {
    this.data = data;
    this.scene = new PartScene(canvas, this.data);
    this.scene.setPalette(['--covered', '--new', '--later', '--never', '--unmeasurable'].map(css), css('--edge'), css('--edge-ghost'));
    this.scene.setShown([1, 1, 1, 1, 1]);
    this.scene.showRig(true);
    this.scene.onViewChange = (aspect) => {
      frame.hidden = aspect === null;
      if (aspect !== null) frame.style.aspectRatio = aspect;
    };
    this.fraction = 0.5;
    this.first = true;
  }

  /** Shows an answer of /api/scan. */
  show({view, plan_bits: plan, covered_bits: scan}) {
    this.data.scans[0] = view;
    this.scene.setScan(0);
    this.scene.showRig(true);
    this.setStage(this.fraction);
    const {count, measurable} = this.data.targets;
    this.scene.setStates(targetStates(count, measurable, bytesOf(plan), bytesOf(scan)), null);
    if (this.first) this.scene.view('scan');
    this.first = false;
  }

  setStage(fraction) {
    this.fraction = fraction;
    this.scene.setStage(fraction);
  }

  view(kind) {
    this.scene.view(kind);
  }
}

/** Names the colours; counts are filled in by the caller. */
export function fillLegend(list) {
  const counts = new Map();
  for (const [state, colour, name] of LEGEND) {
    const item = document.createElement('li');
    const swatch = document.createElement('span');
    swatch.className = 'swatch';
    swatch.style.background = `var(${colour})`;
    const count = document.createElement('span');
    count.className = 'soft';
    item.append(swatch, name, ' ', count);
    list.append(item);
    counts.set(state, count);
  }
  return {
    show(fresh, plan, measurable, targets) {
      const text = {[NEW]: fresh, [COVERED]: plan, [NEVER]: measurable - plan - fresh, [UNMEASURABLE]: targets - measurable};
      for (const [state, count] of counts) count.textContent = text[state];
    },
  };
}
