// SPDX-License-Identifier: Apache-2.0
// Surroundings of the part: obstacles, the table, and the boxes of regions of interest.
import {
  Box3, Box3Helper, BufferAttribute, BufferGeometry, CanvasTexture, DoubleSide, EdgesGeometry, Group,
  LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, Sprite, SpriteMaterial, SRGBColorSpace, Vector3,
} from 'three';

const OBSTACLE_COLOUR = 0x8a6d4b, REGION_COLOUR = 0x7c3aad;

// A name that keeps facing the viewer; `height` in metres.
function label(text, height, colour) {
  const canvas = document.createElement('canvas');
  const font = '600 44px system-ui, sans-serif';
  const measure = canvas.getContext('2d');
  measure.font = font;
  canvas.width = Math.min(1024, Math.ceil(measure.measureText(text).width) + 36);
  canvas.height = 64;
  const context = canvas.getContext('2d');
  context.font = font;
  context.fillStyle = 'rgba(255, 255, 255, 0.85)';
  context.beginPath();
  context.roundRect(0, 0, canvas.width, canvas.height, 14);
  context.fill();
  context.fillStyle = colour;
  context.textBaseline = 'middle';
  context.fillText(text, 18, 34, canvas.width - 36);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  const sprite = new Sprite(new SpriteMaterial({map: texture, depthTest: false, transparent: true}));
  sprite.scale.set(height * canvas.width / canvas.height, height, 1);
  sprite.renderOrder = 5;
  return sprite;
}

/** An obstacle of viewer_data.cpp; place() puts it where it is in a scan. */
export class Obstacle {
  constructor(data, radius) {
    this.data = data;
    this.group = new Group();
    this.group.matrixAutoUpdate = false;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(data.positions, 3));
    geometry.setIndex(new BufferAttribute(data.triangles, 1));
    // Flat faces need vertices of their own.
    const faceted = geometry.toNonIndexed();
    faceted.computeVertexNormals();
    faceted.computeBoundingBox();
    const solid = new Mesh(faceted, new MeshLambertMaterial(
        {color: OBSTACLE_COLOUR, transparent: true, opacity: 0.25, side: DoubleSide, depthWrite: false}));
    solid.renderOrder = 1;
    this.group.add(solid, new LineSegments(new EdgesGeometry(geometry, 30),
        new LineBasicMaterial({color: OBSTACLE_COLOUR})));
    const name = label(data.name, 0.055 * radius, '#5c4426');
    const box = faceted.boundingBox;
    name.position.set((box.min.x + box.max.x) / 2, (box.min.y + box.max.y) / 2, box.max.z);
    this.group.add(name);
  }

  /** Needs a scan unless it turns with the part. */
  get drawable() {
    return this.data.turns || this.data.poses.length > 0;
  }

  /** `travelled`: the sensors' way in part coordinates since the start of the scan; what stands still
      in the world goes with them. */
  place(scan, travelled) {
    const pose = scan === null ? null : this.data.poses[scan];
    if (!pose) {
      this.group.matrix.identity();
    } else {
      this.group.matrix.set(...pose);
      if (this.data.stands_still) {
        this.group.matrix.elements[12] += travelled.x;
        this.group.matrix.elements[13] += travelled.y;
        this.group.matrix.elements[14] += travelled.z;
      }
    }
    this.group.matrixWorldNeedsUpdate = true;
  }
}

/** Box and name of a region of interest. */
export function regionBox(region, radius) {
  const group = new Group();
  const box = new Box3(new Vector3(...region.min_m), new Vector3(...region.max_m));
  group.add(new Box3Helper(box, REGION_COLOUR));
  const name = label(region.name, 0.055 * radius, '#5b2a83');
  name.position.copy(box.min);
  group.add(name);
  return group;
}
