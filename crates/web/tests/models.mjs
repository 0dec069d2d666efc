// Generated models for tests.

/** Returns a closed ball with bumps, of 2 · columns · (rows − 1) triangles, with texture coordinates around it. */
export function bumpyBall(columns, rows) {
  const positions = [];
  const uvs = [];
  const faces = [];
  for (let i = 0; i <= rows; i++) {
    for (let k = 0; k < columns; k++) {
      const [a, b] = [(Math.PI * i) / rows, (2 * Math.PI * k) / columns];
      const r = 1 + 0.1 * Math.sin(5 * b) * Math.sin(7 * a) * Math.sin(a);
      positions.push([r * Math.sin(a) * Math.cos(b), r * Math.cos(a), r * Math.sin(a) * Math.sin(b)]);
      uvs.push([k / columns, 1 - i / rows]);
    }
  }
  const at = (i, k) => i * columns + (k % columns);
  for (let i = 0; i < rows; i++) {
    for (let k = 0; k < columns; k++) {
      // At the poles one of the two triangles would be degenerate.
      if (i > 0) faces.push([at(i, k), at(i, k + 1), at(i + 1, k)]);
      if (i < rows - 1) faces.push([at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)]);
    }
  }
  // Each pole is one vertex.
  const merged = (v) => (v < columns ? 0 : v >= rows * columns ? rows * columns : v);
  return { positions, uvs, faces: faces.map((f) => f.map(merged)) };
}

/** Returns the text of an OBJ file, optionally with a material of a material library. */
export function obj({ positions, uvs, faces }, library, material) {
  const lines = library ? [`mtllib ${library}`] : [];
  for (const p of positions) lines.push(`v ${p.map((x) => x.toFixed(6)).join(' ')}`);
  if (material) for (const uv of uvs) lines.push(`vt ${uv.map((x) => x.toFixed(6)).join(' ')}`);
  if (material) lines.push(`usemtl ${material}`);
  for (const f of faces) lines.push(`f ${f.map((v) => (material ? `${v + 1}/${v + 1}` : v + 1)).join(' ')}`);
  return `${lines.join('\n')}\n`;
}
