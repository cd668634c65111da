// SPDX-License-Identifier: Apache-2.0
// The part, the scanner and the laser line in three.js; coordinates of the CAD part, metres, z up.
import {
  Box3, Box3Helper, BoxGeometry, BufferAttribute, BufferGeometry, Color, CylinderGeometry, DataTexture, DoubleSide,
  EdgesGeometry, FloatType, Group, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, NearestFilter,
  Points, Quaternion, Raycaster, RedFormat, ShaderMaterial, SphereGeometry, Vector2, Vector3,
} from 'three';
import {FIELD_OF_VIEW_DEG, FROM_OUTSIDE, Stage} from './stage.js';
import {Obstacle, regionBox} from './surroundings.js';

// States of a target. Weights of the first four go to the GPU; the rest is unmeasurable.
export const COVERED = 0, NEW = 1, LATER = 2, NEVER = 3, UNMEASURABLE = 4;

const SHADOW_BINS = 2048;

const partVertexShader = `
attribute vec4 weights;
attribute vec3 tint;
varying vec3 vPosition, vNormal, vViewNormal, vTint;
varying vec4 vWeights;
void main() {
  vPosition = position;
  vNormal = normal;
  vViewNormal = normalMatrix * normal;
  vWeights = weights;
  vTint = tint;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const partFragmentShader = `
