// SPDX-License-Identifier: Apache-2.0
// Controls of the view in three dimensions, and tables and charts that steer it.
import {Color, Vector3} from 'three';
import {dominatingParts, firstScans, hasBit, readScene} from './data.js';
import {grouped, legendLine, swatch} from './legend.js';
import {COVERED, LATER, NEVER, NEW, PartScene, UNMEASURABLE} from './scene.js';
import {CLASS_STATES, lengthText, LogScale, PART_STATES, SCALE_STATES} from './uncertainty.js';

const $ = (selector) => document.querySelector(selector);
const all = (selector) => [...document.querySelectorAll(selector)];
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const STATES = [
  [COVERED, '--covered', 'measured'],
  [NEW, '--new', 'new with this scan'],
  [LATER, '--later', 'measured by a later scan'],
  [NEVER, '--never', 'not measured'],
  [UNMEASURABLE, '--unmeasurable', 'not measurable'],
];

// States of targets by what is coloured; all others colour by what is measured.
const DEPTH_STATES = [[0, null, 'measured'], [3, '--not-measured', 'not measured'], [UNMEASURABLE, '--not-measurable', 'not measurable']];
const STATES_OF = {class: CLASS_STATES, dominant: PART_STATES, u: SCALE_STATES, sensitivity: SCALE_STATES, depth: DEPTH_STATES};

// Well apart for neighbours in number: the hue turns by the golden angle.
const scanColour = (number) => new Color().setStyle(
    `hsl(${Math.round(190 + 137.508 * (number - 1)) % 360}, 52%, ${number % 2 ? 54 : 64}%)`, '');

// Meaning of the colours where one scan is shown alone.
const OF_SCAN_ALONE = {[COVERED]: 'measured before, too', [NEW]: 'new with this scan', [LATER]: 'not by this scan'};

const STEERING = 'tr[data-scan], tr[data-region], tr[data-feature], circle[data-scan]';

class Viewer {
  constructor(scene, data) {
    this.scene = scene;
    this.data = data;
    this.first = firstScans(data);
    this.count = data.scans.length;
    this.shown = STATES.map(() => true);
    this.scan = this.count;
    this.colour = 'state';
    this.connect();
    if (data.reasons?.kinds.length) this.connectReasons();
    this.connectSurroundings();
    if (data.uncertainty) this.connectUncertainty();
    if (data.depthPerPixel?.some((depth) => depth > 0)) {
      $('#depth-colour').hidden = false;
      this.depthScale = new LogScale([...data.depthPerPixel]);
    }
    this.applyPalette();
    this.selectScan(this.count);
    scene.onViewChange = (aspect) => {
      const frame = $('#frame');
      frame.hidden = aspect === null;
      if (aspect !== null) frame.style.aspectRatio = aspect;
    };
    scene.view('part');
  }

  connect() {
    document.body.classList.toggle('no-scans', this.count === 0);
    for (const button of all('[data-view]')) {
      if (this.count === 0) button.hidden = button.dataset.view !== 'part';
      button.addEventListener('click', () => {
        if (button.dataset.view !== 'part') this.useRig();
        this.clearRegion();
        this.scene.view(button.dataset.view);
      });
    }
    const slider = $('#scan');
    slider.max = this.count;
    slider.min = Math.min(1, this.count);
    slider.addEventListener('input', () => this.selectScan(Number(slider.value)));
    $('#stage').addEventListener('input', () => {
      this.stop();
      this.useRig();
    });
    $('#play').addEventListener('click', () => {
      this.useRig();
      if (this.playing) this.stop();
      else this.play();
    });
    $('#region-clear').addEventListener('click', () => this.clearRegion());
    $('#show-rig').addEventListener('change', () => this.moveStage());
    $('#show-edges').addEventListener('change', (event) => {
      this.scene.edges.visible = event.target.checked;
      this.scene.draw();
    });
    $('#show-targets').addEventListener('change', (event) => {
      this.scene.points.visible = event.target.checked;
      this.scene.draw();
    });
    for (const radio of all('input[name=colour]')) {
      radio.addEventListener('change', () => {
        this.clearRegion();
        this.setColour(radio.value);
        this.recolour();
      });
    }
    // Rows and dots of the whole page steer the view, also those that are drawn later.
    document.addEventListener('click', (event) => {
      const chosen = event.target.closest?.(STEERING);
      if (chosen && !event.target.closest('a, button')) this.choose(chosen);
    });
    document.addEventListener('keydown', (event) => {
      if ((event.key !== 'Enter' && event.key !== ' ') || !event.target.matches?.(STEERING)) return;
      event.preventDefault();
      this.choose(event.target);
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.applyPalette();
      this.recolour();
    });
  }

