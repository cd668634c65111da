// SPDX-License-Identifier: Apache-2.0
// The 3-D view: the report's scene, coloured by the targets that the plan and this scan measure.
import {hasBit, readScene} from '../../../report/viewer/data.js';
import {legendLine} from '../../../report/viewer/legend.js';
import {COVERED, NEVER, NEW, PartScene, UNMEASURABLE} from '../../../report/viewer/scene.js';

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
  /** Throws if there is no WebGL. `scene` is a ReportScene. */
  constructor(canvas, frame, scene) {
    this.data = readScene(scene);
    this.scene = new PartScene(canvas, this.data);
    this.scene.setPalette(['--covered', '--new', '--later', '--never', '--unmeasurable'].map(css), css('--edge'), css('--edge-ghost'));
    this.scene.setShown([true, true, true, true, true]);
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
    this.states = targetStates(count, measurable, bytesOf(plan), bytesOf(scan));
    this.recolour();
    if (this.first) this.scene.view('scan');
    this.first = false;
  }

  recolour() {
    if (this.states) this.scene.setStates(this.states, null);
  }

  setStage(fraction) {
    this.fraction = fraction;
    this.scene.setStage(fraction);
  }

  /** By state, whether its surface is drawn. */
  setShown(shown) {
    this.scene.setShown(shown);
    this.recolour();
  }

  view(kind) {
    this.scene.view(kind);
  }
}

/** Colours and counts, with boxes that hide the surface in a state. `view` may come later or not at all. */
export class Legend {
  constructor(list) {
    this.list = list;
    this.shown = [true, true, true, true, true];
  }

  show(fresh, plan, measurable, targets) {
    const counts = {[NEW]: fresh, [COVERED]: plan, [NEVER]: measurable - plan - fresh, [UNMEASURABLE]: targets - measurable};
    const focused = [...this.list.children].findIndex((line) => line.contains(document.activeElement));
    this.list.replaceChildren(...LEGEND.map(([state, colour, name]) =>
      legendLine(`var(${colour})`, name, counts[state], this.shown[state], (shown) => {
        this.shown[state] = shown;
        this.view?.setShown(this.shown);
      })));
    this.list.children[focused]?.querySelector('input').focus();
  }
}
