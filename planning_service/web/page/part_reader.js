// SPDX-License-Identifier: Apache-2.0
// Worker: reads a mesh file into bare triangles, so that the page stays alive meanwhile.
import {BufferAttribute, BufferGeometry, EdgesGeometry, Matrix3, MeshBasicMaterial, Vector3} from 'three';
import {GLTFLoader} from 'three/examples/jsm/loaders/GLTFLoader.js';
import {OBJLoader} from 'three/examples/jsm/loaders/OBJLoader.js';
import {PLYLoader} from 'three/examples/jsm/loaders/PLYLoader.js';
import {STLLoader} from 'three/examples/jsm/loaders/STLLoader.js';

// Surfaces and textures are of no interest here, and textures would be loaded by addresses that the
// page's content security policy forbids.
function withoutMaterials() {
  return {
    name: 'without_materials',
    loadTexture: () => Promise.resolve(null),
    loadMaterial: () => Promise.resolve(new MeshBasicMaterial()),
  };
}

async function geometriesOf(name, bytes) {
  const format = name.slice(name.lastIndexOf('.') + 1).toLowerCase();
  const meshes = [];
  const collect = (root) => {
    root.updateMatrixWorld(true);
    root.traverse((node) => {
      if (node.isMesh) meshes.push({geometry: node.geometry, matrix: node.matrixWorld});
    });
  };
  if (format === 'glb') {
    const loader = new GLTFLoader();
    loader.register(withoutMaterials);
    collect((await loader.parseAsync(bytes, '')).scene);
  } else if (format === 'obj') {
    collect(new OBJLoader().parse(new TextDecoder().decode(bytes)));
  } else if (format === 'stl') {
    meshes.push({geometry: new STLLoader().parse(bytes)});
  } else if (format === 'ply') {
    const geometry = new PLYLoader().parse(bytes);
    if (!geometry.index) throw new Error('it has points but no triangles');
    meshes.push({geometry});
  } else {
    throw new Error(`files of type .${format} are not shown here`);
  }
  return meshes;
}

const EDGE_TRIANGLES = 500000;
const EDGE_ANGLE_DEG = 25;

// Ends of the sharp edges; null for a mesh so fine that they would take too long.
function edgesOf(positions) {
  if (positions.length / 9 > EDGE_TRIANGLES) return null;
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  return new EdgesGeometry(geometry, EDGE_ANGLE_DEG).attributes.position.array;
}

// {positions, normals and edges (null: none), size, min} in the file's unit.
async function readPart(name, bytes) {
  const meshes = await geometriesOf(name, bytes);
  let corners = 0;
  for (const {geometry} of meshes) corners += geometry.index?.count ?? geometry.attributes.position?.count ?? 0;
  corners -= corners % 3;
  if (corners === 0) throw new Error('it has no triangles');
  const positions = new Float32Array(3 * corners);
  // Facet normals of an STL file add nothing to the triangles.
  const hasNormals = !/\.stl$/i.test(name) && meshes.every(({geometry}) => geometry.attributes.normal);
  const normals = hasNormals ? new Float32Array(3 * corners) : null;
  const min = [Infinity, Infinity, Infinity], max = [-Infinity, -Infinity, -Infinity];
  const vector = new Vector3();
  let offset = 0;
  for (const {geometry, matrix} of meshes) {
    const {index, attributes: {position, normal}} = geometry;
    const turn = matrix && normals ? new Matrix3().getNormalMatrix(matrix) : null;
    const count = index?.count ?? position?.count ?? 0;
    for (let i = 0; i < count && offset < positions.length; ++i, offset += 3) {
      const vertex = index ? index.getX(i) : i;
      vector.fromBufferAttribute(position, vertex);
      if (matrix) vector.applyMatrix4(matrix);
      vector.toArray(positions, offset);
      for (let axis = 0; axis < 3; ++axis) {
        const value = positions[offset + axis];
        if (!Number.isFinite(value)) throw new Error('a vertex is not finite');
        if (value < min[axis]) min[axis] = value;
        if (value > max[axis]) max[axis] = value;
      }
      if (!normals) continue;
      vector.fromBufferAttribute(normal, vertex);
      if (turn) vector.applyMatrix3(turn).normalize();
      vector.toArray(normals, offset);
    }
  }
  return {positions, normals, edges: edgesOf(positions), min, size: max.map((value, axis) => value - min[axis])};
}

self.addEventListener('message', async ({data: {id, name, bytes}}) => {
  try {
    const part = await readPart(name, bytes);
    const arrays = [part.positions, part.normals, part.edges].filter(Boolean);
    self.postMessage({id, part}, arrays.map(({buffer}) => buffer));
  } catch (error) {
    self.postMessage({id, error: String(error?.message ?? error)});
  }
});
