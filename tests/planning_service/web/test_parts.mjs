// SPDX-License-Identifier: Apache-2.0
// Small parts for the tests.

// Binary STL of a block with a step: 120 x 80 x 40 in the file's unit.
export function blockStl(lengths = [120, 80, 40]) {
  const [x, y, z] = lengths;
  const profile = [[0, 0], [x, 0], [x, z / 2], [x / 2, z / 2], [x / 2, z], [0, z]];
  const triangles = [];
  const quad = (a, b, c, d) => triangles.push([a, b, c], [a, c, d]);
  profile.forEach(([ax, az], i) => {
    const [bx, bz] = profile[(i + 1) % profile.length];
    quad([ax, 0, az], [ax, y, az], [bx, y, bz], [bx, 0, bz]);
  });
  // The concave outline as two rectangles, at both ends.
  for (const [x0, z0, x1, z1] of [[0, 0, x, z / 2], [0, z / 2, x / 2, z]]) {
    // The corner of the upper one lies on the edge of the lower one, which therefore gets it too.
    const low = z0 === 0 ? [[x1, z1], [x / 2, z1], [x0, z1]] : [[x1, z1], [x0, z1]];
    const outline = [[x0, z0], [x1, z0], ...low];
    for (let i = 1; i + 1 < outline.length; ++i) {
      const [a, b, c] = [outline[0], outline[i], outline[i + 1]];
      triangles.push([[a[0], 0, a[1]], [b[0], 0, b[1]], [c[0], 0, c[1]]]);
      triangles.push([[a[0], y, a[1]], [c[0], y, c[1]], [b[0], y, b[1]]]);
    }
  }
  const bytes = Buffer.alloc(84 + 50 * triangles.length);
  bytes.writeUInt32LE(triangles.length, 80);
  triangles.forEach((triangle, i) => triangle.flat().forEach((value, j) => {
    bytes.writeFloatLE(value, 84 + 50 * i + 12 + 4 * j);
  }));
  return bytes;
}

export function tetrahedronObj() {
  return Buffer.from('v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n');
}

export function tetrahedronPly() {
  return Buffer.from(`ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z
element face 4\nproperty list uchar int vertex_indices\nend_header
0 0 0\n10 0 0\n0 20 0\n0 0 30\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n`);
}

// GLB of one triangle-mesh node, shifted and enlarged by its matrix, with a texture that must not
// be asked for.
export function tetrahedronGlb() {
  const positions = new Float32Array([0, 0, 0, 0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.03]);
  const indices = new Uint16Array([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]);
  const binary = Buffer.concat([Buffer.from(positions.buffer), Buffer.from(indices.buffer)]);
  const json = Buffer.from(JSON.stringify({
    asset: {version: '2.0'}, scene: 0, scenes: [{nodes: [0]}],
    nodes: [{mesh: 0, scale: [2, 2, 2], translation: [1, 0, 0]}],
    meshes: [{primitives: [{attributes: {POSITION: 0}, indices: 1, material: 0}]}],
    materials: [{pbrMetallicRoughness: {baseColorTexture: {index: 0}}}],
    textures: [{source: 0}], images: [{uri: 'nowhere.png'}],
    accessors: [{bufferView: 0, componentType: 5126, count: 4, type: 'VEC3', min: [0, 0, 0], max: [0.01, 0.02, 0.03]},
                {bufferView: 1, componentType: 5123, count: 12, type: 'SCALAR'}],
    bufferViews: [{buffer: 0, byteOffset: 0, byteLength: 48}, {buffer: 0, byteOffset: 48, byteLength: 24}],
    buffers: [{byteLength: binary.length}],
  }));
  const padded = Buffer.concat([json, Buffer.alloc((4 - json.length % 4) % 4, 0x20)]);
  const head = Buffer.alloc(12), jsonHead = Buffer.alloc(8), binaryHead = Buffer.alloc(8);
  head.write('glTF', 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + 8 + padded.length + 8 + binary.length, 8);
  jsonHead.writeUInt32LE(padded.length, 0);
  jsonHead.write('JSON', 4);
  binaryHead.writeUInt32LE(binary.length, 0);
  binaryHead.write('BIN\0', 4);
  return Buffer.concat([head, jsonHead, padded, binaryHead, binary]);
}
