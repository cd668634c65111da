// SPDX-License-Identifier: Apache-2.0
// The scans of the plan, each with its actions.
import {tidy} from './parameter.js';

function arrangement({measurement: m}) {
  return `${tidy(1e3 * m.camera_distance_m)} mm, angle ${tidy(m.triangulation_angle_deg)}°, polar ${tidy(m.camera_polar_deg)}°, ` +
    `azimuth ${tidy(m.camera_azimuth_deg)}°, part ${[m.part_alpha_deg, m.part_beta_deg, m.part_gamma_deg].map(tidy).join('/')}°`;
}

export class PlanList {
  /** act(action, index, to) for "load", "remove", "move". */
  constructor(body, empty, act) {
    this.body = body;
    this.empty = empty;
    this.act = act;
  }

  show(scans, measurable, loaded) {
    // The pressed button is made anew; the focus goes to its successor.
    const focused = document.activeElement?.closest?.('#scans') ? document.activeElement.dataset.key : null;
    this.empty.hidden = scans.length > 0;
    this.body.replaceChildren(...scans.map((scan, i) => this.row(scan, i, scans.length, measurable, loaded === i)));
    if (focused) this.body.querySelector(`[data-key="${focused}"]:not(:disabled)`)?.focus();
  }

  row(scan, i, count, measurable, isLoaded) {
    const row = document.createElement('tr');
    row.classList.toggle('loaded', isLoaded);
    const cell = (text, className = '') => {
      const node = document.createElement('td');
      node.textContent = text;
      node.className = className;
      row.append(node);
      return node;
    };
    cell(`${i + 1}${scan.locked ? ' (locked)' : ''}`);
    cell(`+${scan.new_targets}`);
    cell(scan.covered);
    cell(`${(100 * scan.cumulative / Math.max(1, measurable)).toFixed(1)} %`);
    const words = cell(scan.obstacle || arrangement(scan), scan.obstacle ? 'words wrong' : 'words');
    words.title = words.textContent;
    const actions = cell('', 'actions');
    const button = (text, label, action, to, disabled) => {
      const node = document.createElement('button');
      node.type = 'button';
      node.textContent = text;
      node.setAttribute('aria-label', `${label} scan ${i + 1}`);
      node.title = label;
      node.disabled = disabled;
      node.dataset.key = `${action}-${text}-${i}`;
      node.addEventListener('click', () => this.act(action, i, to));
      actions.append(node);
    };
    button('Load', 'Load into the sliders', 'load', null, false);
    button('↑', 'Move up', 'move', i - 1, i === 0);
    button('↓', 'Move down', 'move', i + 1, i === count - 1);
    button('✕', 'Remove', 'remove', null, false);
    return row;
  }
}
