// SPDX-License-Identifier: Apache-2.0
// The part in three dimensions with the lengths of its bounding box. Axes of the file, z up.
import {BoxGeometry, BufferAttribute, BufferGeometry, Color, DoubleSide, EdgesGeometry, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, Vector3} from 'three';
import {Stage} from '../../../report/viewer/stage.js';
import {roundedText} from './units.js';

const AXES = ['x', 'y', 'z'];
const FROM_ABOVE = new Vector3(0.55, -0.75, 0.5);
// Room for the labels around the part.
const ROOM = 1.08;

export class PartView extends Stage {
  // Throws where there is no WebGL.
  constructor(container) {
    super(document.createElement('canvas'), container);
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.labels = AXES.map((axis) => {
      const label = document.createElement('span');
      label.className = `dimension ${axis}`;
      label.hidden = true;
      container.append(label);
      return label;
    });
    this.dark = matchMedia('(prefers-color-scheme: dark)');
    this.dark.addEventListener('change', () => { this.recolour(); this.draw(); });
    this.material = new MeshLambertMaterial({side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1});
    this.edgeMaterial = new LineBasicMaterial({transparent: true, opacity: 0.55});
    this.boxMaterial = new LineBasicMaterial({transparent: true, opacity: 0.9});
    this.recolour();
    this.resize();
  }

  recolour() {
    this.material.color = new Color(this.dark.matches ? 0x9aa7b0 : 0xc3ccd2);
    this.edgeMaterial.color = new Color(this.dark.matches ? 0x0b0d0f : 0x2b3138);
    this.boxMaterial.color = new Color(this.dark.matches ? 0x5cc8ba : 0x0f766e);
  }

  clear() {
    for (const object of this.objects ?? []) {
      this.scene.remove(object);
      object.geometry.dispose();
    }
    this.objects = [];
    this.part = null;
    for (const label of this.labels) label.hidden = true;
    this.draw();
  }

  // `part` as the worker reads it.
  show(part) {
    this.clear();
    this.part = part;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(part.positions, 3));
    if (part.normals) geometry.setAttribute('normal', new BufferAttribute(part.normals, 3));
    this.material.flatShading = !part.normals;
    this.material.needsUpdate = true;
    const centre = part.min.map((min, axis) => min + 0.5 * part.size[axis]);
    this.objects.push(new Mesh(geometry, this.material));
    if (part.edges) {
      const edges = new BufferGeometry();
      edges.setAttribute('position', new BufferAttribute(part.edges, 3));
      this.objects.push(new LineSegments(edges, this.edgeMaterial));
    }
    for (const object of this.objects) object.geometry.translate(-centre[0], -centre[1], -centre[2]);
    const box = new BoxGeometry(...part.size);
    this.objects.push(new LineSegments(new EdgesGeometry(box), this.boxMaterial));
    box.dispose();
    this.scene.add(...this.objects);
    this.radius = 0.5 * Math.hypot(...part.size) || 1;
    this.camera.near = this.radius / 100;
    this.camera.far = this.radius * 100;
    this.controls.minDistance = this.radius * 0.2;
    this.controls.maxDistance = this.radius * 20;
    this.home();
  }

  home() {
    if (this.part) this.lookAt(new Vector3(), ROOM * this.radius, FROM_ABOVE);
  }

  // Lengths at the box; null: the unit is not known yet.
  setMetresPerUnit(metres) {
    this.metresPerUnit = metres;
    this.draw();
  }

  drawn() {
    this.placeLabels();
  }

  placeLabels() {
    const {part, metresPerUnit, container} = this;
    const isShown = Boolean(part && metresPerUnit);
    this.labels.forEach((label) => { label.hidden = !isShown; });
    if (!isShown) return;
    const half = part.size.map((size) => 0.5 * size);
    const placed = [];
    this.labels.forEach((label, axis) => {
      // Among the four parallel edges this takes the one drawn farthest from the middle, rather
      // below it. Upright edges are taken at the side, away from the other two.
      let best = null;
      for (const [a, b] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        const middle = [0, 0, 0];
        middle[(axis + 1) % 3] = a * half[(axis + 1) % 3];
        middle[(axis + 2) % 3] = b * half[(axis + 2) % 3];
        const p = new Vector3(...middle).project(this.camera);
        const clearance = Math.min(...placed.map((other) => Math.hypot(p.x - other.x, p.y - other.y)));
        const rank = axis === 2 ? Math.abs(p.x) + 0.6 * clearance : Math.hypot(p.x, p.y) - 0.6 * p.y;
        if (!best || rank > best.rank) best = {rank, p};
      }
      placed.push(best.p);
      label.textContent = `${AXES[axis]} ${roundedText(1e3 * metresPerUnit * part.size[axis])} mm`;
      const push = 20 / Math.max(1, Math.hypot(best.p.x * container.clientWidth, best.p.y * container.clientHeight) / 2);
      const x = (0.5 + 0.5 * best.p.x * (1 + push)) * container.clientWidth;
      const y = (0.5 - 0.5 * best.p.y * (1 + push)) * container.clientHeight;
      const w = 0.5 * label.offsetWidth + 4, height = 0.5 * label.offsetHeight + 4;
      const inside = (value, margin, length) => Math.min(Math.max(value, margin), length - margin);
      label.style.left = `${Math.round(inside(x, w, container.clientWidth))}px`;
      label.style.top = `${Math.round(inside(y, height, container.clientHeight))}px`;
    });
  }
}
