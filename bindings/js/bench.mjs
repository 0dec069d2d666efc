// Times and errors of the package compared with SimplifyModifier of three.js and MeshoptSimplifier, and the time of a
// run compared with the command. Run it in a folder with the packages lodsmith, three, meshoptimizer and
// @gltf-transform/core; LODSMITH is the path of the command, which reads the models and measures the results.
//
// usage: node bench.mjs rivals MODEL...    a table of all models, to a tenth of the triangles
//        node bench.mjs overhead           a bumpy sphere of a million triangles
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { basename, join } from 'node:path';
import { tmpdir } from 'node:os';
import { NodeIO } from '@gltf-transform/core';
import { ready, simplifyMesh } from 'lodsmith';
import { LodsmithSimplifier } from 'lodsmith/simplifier';
import { simplifyGeometry } from 'lodsmith/three';
import { MeshoptSimplifier } from 'meshoptimizer';
import { BufferAttribute, BufferGeometry } from 'three';
import { SimplifyModifier } from 'three/addons/modifiers/SimplifyModifier.js';

const RATIO = 0.1;
const RUNS = 3;
const command = process.env.LODSMITH ?? 'lodsmith';
const folder = mkdtempSync(join(tmpdir(), 'lodsmith-bench-'));
process.on('exit', () => rmSync(folder, { recursive: true }));

/** Reads a model as a geometry of three.js, with separate vertices at seams. */
async function readGeometry(path) {
  const glb = join(folder, 'model.glb');
  execFileSync(command, ['convert', path, glb, '--force', '--quiet'], { stdio: ['ignore', 'ignore', 'inherit'] });
  const [mesh] = (await new NodeIO().read(glb)).getRoot().listMeshes();
  const geometry = new BufferGeometry();
  const names = { POSITION: 'position', NORMAL: 'normal', TEXCOORD_0: 'uv', COLOR_0: 'color' };
  const primitives = mesh.listPrimitives();
  const kept = primitives[0].listSemantics().filter((name) => name in names);
  for (const name of kept) {
    const all = primitives.map((p) => p.getAttribute(name).getArray());
    const array = Float32Array.from(all.flatMap((x) => Array.from(x)));
    geometry.setAttribute(names[name], new BufferAttribute(array, primitives[0].getAttribute(name).getElementSize()));
  }
  const indices = [];
  let base = 0;
  for (const primitive of primitives) {
    for (const i of primitive.getIndices().getArray()) indices.push(base + i);
    base += primitive.getAttribute('POSITION').getCount();
  }
  return geometry.setIndex(new BufferAttribute(Uint32Array.from(indices), 1));
}

/** Writes positions and triangles as a binary PLY file. */
function writePly(path, positions, indices) {
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${positions.length / 3}\nproperty float x\nproperty float y\n` +
    `property float z\nelement face ${indices.length / 3}\nproperty list uchar uint vertex_indices\nend_header\n`;
  const faces = Buffer.alloc((indices.length / 3) * 13);
  for (let i = 0; i < indices.length; i++) {
    if (i % 3 === 0) faces.writeUInt8(3, 13 * (i / 3));
    faces.writeUInt32LE(indices[i], 13 * Math.floor(i / 3) + 1 + 4 * (i % 3));
  }
  const floats = Buffer.from(positions.buffer, positions.byteOffset, positions.byteLength);
  writeFileSync(path, Buffer.concat([Buffer.from(header), floats, faces]));
}

/** Returns the shortest CPU time of several runs in seconds, and the last result. */
async function timed(run) {
  let [least, result] = [Infinity, null];
  for (let i = 0; i < RUNS; i++) {
    const begin = process.cpuUsage();
    result = await run();
    const { user, system } = process.cpuUsage(begin);
    least = Math.min(least, (user + system) / 1e6);
  }
  return { seconds: least, result };
}

const indexed = (geometry, indices) => geometry.clone().setIndex(new BufferAttribute(indices, 1));
const arrays = (geometry) => [geometry.getIndex().array, geometry.getAttribute('position').array];
const target = (geometry) => Math.floor(geometry.getIndex().count * RATIO / 3) * 3;

const RIVALS = {
  'lodsmith, `simplifyGeometry`': (geometry) => simplifyGeometry(geometry, { ratio: RATIO }),
  'lodsmith, `method: \'cluster\'`': (geometry) => simplifyGeometry(geometry, { ratio: RATIO, method: 'cluster' }),
  '`LodsmithSimplifier`': (geometry) => {
    const [indices, positions] = arrays(geometry);
    return indexed(geometry, LodsmithSimplifier.simplify(indices, positions, 3, target(geometry), 1)[0]);
  },
  '`MeshoptSimplifier`': (geometry) => {
    const [indices, positions] = arrays(geometry);
    return indexed(geometry, MeshoptSimplifier.simplify(indices, positions, 3, target(geometry), 1)[0]);
  },
  '`SimplifyModifier` of three': (geometry) => {
    // Its argument is the number of vertices to remove.
    return new SimplifyModifier().modify(geometry, Math.floor(geometry.getAttribute('position').count * (1 - RATIO)));
  },
};