precision highp float;
uniform vec3 colours[5];
uniform float shown[5];
uniform bool useTint, ghost, laserOn;
uniform float opacity;
uniform vec3 laserOrigin, laserX, laserY, laserZ;
uniform float halfFan;
uniform sampler2D shadow;
varying vec3 vPosition, vNormal, vViewNormal, vTint;
varying vec4 vWeights;
void main() {
  vec3 n = normalize(vViewNormal) * (gl_FrontFacing ? 1.0 : -1.0);
  float shade = 0.58 + 0.28 * max(n.z, 0.0) + 0.24 * max(dot(n, normalize(vec3(-0.3, 0.9, 0.35))), 0.0);
  if (ghost) {
    gl_FragColor = vec4(vec3(0.5) * shade, opacity * (1.2 - n.z));
    return;
  }
  // Sharpened weights: colours change over a short distance between targets, not all the way.
  float w[5];
  w[0] = vWeights.x; w[1] = vWeights.y; w[2] = vWeights.z; w[3] = vWeights.w;
  w[4] = max(0.0, 1.0 - w[0] - w[1] - w[2] - w[3]);
  float sum = 0.0, visible = 0.0;
  vec3 colour = vec3(0.0);
  for (int i = 0; i < 5; ++i) {
    float p = pow(w[i], 6.0);
    sum += p; visible += p * shown[i]; colour += p * colours[i];
  }
  if (visible < 0.5 * sum) discard;
  colour = useTint ? vTint : colour / sum;
  if (!gl_FrontFacing) colour = mix(colour, vec3(0.45), 0.35);
  colour *= shade;
  if (laserOn) {
    vec3 d = vPosition - laserOrigin;
    float height = dot(d, laserY);
    float width = 1.3 * length(vec2(dFdx(height), dFdy(height))) + 0.0002;
    vec2 inSheet = vec2(dot(d, laserX), dot(d, laserZ));
    float angle = atan(inSheet.x, inSheet.y);
    if (abs(height) < 3.0 * width && abs(angle) < halfFan && dot(vNormal, d) < 0.0) {
      float reach = texture2D(shadow, vec2(0.5 + 0.5 * angle / halfFan, 0.5)).r;
      float r = length(inSheet);
      if (r < reach + 0.0008 + 0.004 * r) {
        float glow = exp(-height * height / (width * width));
        colour = mix(colour, vec3(1.0, 0.12, 0.1), glow);
      }
    }
  }
  gl_FragColor = vec4(colour, 1.0);
}`;

function sensorMatrix(rowMajor, direction, travel) {
  const m = new Matrix4().set(...rowMajor);
  m.elements[12] += travel * direction[0];
  m.elements[13] += travel * direction[1];
  m.elements[14] += travel * direction[2];
  return m;
}

function lines(points, material) {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(points.flat()), 3));
  return new LineSegments(geometry, material);
}

// Distance from the laser to the first surface it meets, per angle in its sheet.
class LaserShadow {
  constructor(mesh, halfFan) {
    this.mesh = mesh;
    this.halfFan = halfFan;
    this.reach = new Float32Array(SHADOW_BINS);
    this.height = new Float32Array(mesh.positions.length / 3);
    this.texture = new DataTexture(this.reach, SHADOW_BINS, 1, RedFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
  }

  update(origin, x, y, z) {
    const {positions, triangles} = this.mesh;
    const {height, reach} = this;
    const level = origin.dot(y);
    for (let v = 0, i = 0; v < height.length; ++v, i += 3) {
      height[v] = positions[i] * y.x + positions[i + 1] * y.y + positions[i + 2] * y.z - level;
    }
    reach.fill(1e6);
    const cut = [0, 0, 0, 0];
    for (let t = 0; t < triangles.length; t += 3) {
      const a = triangles[t], b = triangles[t + 1], c = triangles[t + 2];
      const ha = height[a] >= 0, hb = height[b] >= 0, hc = height[c] >= 0;
      if (ha === hb && hb === hc) continue;
      let n = 0;
      if (ha !== hb) n = this.cross(a, b, origin, x, z, cut, n);
      if (hb !== hc) n = this.cross(b, c, origin, x, z, cut, n);
      if (hc !== ha) n = this.cross(c, a, origin, x, z, cut, n);
      this.drawSegment(cut[0], cut[1], cut[2], cut[3]);
    }
    this.texture.needsUpdate = true;
  }

  cross(a, b, origin, x, z, cut, n) {
    const {positions} = this.mesh;
    const t = this.height[a] / (this.height[a] - this.height[b]);
    const px = positions[3 * a] + t * (positions[3 * b] - positions[3 * a]) - origin.x;
    const py = positions[3 * a + 1] + t * (positions[3 * b + 1] - positions[3 * a + 1]) - origin.y;
    const pz = positions[3 * a + 2] + t * (positions[3 * b + 2] - positions[3 * a + 2]) - origin.z;
    cut[n] = px * x.x + py * x.y + pz * x.z;
    cut[n + 1] = px * z.x + py * z.y + pz * z.z;
    return n + 2;
  }

  drawSegment(u0, v0, u1, v1) {
    if (v0 <= 0 && v1 <= 0) return;
    const bin = (u, v) => (0.5 + 0.5 * Math.atan2(u, v) / this.halfFan) * SHADOW_BINS - 0.5;
    let b0 = bin(u0, v0), b1 = bin(u1, v1);
    if (b0 > b1) [b0, b1] = [b1, b0];
    const du = u1 - u0, dv = v1 - v0;
    const last = Math.min(SHADOW_BINS - 1, Math.floor(b1));
    for (let i = Math.max(0, Math.ceil(b0)); i <= last; ++i) {
      const angle = ((i + 0.5) / SHADOW_BINS * 2 - 1) * this.halfFan;
      const s = Math.sin(angle), c = Math.cos(angle);
      const denominator = s * dv - c * du;
      if (denominator === 0) continue;
      const r = (u0 * dv - v0 * du) / denominator;
      if (r > 0 && r < this.reach[i]) this.reach[i] = r;
    }
  }
}

export class PartScene extends Stage {
  /** Throws if there is no WebGL. */
  constructor(canvas, data) {
    super(canvas);
    this.data = data;
    this.min = new Vector3(...data.partMin);
    this.max = new Vector3(...data.partMax);
    this.centre = this.min.clone().add(this.max).multiplyScalar(0.5);
    this.radius = 0.5 * this.min.distanceTo(this.max);
    this.addPart();
    this.addTargets();
    this.rig = new Group();
    this.rig.visible = false;
    this.box = new Box3Helper(new Box3(), 0xe2572b);
    this.box.visible = false;
    this.scene.add(this.rig, this.box);
    this.addSurroundings();
    this.reportClicks();
    this.resize();
    this.view('part');
  }

  /** Tells onPick the target under a click, null beside the part; drags do not count. */
  reportClicks() {
    let down = null;
    this.canvas.addEventListener('pointerdown', (event) => {
      down = [event.clientX, event.clientY];
    });
    this.canvas.addEventListener('click', (event) => {
      if (!this.onPick || !down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
      const {left, top, width, height} = this.canvas.getBoundingClientRect();
      const ray = new Raycaster();
      ray.setFromCamera(new Vector2(2 * (event.clientX - left) / width - 1, 1 - 2 * (event.clientY - top) / height), this.camera);
      const [hit] = ray.intersectObject(this.part, false);
      this.onPick(hit ? this.data.mesh.nearestTarget[hit.face.a] : null);
    });
  }

  addPart() {
    const {mesh} = this.data;
    const count = mesh.positions.length / 3;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(mesh.positions, 3));
    geometry.setAttribute('normal', new BufferAttribute(mesh.normals, 3, true));
    this.weights = new Uint8Array(4 * count);
    this.tints = new Uint8Array(4 * count);
    geometry.setAttribute('weights', new BufferAttribute(this.weights, 4, true));
    geometry.setAttribute('tint', new BufferAttribute(this.tints, 4, true));
    geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
    this.geometry = geometry;

    this.shadow = new LaserShadow(mesh, 0.5 * this.data.rig.fan_angle_rad);
    this.uniforms = {
      colours: {value: Array.from({length: 5}, () => new Color())},
      shown: {value: [1, 1, 1, 1, 1]},
      useTint: {value: false}, ghost: {value: false}, opacity: {value: 1}, laserOn: {value: false},
      laserOrigin: {value: new Vector3()}, laserX: {value: new Vector3()},
      laserY: {value: new Vector3()}, laserZ: {value: new Vector3()},
      halfFan: {value: 0.5 * this.data.rig.fan_angle_rad}, shadow: {value: this.shadow.texture},
    };
    const material = (uniforms, options) => new ShaderMaterial({
      vertexShader: partVertexShader, fragmentShader: partFragmentShader, uniforms,
      side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1, ...options,
    });
    this.part = new Mesh(geometry, material(this.uniforms, {}));
    // Faint outline of the whole part for when some of it is hidden.
    this.ghost = new Mesh(geometry, material(
        {...this.uniforms, ghost: {value: true}, opacity: {value: 0.07}},
        {transparent: true, depthWrite: false}));
    this.ghost.renderOrder = 2;
    this.ghost.visible = false;

    const edges = new BufferGeometry();
    edges.setAttribute('position', new BufferAttribute(mesh.edges, 3));
    this.edges = new LineSegments(edges, new LineBasicMaterial({transparent: true, opacity: 0.35}));
    this.scene.add(this.part, this.ghost, this.edges);
  }

  addTargets() {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(this.data.targets.positions, 3));
    this.targetTints = new Uint8Array(4 * this.data.targets.count);
    geometry.setAttribute('tint', new BufferAttribute(this.targetTints, 4, true));
    this.points = new Points(geometry, new ShaderMaterial({
      uniforms: {size: {value: 0.3 * this.data.targets.spacing}, scale: {value: 1}},
      vertexShader: `
