// SPDX-License-Identifier: Apache-2.0
// A view in three dimensions with z up: renderer, camera, light, and turning by pointer and keys. Reports, the
// explorer and the page of the planning service derive their views from it. It draws only when something changed.
import {DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Spherical, Vector3, WebGLRenderer} from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';

export const FIELD_OF_VIEW_DEG = 32;
export const FROM_OUTSIDE = new Vector3(-0.75, -1.25, 0.95);
// One press of an arrow key turns by this angle, one of plus or minus zooms by this factor.
const KEY_TURN_RAD = 0.12, KEY_ZOOM = 0.9;
const KEY_TURNS = {
  ArrowLeft: [-KEY_TURN_RAD, 0], ArrowRight: [KEY_TURN_RAD, 0], ArrowUp: [0, -KEY_TURN_RAD], ArrowDown: [0, KEY_TURN_RAD],
};
const KEY_ZOOMS = {'+': KEY_ZOOM, '=': KEY_ZOOM, '-': 1 / KEY_ZOOM};

export class Stage {
  /** Fills `container`. Throws if there is no WebGL; nothing has changed then. */
  constructor(canvas, container = canvas.parentElement) {
    this.renderer = new WebGLRenderer({canvas, antialias: true, alpha: true});
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.canvas = canvas;
    this.container = container;
    if (!canvas.parentElement) container.append(canvas);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.001, 50);
    this.camera.up.set(0, 0, 1);
    const light = new DirectionalLight(0xffffff, 2.1);
    light.position.set(-0.5, 0.9, 0.8);
    this.camera.add(light);
    this.scene.add(this.camera, new HemisphereLight(0xffffff, 0x8a8f96, 1.5));
    this.controls = new OrbitControls(this.camera, canvas);
    // A finger that moves up or down scrolls the page.
    canvas.style.touchAction = 'pan-y';
    this.controls.addEventListener('change', () => this.draw());
    this.controls.addEventListener('start', () => this.beforeTurning());
    canvas.addEventListener('keydown', (event) => this.turnByKey(event));
    new ResizeObserver(() => this.resize()).observe(container);
  }

  /** For derived views: what happens before the reader turns the view, and what the Home key does. */
  beforeTurning() {}
  home() {}
  /** For derived views: after a change of size, and after every drawing. */
  resized() {}
  drawn() {}

  turnByKey(event) {
    const turn = KEY_TURNS[event.key], zoom = KEY_ZOOMS[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === 'Home') {
      this.home();
    } else if (turn || zoom) {
      this.beforeTurning();
      // Spherical counts from the y axis; here z is up.
      const {target} = this.controls;
      const offset = this.camera.position.clone().sub(target);
      const spherical = new Spherical().setFromCartesianCoords(offset.y, offset.z, offset.x);
      spherical.theta += turn?.[0] ?? 0;
      spherical.phi = Math.min(Math.PI - 0.05, Math.max(0.05, spherical.phi + (turn?.[1] ?? 0)));
      spherical.radius *= zoom ?? 1;
      const moved = new Vector3().setFromSpherical(spherical);
      this.camera.position.set(target.x + moved.z, target.y + moved.x, target.z + moved.y);
      this.controls.update();
      this.draw();
    } else {
      return;
    }
    event.preventDefault();
  }

  /** Shows a ball; from `direction` if given. */
  lookAt(centre, radius, direction = FROM_OUTSIDE) {
    const halfAngle = Math.PI / 180 * 0.5 * this.camera.fov;
    const distance = 1.04 * radius / Math.sin(Math.min(halfAngle, Math.atan(Math.tan(halfAngle) * this.camera.aspect)));
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(direction.clone().normalize(), distance);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.container;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.resized();
    this.drawNow();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    this.waiting = false;
    this.renderer.render(this.scene, this.camera);
    this.drawn();
  }
}
