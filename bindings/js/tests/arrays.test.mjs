import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { options, ready, simplifyMesh, simplifyScene } from 'lodsmith';
import { command, simplifyFile } from './command.mjs';
import { bumpyBall, openEdges, ply, readPly } from './shapes.mjs';

const here = fileURLToPath(new URL('.', import.meta.url));
before(() => ready);

test('a mesh keeps its attributes, in their types', () => {
  const ball = bumpyBall(40);
  const count = ball.positions.length / 3;
  const heat = Float32Array.from({ length: count }, (_, i) => ball.positions[3 * i + 1]);
  const label = Int16Array.from({ length: count }, (_, i) => (ball.positions[3 * i] > 0 ? 7 : -7));
  const colors = new Float32Array(3 * count).fill(0.5);
  const small = simplifyMesh({ ...ball, colors, attributes: { heat, label } }, { ratio: 0.1 });
  assert.equal(small.indices.length / 3, 312);
  assert.equal(small.report.output.faces, 312);
  assert.equal(small.report.reached, true);
  const left = small.positions.length / 3;
  assert.equal(small.normals.length, 3 * left);
  assert.equal(small.uvs.length, 2 * left);
  assert.deepEqual(small.colors, new Float32Array(3 * left).fill(0.5));
  assert.equal(openEdges(small), 0, 'the seam stays closed');
  const { array, itemSize } = small.attributes.heat;
  assert.equal(itemSize, 1);
  array.forEach((x, i) => assert.ok(Math.abs(x - small.positions[3 * i + 1]) < 0.1, `heat of ${i}`));
  assert.ok(small.attributes.label.array instanceof Int16Array);
  assert.deepEqual(new Set(small.attributes.label.array), new Set([7, -7]));
});

test('positions keep double precision, and indices may have any integer type', () => {
  const { positions, indices } = bumpyBall(16);
  const plain = simplifyMesh({ positions, indices }, { faces: 100 });
  for (const type of [Uint16Array, Int32Array, Int16Array]) {
    // The result has the same type.
    const small = simplifyMesh({ positions, indices: type.from(indices) }, { faces: 100 });
    assert.deepEqual(small, { ...plain, indices: type.from(plain.indices) });
  }
  const bytes = { positions: positions.slice(0, 3 * 51), indices: Uint8Array.from(indices.filter((_, i) => i < 96)) };
  assert.ok(simplifyMesh(bytes, { faces: 20 }).indices instanceof Uint8Array);
  const [part] = simplifyScene({ meshes: [{ positions, indices: Uint16Array.from(indices) }] }, { faces: 100 }).meshes;
  assert.ok(part.indices instanceof Uint16Array && part.indices.length === 300);
  const soup = Float32Array.from(Array.from(indices).flatMap((i) => Array.from(positions.subarray(3 * i, 3 * i + 3))));
  assert.equal(simplifyMesh({ positions: soup }, { faces: 100 }).indices.length, 300);
  const double = simplifyMesh({ positions: Float64Array.from(positions), indices }, { faces: 100 });
  assert.ok(double.positions instanceof Float64Array);
  assert.equal(double.indices.length, 300);
});

test('regions keep their triangles and borders', () => {
  const ball = bumpyBall(32);
  const regions = Uint32Array.from({ length: ball.indices.length / 3 }, (_, f) => (f < 900 ? 3 : 8));
  const small = simplifyMesh({ ...ball, regions }, { ratio: 0.2 });
  assert.equal(small.regions.length, small.indices.length / 3);
  assert.deepEqual(new Set(small.regions), new Set([3, 8]));
});

test('locked vertices stay', () => {
  const { positions, indices } = bumpyBall(16);
  const locked = new Uint8Array(positions.length / 3);
  const kept = [40, 90, 200];
  kept.forEach((i) => (locked[i] = 1));
  const small = simplifyMesh({ positions, indices }, { faces: 40, locked });
  const places = new Set(Array.from({ length: small.positions.length / 3 }, (_, i) => small.positions.subarray(3 * i, 3 * i + 3).join()));
  for (const i of kept) assert.ok(places.has(positions.subarray(3 * i, 3 * i + 3).join()));
});