  /** Shows what a row of a table or a dot of a chart is about. */
  choose(chosen) {
    const {scan, region, feature} = chosen.dataset;
    if (region !== undefined) this.focusRegion(Number(region));
    else if (feature !== undefined) this.focusFeature(Number(feature));
    else {
      this.clearRegion();
      this.selectScan(Number(scan));
      this.useRig();
      this.scene.view('scan');
    }
    if (chosen.matches('tr')) this.reveal();
  }

  reveal() {
    $('#view').scrollIntoView({behavior: 'smooth', block: 'start'});
  }

  /** Controls of plans for uncertainty; starts with what such a plan is about. */
  connectUncertainty() {
    const {uncertainty} = this.data;
    $('#uncertainty-colours').hidden = false;
    $('#sensitivity-colours').hidden = !uncertainty.sensitivities.some((map) => map);
    this.parts = dominatingParts(uncertainty);
    // One scale for the total and its parts, so that they can be compared. What no scan measures
    // keeps its prior, far beyond the rest: it has the colour of the upper end.
    const measured = (values, least) => [...values].filter((v, i) => this.first[i] > 0 && v > least * uncertainty.total[i]);
    this.scale = new LogScale(['total', 'noise', 'sampling', 'calibration', 'registration'].flatMap(
      (part) => measured(uncertainty[part] ?? [], 0.05)));
    if (!uncertainty.registration) $('#u-part').querySelector('[value=registration]').remove();
    const maps = uncertainty.sensitivities.filter((map) => map);
    this.sensitivityScale = new LogScale(maps.flatMap((map) => [...map.detection, ...(map.calibration ?? [])]));
    if (!maps.some((map) => map.calibration)) $('#s-part').querySelector('[value=calibration]').remove();
    for (const [select, value] of [['#u-part', 'u'], ['#s-part', 'sensitivity']]) {
      $(select).addEventListener('change', () => {
        this.clearRegion();
        this.setColour(value);
        this.recolour();
      });
    }
    this.scene.onPick = (target) => {
      $('#point-read').textContent = target === null ? '' : this.describe(target);
    };
    this.setColour('class');
  }

  /** The uncertainty of a target in words. */
  describe(i) {
    const u = this.data.uncertainty;
    if (u.classes[i] === 4) return 'not measurable';
    const admissible = u.admissible[i] > 0 ? `, admissible ${lengthText(u.admissible[i])}` : '';
    return `u ${lengthText(u.total[i])}${admissible}: noise ${lengthText(u.noise[i])}, sampling ${lengthText(u.sampling[i])}, calibration ${lengthText(u.calibration[i])}` +
      (u.registration ? `, registration ${lengthText(u.registration[i])}` : '');
  }

  /** Colours by why targets are not measured. */
  connectReasons() {
    $('#reason-colours').hidden = false;
    this.shownReasons = this.data.reasons.kinds.map(() => true);
  }

