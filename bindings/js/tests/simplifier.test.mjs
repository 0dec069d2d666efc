import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import { LodsmithSimplifier } from 'lodsmith/simplifier';
import { MeshoptSimplifier } from 'meshoptimizer';
import { bumpyBall, openEdges } from './shapes.mjs';

before(() => Promise.all([LodsmithSimplifier.ready, MeshoptSimplifier.ready]));

test('results use vertices of the input, as in meshoptimizer', () => {
  const { positions, indices } = bumpyBall(40);
  const given = indices.slice();
  for (const simplifier of [LodsmithSimplifier, MeshoptSimplifier]) {
    const [left, error] = simplifier.simplify(indices, positions, 3, 900, 1, ['LockBorder']);
    assert.ok(left instanceof Uint32Array && left.length > 0 && left.length <= 900);
    assert.ok(left.every((i) => i < positions.length / 3));
    assert.ok(error > 0 && error < 0.5, `${error}`);
    assert.equal(openEdges({ positions, indices: left }), 0);
  }
  assert.deepEqual(indices, given);
});

test('strides, small types and a target error are supported', () => {
  const { positions, indices } = bumpyBall(24);
  const [plain] = LodsmithSimplifier.simplify(indices, positions, 3, 600, 1);
  const wide = new Float32Array((positions.length / 3) * 5).fill(NaN);
  for (let i = 0; i < positions.length / 3; i++) wide.set(positions.subarray(3 * i, 3 * i + 3), 5 * i);
  assert.deepEqual(LodsmithSimplifier.simplify(Uint16Array.from(indices), wide, 5, 600, 1)[0], plain);
  const [left, error] = LodsmithSimplifier.simplify(indices, positions, 3, 0, 0.01);
  assert.ok(error <= 0.01 && left.length > 0 && left.length < indices.length);
});

test('attributes count, and vertices move with an update', () => {
  const { positions, uvs, indices } = bumpyBall(24);
  const args = [positions, 3, uvs, 2, [0.5, 0.5], null, 600, 1];
  const [left, error] = LodsmithSimplifier.simplifyWithAttributes(indices, ...args);
  assert.ok(left.length > 0 && left.length <= indices.length && error >= 0);
  const [own, moved, values] = [indices.slice(), positions.slice(), uvs.slice()];
  const [count, off] = LodsmithSimplifier.simplifyWithUpdate(own, moved, 3, values, 2, [0.5, 0.5], null, 600, 1);
  assert.ok(count > 0 && count < indices.length && off >= 0);
  assert.notDeepEqual(moved, positions);
});

test('renumbering of vertices and the scale agree with meshoptimizer', () => {
  const { positions, indices } = bumpyBall(12);
  const [ours, theirs] = [indices.slice(60, 300), indices.slice(60, 300)];
  assert.deepEqual(LodsmithSimplifier.compactMesh(ours), MeshoptSimplifier.compactMesh(theirs));
  assert.deepEqual(ours, theirs);
  assert.equal(Math.fround(LodsmithSimplifier.getScale(positions, 3)), MeshoptSimplifier.getScale(positions, 3));
  positions[0] = -0;
  positions[3] = 0;
  for (const k of [1, 2]) positions[3 + k] = positions[k];
  const remap = LodsmithSimplifier.generatePositionRemap(positions, 3);
  assert.deepEqual(remap, MeshoptSimplifier.generatePositionRemap(positions, 3));
  assert.equal(remap[1], 0);
});

test('small parts are removed as in meshoptimizer', () => {
  const ball = bumpyBall(12);
  const count = ball.positions.length / 3;
  const sizes = [1, 0.3, 0.1, 0.03, 0.01];
  const [positions, indices] = [new Float32Array(5 * count * 3), new Uint32Array(5 * ball.indices.length)];
  sizes.forEach((size, part) => {
    ball.positions.forEach((x, i) => (positions[3 * count * part + i] = size * x + (i % 3 === 0 ? 2 * part : 0)));
    indices.set(ball.indices.map((i) => i + count * part), part * ball.indices.length);
  });
  for (const error of [0, 0.002, 0.02, 0.05, 0.2]) {
    const left = LodsmithSimplifier.simplifyPrune(indices, positions, 3, error);
    assert.deepEqual(left, MeshoptSimplifier.simplifyPrune(indices, positions, 3, error), `${error}`);
  }
  assert.ok(LodsmithSimplifier.simplifyPrune(indices, positions, 3, 0.02).length < indices.length);
  assert.throws(() => LodsmithSimplifier.simplifyPrune(indices, positions, 3, NaN), RangeError);
  assert.throws(() => LodsmithSimplifier.simplifyPrune(indices, positions, 2, 0), RangeError);
});

test('wrong arguments are errors', () => {
  const { positions, uvs, indices } = bumpyBall(8);
  const call = (...args) => () => LodsmithSimplifier.simplify(...args);
  assert.throws(call(indices, positions, 3, 10, 1), RangeError);
  assert.throws(call(indices, positions, 3, indices.length + 3, 1), RangeError);
  assert.throws(call(indices, positions, 3, 30, NaN), RangeError);
  assert.throws(call(indices, positions, 2, 30, 1), RangeError);
  assert.throws(call(Uint32Array.of(0, 1, 9999), positions, 3, 0, 1), RangeError);
  assert.throws(call(indices, positions, 3, 30, 1, ['Nothing']), TypeError);
  const short = uvs.subarray(2);
  assert.throws(() => LodsmithSimplifier.simplifyWithAttributes(indices, positions, 3, short, 2, [1, 1], null, 30, 1), RangeError);
  assert.throws(() => LodsmithSimplifier.simplifyPoints(positions, 3, 10), /points/);
  assert.throws(() => LodsmithSimplifier.simplifySloppy(indices, positions, 3, null, 30, 1), /cluster/);
  assert.throws(() => LodsmithSimplifier.remesh(indices, positions, 3, 10), /method remesh/);
});