attribute vec4 tint; uniform float size, scale; varying vec4 vTint;
void main() {
  vTint = tint;
  vec4 view = modelViewMatrix * vec4(position, 1.0);
  view.xyz *= 0.997;  // in front of the surface they lie on
  gl_Position = projectionMatrix * view;
  gl_PointSize = max(2.0, size * scale / -view.z);
}`,
      fragmentShader: `
varying vec4 vTint;
void main() {
  float r = length(gl_PointCoord - 0.5);
  if (r > 0.5 || vTint.a < 0.5) discard;
  gl_FragColor = vec4(vTint.rgb * (r > 0.36 ? 0.55 : 1.0), 1.0);
}`,
    }));
    this.points.visible = false;
    this.scene.add(this.points);
  }

  addSurroundings() {
    this.obstacles = this.data.obstacles.map((obstacle) => new Obstacle(obstacle, this.radius));
    this.regionBoxes = this.data.regionsOfInterest.map((region) => regionBox(region, this.radius));
    for (const {group} of this.obstacles) this.scene.add(group);
    for (const box of this.regionBoxes) {
      box.visible = false;
      this.scene.add(box);
    }
    this.placeObstacles(new Vector3());
  }

  placeObstacles(travelled) {
    const scan = this.scan ? this.data.scans.indexOf(this.scan) : null;
    for (const obstacle of this.obstacles) obstacle.place(scan, travelled);
  }

  /** Colours as CSS strings: one per state, of edges, of edges when parts are hidden. */
  setPalette(colours, edge, edgeOfGhost) {
    colours.forEach((colour, i) => {
      // Written to the screen as they are, so without conversion to linear light.
      const c = new Color().setStyle(colour, '');
      this.uniforms.colours.value[i].setRGB(c.r, c.g, c.b, '');
    });
    this.palette = colours.map((colour) => new Color().setStyle(colour, ''));
    this.edgeColours = [edge, edgeOfGhost];
  }

  setShown(shown) {
    this.uniforms.shown.value = shown.map((s) => (s ? 1 : 0));
    this.ghost.visible = shown.some((s) => !s);
    this.edges.material.color.setStyle(this.edgeColours[this.ghost.visible ? 1 : 0]);
  }

  /** states: one per target. tints: a Color per target, or null to colour by state. */
  setStates(states, tints) {
    const nearest = this.data.mesh.nearestTarget;
    this.weights.fill(0);
    for (let v = 0; v < nearest.length; ++v) {
      const state = states[nearest[v]];
      if (state < 4) this.weights[4 * v + state] = 255;
    }
    this.uniforms.useTint.value = tints !== null;
    if (tints) {
      for (let v = 0; v < nearest.length; ++v) this.putTint(this.tints, v, tints[nearest[v]], true);
    }
    const shown = this.uniforms.shown.value;
    for (let i = 0; i < states.length; ++i) {
      this.putTint(this.targetTints, i, tints ? tints[i] : this.palette[states[i]], shown[states[i]]);
    }
    this.geometry.attributes.weights.needsUpdate = true;
    this.geometry.attributes.tint.needsUpdate = true;
    this.points.geometry.attributes.tint.needsUpdate = true;
    this.draw();
  }

  putTint(array, i, colour, visible) {
    array[4 * i] = 255 * colour.r;
    array[4 * i + 1] = 255 * colour.g;
    array[4 * i + 2] = 255 * colour.b;
    array[4 * i + 3] = visible ? 255 : 0;
  }

  /** Builds the scanner of scan `index`; null removes it. */
  setScan(index) {
    for (const child of [...this.rig.children]) {
      this.rig.remove(child);
      child.traverse((object) => {
        object.geometry?.dispose();
        object.material?.dispose();
      });
    }
    this.scan = index === null ? null : this.data.scans[index];
    if (!this.scan) return;
    const {rig} = this.data;
    this.cameraBody = this.sensor(rig.camera_bodies, 0x2f6f9f);
    this.laserBody = this.sensor(rig.laser_bodies, 0xb3372b);

    // Frustum down to the focus distance.
    const depth = this.scan.camera_distance_m;
    const half = Math.tan(0.5 * rig.vertical_fov_rad) * depth;
    const corner = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(
        ([x, y]) => [x * half * rig.aspect, y * half, depth]);
    const frustum = corner.flatMap((c, i) => [[0, 0, 0], c, c, corner[(i + 1) % 4]]);
    this.cameraBody.add(lines(frustum, new LineBasicMaterial(
        {color: 0x3c87bd, transparent: true, opacity: 0.75})));

    const length = this.scan.laser_distance_m + this.radius;
    const a = 0.5 * rig.fan_angle_rad;
    const rim = [];
    for (let i = 0; i <= 32; ++i) {
      const angle = -a + 2 * a * i / 32;
      rim.push([Math.sin(angle) * length, 0, Math.cos(angle) * length]);
    }
    const fan = new BufferGeometry();
    fan.setAttribute('position', new BufferAttribute(new Float32Array(
        rim.slice(1).flatMap((p, i) => [0, 0, 0, ...rim[i], ...p])), 3));
    const sheet = new Mesh(fan, new MeshBasicMaterial(
        {color: 0xe0352b, transparent: true, opacity: 0.12, side: DoubleSide, depthWrite: false}));
    sheet.renderOrder = 3;
    this.fan = new Group();
    this.laserBody.add(this.fan);
    this.fan.add(sheet, lines([[0, 0, 0], rim[0], [0, 0, 0], rim[32]], new LineBasicMaterial(
        {color: 0xe0352b, transparent: true, opacity: 0.6})));

    // The way of camera and laser along the scan.
    const travel = this.scan.stage_end_m - this.scan.stage_start_m;
    const path = (pose) => [0, travel].map((t) => {
      const p = new Vector3().setFromMatrixPosition(sensorMatrix(pose, this.scan.sensor_direction, t));
      return [p.x, p.y, p.z];
    });
    this.rig.add(lines(path(this.scan.camera_pose), new LineBasicMaterial({color: 0x3c87bd})));
    this.rig.add(lines(path(this.scan.laser_pose), new LineBasicMaterial({color: 0xe0352b})));
    this.rig.add(this.cameraBody, this.laserBody);
    this.addRobot();
  }

  /** Draws the robot that carries the scanner or the part, unless it cannot make the scan. */
  addRobot() {
    this.robot = null;
    if (!this.scan.robot) return;
    const ends = (poses) => poses.map((rowMajor) => {
      const end = {position: new Vector3(), turn: new Quaternion(), scale: new Vector3()};
      new Matrix4().set(...rowMajor).decompose(end.position, end.turn, end.scale);
      return end;
    });
    this.robot = this.data.robot.map((solid) => {
      const mesh = new Mesh(this.robotGeometry(solid), new MeshLambertMaterial({color: 0x9aa3ad}));
      mesh.add(new LineSegments(new EdgesGeometry(mesh.geometry, 30),
          new LineBasicMaterial({color: 0x000000, transparent: true, opacity: 0.35})));
      return mesh;
    });
    this.robotStart = ends(this.scan.robot.start);
    this.robotEnd = ends(this.scan.robot.end);
    this.rig.add(...this.robot);
    this.moveRobot(0);
  }

  robotGeometry({size, radius, length, triangles}) {
    if (size) return new BoxGeometry(...size);
    if (length) return new CylinderGeometry(radius, radius, length, 40).rotateX(Math.PI / 2);
    if (radius) return new SphereGeometry(radius, 32, 16);
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(triangles, 3));
    geometry.computeVertexNormals();
    return geometry;
  }

  /** Links between their poses at the start and at the end of the scan. */
  moveRobot(fraction) {
    this.robot?.forEach((mesh, i) => {
      const a = this.robotStart[i], b = this.robotEnd[i];
      mesh.position.lerpVectors(a.position, b.position, fraction);
      mesh.quaternion.slerpQuaternions(a.turn, b.turn, fraction);
    });
  }

  sensor(bodies, colour) {
    const group = new Group();
    group.matrixAutoUpdate = false;
    for (const body of bodies) {
      const geometry = body.size ? new BoxGeometry(...body.size) :
          new CylinderGeometry(body.radius, body.radius, body.length, 40).rotateX(Math.PI / 2);
      geometry.translate(...body.centre);
      group.add(new Mesh(geometry, new MeshLambertMaterial({color: colour})));
      group.add(new LineSegments(new EdgesGeometry(geometry, 30),
          new LineBasicMaterial({color: 0x000000, transparent: true, opacity: 0.5})));
    }
    return group;
  }

  /** Moves the scanner; position as a fraction of the scan's travel. */
  setStage(fraction) {
    if (!this.scan) return;
    const travel = fraction * (this.scan.stage_end_m - this.scan.stage_start_m);
    const {camera_pose, laser_pose, sensor_direction} = this.scan;
    this.cameraBody.matrix.copy(sensorMatrix(camera_pose, sensor_direction, travel));
    this.placeObstacles(new Vector3(...sensor_direction).multiplyScalar(travel));
    this.laserBody.matrix.copy(sensorMatrix(laser_pose, sensor_direction, travel));
    this.moveRobot(fraction);
    const u = this.uniforms;
    this.laserBody.matrix.extractBasis(u.laserX.value, u.laserY.value, u.laserZ.value);
    u.laserOrigin.value.setFromMatrixPosition(this.laserBody.matrix);
    if (this.rig.visible) {
      this.shadow.update(u.laserOrigin.value, u.laserX.value, u.laserY.value, u.laserZ.value);
    }
    if (this.inCameraView) this.view('camera');
    this.draw();
  }

  showRig(visible) {
    this.rig.visible = visible;
    this.uniforms.laserOn.value = visible && this.scan !== null;
  }

  /** 'part', 'scan', or 'camera': through the scanner's camera. */
  view(kind) {
    if (kind === 'camera' && this.scan) {
      this.inCameraView = true;
      this.cameraBody.visible = this.fan.visible = false;
      const pose = this.cameraBody.matrix;
      const x = new Vector3(), y = new Vector3(), z = new Vector3();
      pose.extractBasis(x, y, z);
      this.camera.position.setFromMatrixPosition(pose);
      // three's cameras look along -z with y up, the sensor along +z with y down.
      this.camera.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(x, y.negate(), z.negate()));
      this.setProjection();
      this.draw();
      return;
    }
    this.leaveCameraView();
    if (kind === 'scan' && this.scan) {
      const bounds = new Box3(this.min.clone(), this.max.clone());
      const x = new Vector3(), y = new Vector3(), z = new Vector3();
      this.cameraBody.matrix.extractBasis(x, y, z);
      for (const body of [this.cameraBody, this.laserBody]) {
        // Nearly all of the bodies, which stick out behind the pupil.
        const p = new Vector3().setFromMatrixPosition(body.matrix).addScaledVector(z, -0.1);
        bounds.expandByPoint(p);
      }
      const centre = bounds.getCenter(new Vector3());
      // From the side of the scanner, so that both the fan and the triangulation angle show.
      const along = new Vector3(...this.scan.sensor_direction);
      const sign = (v) => (v.dot(FROM_OUTSIDE) < 0 ? -1 : 1);
      const direction = x.multiplyScalar(0.8 * sign(x)).addScaledVector(along, 0.6 * sign(along)).addScaledVector(z, -0.35);
      direction.normalize();
      direction.z = (z.z > 0.2 ? -1 : 1) * Math.max(0.5, Math.abs(direction.z));
      this.lookAt(centre, 0.46 * bounds.min.distanceTo(bounds.max), direction);
    } else {
      this.lookAt(this.centre, this.radius);
    }
  }

  lookAt(centre, radius, direction) {
    this.leaveCameraView();
    super.lookAt(centre, radius, direction);
  }

  home() {
    this.view('part');
  }

  /** Outlines a box; null: none. */
  outline(box) {
    this.box.visible = box !== null;
    if (box) this.box.box.set(new Vector3(...box.min_m), new Vector3(...box.max_m));
  }

  beforeTurning() {
    this.leaveCameraView();
  }

  leaveCameraView() {
    if (!this.inCameraView) return;
    this.inCameraView = false;
    if (this.scan) this.cameraBody.visible = this.fan.visible = true;
    this.setProjection();
    this.lookAt(this.centre, this.radius);
  }

  setProjection() {
    this.onViewChange?.(this.inCameraView ? this.data.rig.aspect : null);
    this.camera.fov = this.inCameraView ? 180 / Math.PI * this.data.rig.vertical_fov_rad : FIELD_OF_VIEW_DEG;
    this.camera.updateProjectionMatrix();
  }

  resized() {
    this.setProjection();
    this.points.material.uniforms.scale.value = this.renderer.getPixelRatio() * this.container.clientHeight /
        (2 * Math.tan(Math.PI / 180 * 0.5 * this.camera.fov));
  }
}