  /** Boxes that show and hide obstacles and regions of interest. */
  connectSurroundings() {
    const list = $('#surroundings');
    const add = (name, object, shown) => {
      const label = document.createElement('label');
      const box = document.createElement('input');
      box.type = 'checkbox';
      box.checked = object.visible = shown;
      box.addEventListener('change', () => {
        object.visible = box.checked;
        this.scene.draw();
      });
      label.append(box, document.createTextNode(name));
      list.append(label);
    };
    this.scene.obstacles.forEach((obstacle) => {
      if (obstacle.drawable) add(obstacle.data.name, obstacle.group, true);
      else obstacle.group.visible = false;
    });
    this.data.regionsOfInterest.forEach((region, i) => add(`region ${region.name ?? ''}`, this.scene.regionBoxes[i], false));
  }

  setColour(colour) {
    this.colour = colour;
    $(`input[name=colour][value=${colour}]`).checked = true;
    this.shown = STATES.map(() => true);
    this.applyPalette();
  }

  applyPalette() {
    const states = STATES_OF[this.colour] ?? STATES;
    const names = Array(STATES.length).fill('--unmeasurable');
    for (const [state, name] of states) names[state] = name ?? '--later';
    this.scene.setPalette(names.map(css), css('--edge'), css('--edge-ghost'));
  }

  /** Scans 1 to `number` are done; the scanner of `number` is drawn. */
  selectScan(number) {
    this.scan = number;
    $('#scan').value = number;
    for (const row of all('tr[data-scan], circle[data-scan]')) {
      row.classList.toggle('selected', Number(row.dataset.scan) === number);
    }
    this.scene.setScan(number > 0 ? number - 1 : null);
    this.recolour();
    this.moveStage();
  }

  /** Draws the colour of each target and the numbers beside it. */
  recolour() {
    if (this.colour === 'reason') this.recolourReasons();
    else if (this.colour === 'depth') this.recolourDepth();
    else if (STATES_OF[this.colour]) this.recolourUncertainty();
    else this.recolourCoverage();
  }

  /** Depth per pixel by the best scan of the whole plan. */
  recolourDepth() {
    const {depthPerPixel, targets: {measurable}} = this.data;
    const counts = STATES.map(() => 0);
    const states = Uint8Array.from(depthPerPixel, (depth, i) => {
      const state = depth > 0 ? 0 : hasBit(measurable, i) ? 3 : UNMEASURABLE;
      ++counts[state];
      return state;
    });
    const tints = Array.from(states, (state, i) =>
      (state === 0 ? this.depthScale.colour(depthPerPixel[i]) : this.scene.palette[state]));
    const legend = $('#legend');
    legend.replaceChildren(this.depthScale.legend([]));
    for (const [state, name, text] of DEPTH_STATES) {
      if (counts[state] > 0 && state !== 0) legend.append(this.legendEntry(state, `var(${name})`, text, counts[state]));
    }
    this.scene.setShown(this.shown);
    this.scene.setStates(states, tints);
    $('#scan-output').textContent = this.scan;
    $('#scan-hint').textContent = `What one pixel is worth in depth, by the best of all ${this.count} scans.`;
  }