/** Returns a cell of the table. */
async function cell(name, geometry, original) {
  const { seconds, result } = await timed(() => RIVALS[name](geometry));
  const path = join(folder, 'result.ply');
  const position = result.getAttribute('position').array;
  const indices = result.getIndex()?.array ?? Uint32Array.from({ length: position.length / 3 }, (_, i) => i);
  writePly(path, position, indices);
  const found = JSON.parse(execFileSync(command, ['compare', original, path, '--json', '--quiet'], { encoding: 'utf8' }));
  const percent = (x) => ((100 * x) / found.diagonal).toPrecision(3);
  const attributes = Object.keys(result.attributes).filter((x) => x !== 'position').join(', ') || 'none';
  return `${indices.length / 3}: ${seconds.toFixed(3)} s, ${percent(found.rms.symmetric)}, ${percent(found.hausdorff.symmetric)}; ${attributes}`;
}

async function rivals(paths) {
  const rows = new Map(Object.keys(RIVALS).map((name) => [name, []]));
  const heads = [];
  for (const path of paths) {
    const geometry = await readGeometry(path);
    const original = join(folder, 'original.ply');
    writePly(original, geometry.getAttribute('position').array, geometry.getIndex().array);
    heads.push(`${basename(path)}, ${geometry.getIndex().count / 3}`);
    for (const [name, cells] of rows) cells.push(await cell(name, geometry, original));
  }
  console.log(`| | ${heads.join(' | ')} |\n|---${'|---'.repeat(heads.length)}|`);
  for (const [name, cells] of rows) console.log(`| ${name} | ${cells.join(' | ')} |`);
}

/** A bumpy sphere of a million triangles. */
function ball() {
  const n = 724;
  const positions = new Float32Array(3 * (n * (n - 1) + 2));
  const place = (i, j) => (j === 0 ? 0 : j === n ? 1 : 2 + (j - 1) * n + (i % n));
  positions.set([0, 1, 0, 0, -1, 0]);
  const indices = [];
  for (let j = 0; j < n; j++) {
    for (let i = 0; i < n; i++) {
      const [a, b] = [(2 * Math.PI * i) / n, (Math.PI * j) / n];
      const r = 1 + 0.1 * Math.sin(5 * a) * Math.sin(4 * b) ** 2;
      if (j > 0) {
        const p = [Math.sin(b) * Math.cos(a), Math.cos(b), Math.sin(b) * Math.sin(a)];
        positions.set(p.map((x) => r * x), 3 * place(i, j));
        indices.push(place(i, j), place(i + 1, j), place(i, j + 1));
      }
      if (j < n - 1) indices.push(place(i + 1, j), place(i + 1, j + 1), place(i, j + 1));
    }
  }
  return { positions, indices: Uint32Array.from(indices) };
}

function overhead() {
  const mesh = ball();
  const path = join(folder, 'ball.ply');
  writePly(path, mesh.positions, mesh.indices);
  const [here, there] = [[], []];
  // The two take turns, so that other load affects both.
  for (let i = 0; i < 10; i++) {
    const begin = performance.now();
    simplifyMesh(mesh, { ratio: RATIO });
    here.push((performance.now() - begin) / 1000);
    const args = ['simplify', path, '--dry-run', '--ratio', String(RATIO), '--threads', '1', '--json', '--quiet'];
    const { seconds } = JSON.parse(execFileSync(command, args, { encoding: 'utf8' }));
    there.push(seconds.prepare + seconds.simplify + seconds.fit);
  }
  const [wasm, native] = [Math.min(...here), Math.min(...there)];
  console.log(`${mesh.indices.length / 3} triangles: ${wasm.toFixed(3)} s, the command's engine ${native.toFixed(3)} s, ratio ${(wasm / native).toFixed(2)}`);
}

await Promise.all([ready, MeshoptSimplifier.ready]);
const [task, ...paths] = process.argv.slice(2);
if (task === 'rivals' && paths.length > 0) await rivals(paths);
else if (task === 'overhead') overhead();
else {
  console.error('usage: node bench.mjs rivals MODEL... | overhead');
  process.exitCode = 2;
}