test('an error map keeps places', () => {
  const { positions, indices } = bumpyBall(16);
  const errorMap = new Float32Array(positions.length / 3).fill(1);
  const kept = [40, 90, 200];
  kept.forEach((i) => (errorMap[i] = 0));
  const small = simplifyMesh({ positions, indices }, { error: '5%', errorMap });
  assert.ok(small.indices.length < indices.length);
  const places = new Set(Array.from({ length: small.positions.length / 3 }, (_, i) => small.positions.subarray(3 * i, 3 * i + 3).join()));
  for (const i of kept) assert.ok(places.has(positions.subarray(3 * i, 3 * i + 3).join()));
  assert.throws(() => simplifyMesh({ positions, indices }, { ratio: 0.5, errorMap }), /error/);
});

test('wrong options and arrays are named', () => {
  const ball = bumpyBall(8);
  const fails = (given, options, kind, text) =>
    assert.throws(() => simplifyMesh(given, options), (e) => e.constructor === kind && text.test(e.message) || assert.fail(`${e}`));
  fails(ball, { rato: 0.1 }, TypeError, /^there is no option rato; a similar one is ratio$/);
  fails(ball, { ratio: 0.1, maxNorml: 3 }, TypeError, /a similar one is maxNormal$/);
  fails(ball, { ratio: 2 }, RangeError, /^ratio: /);
  fails(ball, { ratio: 0.5, maxNormal: 'x' }, RangeError, /^maxNormal: /);
  fails(ball, undefined, RangeError, /./);
  fails({}, { ratio: 0.5 }, TypeError, /^positions: /);
  fails({ ...ball, normal: ball.normals }, { ratio: 0.5 }, TypeError, /^a mesh has no normal: it is called normals$/);
  fails({ ...ball, uv: ball.uvs }, { ratio: 0.5 }, TypeError, /it is called uvs$/);
  fails({ ...ball, heat: ball.uvs }, { ratio: 0.5 }, TypeError, /^a mesh has no heat: other attributes belong into attributes$/);
  fails({ ...ball, instances: 2 }, { ratio: 0.5 }, TypeError, /instances/);
  assert.throws(() => simplifyScene({ meshes: [{ ...ball, normal: ball.normals }] }, { ratio: 0.5 }), TypeError);
  fails({ ...ball, uvs: new Float32Array(3) }, { ratio: 0.5 }, RangeError, /^uvs: 3 values/);
  fails({ ...ball, normals: [] }, { ratio: 0.5 }, TypeError, /^normals: a Float32Array/);
  fails({ positions: ball.positions, indices: Uint32Array.of(0, 1, 5000) }, { ratio: 0.5 }, RangeError, /5000/);
  fails({ positions: ball.positions, indices: Int32Array.of(0, 1, -1) }, { ratio: 0.5 }, RangeError, /vertex/);
  fails({ ...ball, attributes: { id: Uint32Array.of(...new Array(81).fill(2 ** 25)) } }, { ratio: 0.5 }, RangeError, /^id: /);
  fails(ball, { ratio: 0.5, locked: new Uint8Array(3) }, RangeError, /locked|vert/);
  // The module still works after these errors.
  assert.equal(simplifyMesh(ball, { faces: 50 }).indices.length, 150);
});

test('progress is reported and a run can be cancelled', () => {
  const ball = bumpyBall(60);
  const calls = [];
  simplifyMesh(ball, { ratio: 0.1, onProgress: (done, stage) => void calls.push([stage, done]) });
  assert.ok(calls.some(([stage]) => stage === 'simplify'));
  assert.ok(calls.every(([, done]) => done >= 0 && done <= 1));
  assert.throws(() => simplifyMesh(ball, { ratio: 0.1, onProgress: () => false }), { name: 'AbortError' });
  // An exception of the function is not lost.
  const onProgress = () => {
    throw new RangeError('enough');
  };
  assert.throws(() => simplifyMesh(ball, { ratio: 0.1, onProgress }), { name: 'RangeError', message: 'enough' });
  assert.throws(() => simplifyScene({ meshes: [ball] }, { ratio: 0.1, onProgress }), { message: 'enough' });
});

test('a result can be simplified again', () => {
  const half = simplifyMesh(bumpyBall(16), { ratio: 0.5 });
  assert.ok(simplifyMesh(half, { ratio: 0.5 }).indices.length < half.indices.length);
});