  recolourUncertainty() {
    const {uncertainty, targets: {measurable}} = this.data;
    const map = this.scan > 0 ? uncertainty.sensitivities[this.scan - 1] : null;
    const values = this.colour === 'u' ? uncertainty[$('#u-part').value] :
      this.colour === 'sensitivity' ? map?.[$('#s-part').value] : null;
    const counts = STATES.map(() => 0);
    const states = Uint8Array.from(uncertainty.classes, (kind, i) => {
      let state = UNMEASURABLE;
      if (hasBit(measurable, i)) {
        if (this.colour === 'class') state = kind;
        else if (this.colour === 'dominant') state = this.first[i] === 0 ? 3 : this.parts[i];
        else if (this.colour === 'u') state = 0;
        else state = values?.[i] > 0 ? 0 : 3;
      }
      ++counts[state];
      return state;
    });
    let tints = null, scale = null;
    if (this.colour === 'u' || this.colour === 'sensitivity') {
      scale = this.colour === 'u' ? this.scale : this.sensitivityScale;
      tints = Array.from(states, (state, i) => (state === 0 ? scale.colour(values[i]) : this.scene.palette[state]));
    }
    this.showUncertaintyLegend(counts, scale);
    this.scene.setShown(this.shown);
    let drawn = states;
    if (this.region) {
      // Targets beside the feature take a state that is hidden and that the feature does not have.
      const inside = new Set([...this.region.targets].map((i) => states[i]));
      const outside = [4, 3, 2, 1, 0].find((state) => !inside.has(state)) ?? UNMEASURABLE;
      this.scene.setShown(STATES.map((_, state) => state !== outside));
      drawn = states.map((state, i) => (this.region.targets.has(i) ? state : outside));
    }
    this.scene.setStates(drawn, tints);
    $('#scan-output').textContent = this.scan;
    $('#scan-hint').textContent = this.count === 0 ? '' : this.colour !== 'sensitivity' ?
      `Colours show what is known after all ${this.count} scans. Click on the part to read numbers.` : map ?
      `Scan ${this.scan} alone, single points along the surface normal.` :
      `For scan ${this.scan} nothing is known of single points.`;
  }

  showUncertaintyLegend(counts, scale) {
    const legend = $('#legend');
    legend.replaceChildren();
    if (scale) {
      const {admissible, relaxed} = this.data.uncertainty;
      const marks = [];
      if (this.colour === 'u') {
        const limits = [...admissible].filter((v) => v > 0).sort((a, b) => a - b);
        if (limits.length) marks.push([limits[limits.length >> 1], limits[0] < 0.99 * limits[limits.length - 1] ? 'median admissible' : 'admissible']);
        if (relaxed > 0) marks.push([relaxed, 'relaxed']);
      }
      legend.append(scale.legend(marks));
    }
    for (const [state, name, text] of STATES_OF[this.colour]) {
      if (counts[state] > 0 && !(scale && state === 0)) {
        legend.append(this.legendEntry(state, `var(${name})`, text, counts[state]));
      }
    }
  }

  /** A line of the legend, whose box shows and hides the surface in a state. */
  legendEntry(state, colour, text, count) {
    return legendLine(colour, text, count, this.shown[state], (shown) => {
      this.shown[state] = shown;
      if (this.colour === 'first' && state === COVERED) this.shown[NEW] = shown;
      this.recolour();
    });
  }

  recolourReasons() {
    const {kinds, ofTarget} = this.data.reasons;
    const colours = kinds.map(({reason}) => new Color().setStyle(css(`--reason-${reason}`), ''));
    const plain = new Color().setStyle(css('--plain'), '');
    // Hidden targets take a state of their own.
    const states = Uint8Array.from(ofTarget, (kind) =>
      (kind === 0 ? COVERED : this.shownReasons[kind - 1] ? NEVER : LATER));
    const tints = Array.from(ofTarget, (kind) => (kind === 0 ? plain : colours[kind - 1]));
    const legend = $('#legend');
    legend.replaceChildren();
    let uncovered = 0;
    kinds.forEach(({reason, text, targets = 0}, i) => {
      uncovered += targets;
      legend.append(legendLine(`var(--reason-${reason})`, text, targets, this.shownReasons[i], (shown) => {
        this.shownReasons[i] = shown;
        this.recolour();
      }));
    });
    legend.append(this.legendEntry(COVERED, 'var(--plain)', 'measured', ofTarget.length - uncovered));
    this.scene.setShown(STATES.map(([state]) => state !== LATER && this.shown[state]));
    this.scene.setStates(states, tints);
    $('#scan-output').textContent = this.scan;
    $('#scan-hint').textContent = this.count === 0 ? '' :
      'Colours show why places are not measured by the plan.';
  }

