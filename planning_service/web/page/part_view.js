// SPDX-License-Identifier: Apache-2.0
// The part in three dimensions with the lengths of its bounding box. Axes of the file, z up.
import {
  BoxGeometry, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, EdgesGeometry, HemisphereLight,
  LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, PerspectiveCamera, Scene, Spherical, Vector3, WebGLRenderer,
} from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
import {roundedText} from './units.js';

const AXES = ['x', 'y', 'z'];

export class PartView {
  // Throws where there is no WebGL.
  constructor(stage) {
    this.stage = stage;
    this.renderer = new WebGLRenderer({antialias: true, alpha: true});
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    stage.append(this.canvas);
    this.labels = AXES.map((axis) => {
      const label = document.createElement('span');
      label.className = `dimension ${axis}`;
      label.hidden = true;
      stage.append(label);
      return label;
    });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(32, 1, 0.1, 100);
    this.camera.up.set(0, 0, 1);
    this.light = new DirectionalLight(0xffffff, 2.1);
    this.camera.add(this.light);
    this.light.position.set(-0.5, 0.9, 0.8);
    this.scene.add(this.camera, new HemisphereLight(0xffffff, 0x8a8f96, 1.5));
    this.controls = new OrbitControls(this.camera, this.canvas);
    // Up and down scroll the page on a phone.
    this.canvas.style.touchAction = 'pan-y';
    this.controls.addEventListener('change', () => this.draw());
    this.canvas.addEventListener('keydown', (event) => this.turnByKey(event));
    this.dark = matchMedia('(prefers-color-scheme: dark)');
    this.dark.addEventListener('change', () => { this.recolour(); this.draw(); });
    this.material = new MeshLambertMaterial({side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1});
    this.edgeMaterial = new LineBasicMaterial({transparent: true, opacity: 0.55});
    this.boxMaterial = new LineBasicMaterial({transparent: true, opacity: 0.9});
    this.recolour();
    new ResizeObserver(() => this.resize()).observe(stage);
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
    this.lookFromOutside();
  }

  lookFromOutside() {
    const across = Math.min(this.camera.aspect, 1);
    const distance = 1.12 * this.radius / Math.sin(Math.atan(across * Math.tan(this.camera.fov * Math.PI / 360)));
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0.55, -0.75, 0.5).normalize().multiplyScalar(distance);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  // Lengths at the box; null: the unit is not known yet.
  setMetresPerUnit(metres) {
    this.metresPerUnit = metres;
    this.draw();
  }

  turnByKey(event) {
    const step = 0.12;
    const turns = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step]};
    const zooms = {'+': 0.9, '=': 0.9, '-': 1 / 0.9};
    if (event.key === 'Home') {
      this.lookFromOutside();
    } else if (turns[event.key] || zooms[event.key]) {
      // Spherical counts from the y axis; here z is up.
      const at = this.camera.position;
      const spherical = new Spherical().setFromCartesianCoords(at.y, at.z, at.x);
      spherical.theta += turns[event.key]?.[0] ?? 0;
      spherical.phi = Math.min(Math.PI - 0.05, Math.max(0.05, spherical.phi + (turns[event.key]?.[1] ?? 0)));
      spherical.radius *= zooms[event.key] ?? 1;
      const moved = new Vector3().setFromSpherical(spherical);
      at.set(moved.z, moved.x, moved.y);
      this.controls.update();
    } else {
      return;
    }
    event.preventDefault();
    this.draw();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.stage;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.renderer.render(this.scene, this.camera);
      this.placeLabels();
    });
  }

  placeLabels() {
    const {part, metresPerUnit, stage} = this;
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
      const push = 20 / Math.max(1, Math.hypot(best.p.x * stage.clientWidth, best.p.y * stage.clientHeight) / 2);
      const x = (0.5 + 0.5 * best.p.x * (1 + push)) * stage.clientWidth;
      const y = (0.5 - 0.5 * best.p.y * (1 + push)) * stage.clientHeight;
      const w = 0.5 * label.offsetWidth + 4, height = 0.5 * label.offsetHeight + 4;
      const inside = (value, margin, length) => Math.min(Math.max(value, margin), length - margin);
      label.style.left = `${Math.round(inside(x, w, stage.clientWidth))}px`;
      label.style.top = `${Math.round(inside(y, height, stage.clientHeight))}px`;
    });
  }
}
