// Meshes of the tests.

/** A bumpy sphere with a seam in its texture coordinates: (n + 1)² vertices, 2 n² triangles. */
export function bumpyBall(n) {
  const count = (n + 1) * (n + 1);
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  const uvs = new Float32Array(2 * count);
  let at = 0;
  for (let j = 0; j <= n; j++) {
    for (let i = 0; i <= n; i++, at++) {
      const [u, v] = [i / n, j / n];
      // The two sides of the seam have the same positions.
      const [a, b] = [2 * Math.PI * (i % n) / n, Math.PI * v];
      const r = 1 + 0.1 * Math.sin(5 * a) * Math.sin(4 * b) ** 2;
      const s = j === 0 || j === n ? 0 : Math.sin(b);
      const p = [s * Math.cos(a), Math.cos(b), s * Math.sin(a)];
      p.forEach((x, k) => {
        positions[3 * at + k] = r * x;
        normals[3 * at + k] = x;
      });
      uvs.set([u, v], 2 * at);
    }
  }
  const indices = [];
  for (let j = 0; j < n; j++) {
    for (let i = 0; i < n; i++) {
      const a = j * (n + 1) + i;
      const b = a + n + 1;
      if (j > 0) indices.push(a, a + 1, b);
      if (j < n - 1) indices.push(a + 1, b + 1, b);
    }
  }
  return { positions, normals, uvs, indices: Uint32Array.from(indices) };
}

/** Returns a binary PLY file of positions and triangles. */
export function ply({ positions, indices }) {
  const header = Buffer.from(
    `ply\nformat binary_little_endian 1.0\nelement vertex ${positions.length / 3}\nproperty float x\nproperty float y\n` +
      `property float z\nelement face ${indices.length / 3}\nproperty list uchar uint vertex_indices\nend_header\n`,
  );
  const faces = Buffer.alloc((indices.length / 3) * 13);
  for (let f = 0; f < indices.length / 3; f++) {
    faces.writeUInt8(3, 13 * f);
    for (let k = 0; k < 3; k++) faces.writeUInt32LE(indices[3 * f + k], 13 * f + 1 + 4 * k);
  }
  return Buffer.concat([header, Buffer.from(positions.buffer, positions.byteOffset, positions.byteLength), faces]);
}

/** Returns the positions and triangles of a binary PLY file whose vertices start with three floats. */
export function readPly(bytes) {
  const end = bytes.indexOf('end_header\n') + 'end_header\n'.length;
  const header = bytes.subarray(0, end).toString();
  const count = (name) => Number(new RegExp(`element ${name} (\\d+)`).exec(header)[1]);
  const [vertices, faces] = [count('vertex'), count('face')];
  const body = bytes.subarray(end);
  const positions = Float32Array.from({ length: 3 * vertices }, (_, i) => body.readFloatLE(4 * i));
  const at = 12 * vertices;
  const corner = (i) => body.readUInt32LE(at + 13 * Math.floor(i / 3) + 1 + 4 * (i % 3));
  return { positions, indices: Uint32Array.from({ length: 3 * faces }, (_, i) => corner(i)) };
}

/** Returns the number of edges with one triangle, after merging vertices at equal positions. */
export function openEdges({ positions, indices }) {
  const number = new Map();
  const place = (i) => {
    const key = positions.subarray(3 * i, 3 * i + 3).join();
    if (!number.has(key)) number.set(key, number.size);
    return number.get(key);
  };
  const open = new Set();
  for (let i = 0; i < indices.length; i++) {
    const [a, b] = [place(indices[i]), place(indices[i % 3 === 2 ? i - 2 : i + 1])];
    if (!open.delete(`${b} ${a}`)) open.add(`${a} ${b}`);
  }
  return open.size;
}