  recolourCoverage() {
    const {measurable} = this.data.targets;
    const alone = this.colour === 'alone';
    const states = new Uint8Array(this.first.length);
    const counts = STATES.map(() => 0);
    const perScan = new Array(this.count + 1).fill(0);
    const covered = this.scan > 0 ? this.data.scans[this.scan - 1].covered : null;
    for (let i = 0; i < states.length; ++i) {
      const first = this.first[i];
      let state = UNMEASURABLE;
      if (hasBit(measurable, i)) {
        if (alone) state = hasBit(covered, i) ? (first === this.scan ? NEW : COVERED) : LATER;
        else if (first === 0) state = NEVER;
        else if (first > this.scan) state = LATER;
        else state = first === this.scan ? NEW : COVERED;
        ++perScan[first];
      }
      states[i] = state;
      ++counts[state];
    }
    let tints = null;
    if (this.colour === 'first') {
      const colours = [...Array(this.count + 1).keys()].map((n) => (n ? scanColour(n) : null));
      tints = Array.from(states, (state, i) =>
        (state === COVERED || state === NEW ? colours[this.first[i]] : this.scene.palette[state]));
    }
    const total = counts.reduce((a, b) => a + b, 0) - counts[UNMEASURABLE];
    this.showLegend(counts, perScan);
    this.scene.setShown(this.shown);
    // Unmeasured targets are drawn in the region being looked at alone.
    const drawn = this.region ?
      states.map((state, i) => (state === NEVER && !this.region.targets.has(i) ? UNMEASURABLE : state)) : states;
    this.scene.setStates(drawn, tints);
    const done = counts[COVERED] + counts[NEW];
    const percent = (n) => (total ? (100 * n / total).toFixed(1) : '0.0') + '\u202f%';
    $('#scan-output').textContent = this.scan;
    $('#scan-hint').textContent = this.count === 0 ? '' : alone ?
      `Scan ${this.scan} alone measures ${grouped(done)} targets, ${percent(done)}.` :
      `${grouped(done)} targets measured, ${percent(done)}; scan ${this.scan} adds ${grouped(counts[NEW])}, ${percent(counts[NEW])}.`;
  }

  showLegend(counts, perScan) {
    const legend = $('#legend');
    legend.replaceChildren();
    const words = this.colour === 'alone' ? OF_SCAN_ALONE : {};
    for (const [state, colour, text] of STATES) {
      if (this.colour === 'first' && state === NEW) continue;
      if (this.colour === 'alone' && state === NEVER) continue;
      if (counts[state] === 0 && state !== NEVER) continue;
      const sum = this.colour === 'first' && state === COVERED ? counts[COVERED] + counts[NEW] : counts[state];
      legend.append(this.legendEntry(state, `var(${colour})`, words[state] ?? text, sum));
    }
    if (this.colour !== 'first') return;
    const grid = document.createElement('div');
    grid.className = 'of-scans';
    for (let n = 1; n <= this.scan; ++n) {
      const label = document.createElement('label');
      label.title = `scan ${n}: ${perScan[n]} targets measured first`;
      label.append(swatch('#' + scanColour(n).getHexString('')), String(n));
      grid.append(label);
    }
    legend.append(grid);
  }

  moveStage() {
    if (this.scan === 0) return;
    this.scene.showRig($('#show-rig').checked);
    const fraction = Number($('#stage').value) / 1000;
    const scan = this.data.scans[this.scan - 1];
    const stage = scan.stage_start_m + fraction * (scan.stage_end_m - scan.stage_start_m);
    $('#stage-output').textContent = (1000 * stage).toFixed(0).replace('-', '\u2212') + ' mm';
    this.scene.setStage(fraction);
  }