test('faces with invalid positions are dropped with a warning', () => {
  const ball = bumpyBall(16);
  assert.deepEqual(simplifyMesh(ball, { ratio: 0.5 }).warnings, []);
  ball.positions[3 * 40] = NaN;
  const small = simplifyMesh(ball, { ratio: 0.5 });
  assert.equal(small.report.cleanup.non_finite_faces, 6);
  assert.deepEqual(small.warnings, ['6 faces have a position that is not finite: removed']);
  assert.deepEqual(simplifyScene({ meshes: [ball] }, { ratio: 0.5 }).warnings, small.warnings);
});

test('a call before the module is loaded says what to do', () => {
  const code = `
    import { LodsmithSimplifier, ready, simplifyMesh } from 'lodsmith';
    const [positions, indices] = [new Float32Array(9), Uint32Array.of(0, 1, 2)];
    const calls = [() => simplifyMesh({ positions, indices }, { ratio: 0.5 }), () => LodsmithSimplifier.simplify(indices, positions, 3, 3, 1)];
    const texts = calls.map((call) => { try { call(); } catch (error) { return error.message; } });
    await ready;
    console.log(JSON.stringify(texts));`;
  const texts = JSON.parse(execFileSync(process.execPath, ['--input-type=module', '-e', code], { cwd: here }));
  assert.deepEqual(texts, new Array(2).fill('the WebAssembly module is not loaded: await ready before the first call'));
});

test('the table of options has the defaults and the words', () => {
  const all = new Map(options().map((row) => [row.name, row]));
  assert.equal(all.get('maxNormal').kind, 'degrees');
  assert.ok(all.get('method').words.includes('cluster'));
  assert.equal(all.get('border').default, 'keep');
});

test('a scene has one target', () => {
  const [a, b] = [bumpyBall(40), bumpyBall(20)];
  const done = simplifyScene({ meshes: [{ ...a, scale: 10 }, { ...b, instances: 3 }], diagonal: 20 }, { ratio: 0.25 });
  const faces = done.meshes.map((mesh) => mesh.indices.length / 3);
  assert.deepEqual(faces, done.counts.map((c) => c.faces));
  const all = a.indices.length / 3 + 3 * (b.indices.length / 3);
  assert.equal(done.report.input.faces, all);
  assert.ok(faces[0] + 3 * faces[1] <= all / 4);
});

test('arrays agree with the command, bit for bit', { skip: !command && 'LODSMITH is not set' }, () => {
  // (Large enough for methods that sample.)
  const ball = bumpyBall(96);
  const file = ply(ball);
  for (const [given, typed] of [
    [{ ratio: 0.1 }, ['--ratio', '0.1']],
    [{ faces: 300, method: 'quadric' }, ['--faces', '300', '--method', 'quadric']],
    [{ error: '0.5%' }, ['--error', '0.5%']],
    [{ ratio: 0.1, method: 'cluster' }, ['--ratio', '0.1', '--method', 'cluster']],
    [{ ratio: 0.5, method: 'cluster' }, ['--ratio', '0.5', '--method', 'cluster']],
    [{ faces: 500, method: 'melax' }, ['--faces', '500', '--method', 'melax']],
    [{ faces: 500, method: 'shortest-edge' }, ['--faces', '500', '--method', 'shortest-edge']],
    [{ faces: 500, preset: 'scan' }, ['--faces', '500', '--preset', 'scan']],
    [{ method: 'remesh', voxel: 0.1 }, ['--method', 'remesh', '--voxel', '0.1']],
    [{ faces: 400, method: 'lindstrom-turk', maxNormal: 40 }, ['--faces', '400', '--method', 'lindstrom-turk', '--max-normal', '40']],
    [{ faces: 500, method: 'vertex-removal' }, ['--faces', '500', '--method', 'vertex-removal']],
    [{ faces: 500, method: 'remesh', seed: 3 }, ['--faces', '500', '--method', 'remesh', '--seed', '3']],
  ]) {
    const { positions, indices } = simplifyMesh({ positions: ball.positions, indices: ball.indices }, given);
    assert.deepEqual({ positions, indices }, readPly(simplifyFile(file, 'ply', typed)), typed.join(' '));
  }
});