  play() {
    const slider = $('#stage');
    if (Number(slider.value) >= 1000) slider.value = 0;
    this.playing = true;
    $('#play').textContent = '❚❚';
    const scan = this.data.scans[this.scan - 1];
    const perMillisecond = 1000 / Math.max(2000, 12000 * (scan.stage_end_m - scan.stage_start_m));
    let last = performance.now();
    let value = Number(slider.value);
    const step = (now) => {
      if (!this.playing) return;
      value = Math.min(1000, value + (now - last) * perMillisecond);
      last = now;
      slider.value = value;
      this.moveStage();
      if (value >= 1000) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    this.playing = false;
    $('#play').textContent = '▶';
  }

  /** The scanner is drawn from now on. */
  useRig() {
    $('#show-rig').checked = true;
    this.moveStage();
  }

  /** Looks at an unmeasured region; everything else is faint. */
  focusRegion(index) {
    const region = this.data.regions[index];
    this.region = region;
    for (const row of all('tr[data-region]')) {
      row.classList.toggle('selected', Number(row.dataset.region) === index);
    }
    for (const row of all('tr[data-feature]')) row.classList.remove('selected');
    $('#show-rig').checked = false;
    this.setColour('state');
    this.shown = STATES.map(([state]) => state === NEVER);
    this.selectScan(this.count);
    this.frameRegion(region, `unmeasured region ${index + 1}`);
  }

  /** Looks at a toleranced feature; everything else is faint. */
  focusFeature(index) {
    const feature = this.data.uncertainty?.features[index];
    if (!feature) return;
    this.region = feature;
    for (const row of all('tr[data-region], tr[data-feature]')) {
      row.classList.toggle('selected', Number(row.dataset.feature ?? -1) === index);
    }
    $('#show-rig').checked = false;
    if (!STATES_OF[this.colour] || this.colour === 'depth') this.setColour('class');
    this.selectScan(this.count);
    this.frameRegion(feature, feature.name);
  }

  frameRegion(region, name) {
    $('#region-chip').hidden = false;
    $('#region-name').textContent = name;
    const min = new Vector3(...region.min_m), max = new Vector3(...region.max_m);
    const normal = new Vector3(...region.normal);
    const direction = normal.length() > 0.4 ? normal.normalize().add(new Vector3(-0.2, -0.35, 0.3)) : undefined;
    this.scene.outline(region);
    this.scene.lookAt(min.clone().add(max).multiplyScalar(0.5),
                      Math.max(0.9 * min.distanceTo(max), 0.2 * this.scene.radius), direction);
  }

  clearRegion() {
    if ($('#region-chip').hidden) return;
    $('#region-chip').hidden = true;
    this.region = null;
    for (const row of all('tr[data-region], tr[data-feature]')) row.classList.remove('selected');
    this.shown = STATES.map(() => true);
    this.scene.outline(null);
    this.recolour();
  }
}

const hasWebGl = () => Boolean(document.createElement('canvas').getContext('webgl2'));

/** Rows that steer the view do nothing without it. */
function showFallback(reason) {
  $('#viewer').hidden = true;
  $('#fallback').hidden = false;
  $('#fallback-notice').textContent = reason;
  for (const row of all('tr.selectable')) {
    row.classList.remove('selectable');
    row.removeAttribute('tabindex');
  }
}

function start(raw) {
  try {
    const data = readScene(raw);
    $('#viewer').hidden = false;
    new Viewer(new PartScene($('#canvas'), data), data);
    $('#fallback').hidden = true;
  } catch (error) {
    showFallback(`The interactive view could not start: ${error.message}`);
  }
}

/** Shows the scene of a report in the copy of scene.html that stands in the page, once texts and tables are drawn. */
function showScene(raw) {
  if (raw.picture_png) {
    $('#fallback-picture').src = `data:image/png;base64,${raw.picture_png}`;
    $('#fallback-picture').hidden = false;
  }
  if (!hasWebGl()) {
    showFallback('The interactive view needs WebGL, which is not available here.');
    return;
  }
  requestAnimationFrame(() => setTimeout(() => start(raw)));
}

globalThis.sightlineShowScene = showScene;
