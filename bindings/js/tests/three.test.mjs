import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import * as THREE from 'three';
import { ready, simplifyGeometry } from 'lodsmith/three';
import { bumpyBall, openEdges } from './shapes.mjs';

before(() => ready);

function ballGeometry(n) {
  const ball = bumpyBall(n);
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(ball.indices, 1));
  geometry.setAttribute('position', new THREE.BufferAttribute(ball.positions, 3));
  geometry.setAttribute('normal', new THREE.BufferAttribute(ball.normals, 3));
  geometry.setAttribute('uv', new THREE.BufferAttribute(ball.uvs, 2));
  return geometry;
}

const triangles = (geometry) => geometry.getIndex().count / 3;

test('a geometry keeps its attributes, groups and bounds', () => {
  const geometry = ballGeometry(40);
  const count = geometry.getAttribute('position').count;
  geometry.setAttribute('color', new THREE.BufferAttribute(new Uint8Array(3 * count).fill(51), 3, true));
  geometry.setAttribute('id', new THREE.BufferAttribute(new Int32Array(count).fill(-4), 1));
  geometry.setAttribute('heat', new THREE.Float32BufferAttribute(new Float32Array(count).fill(0.25), 1));
  geometry.addGroup(0, 3000, 1);
  geometry.addGroup(3000, Infinity, 0);
  geometry.computeBoundingSphere();
  geometry.userData.name = 'ball';
  let report;
  const small = simplifyGeometry(geometry, { ratio: 0.1, onReport: (r) => (report = r) });
  assert.ok(small instanceof THREE.BufferGeometry && small !== geometry);
  assert.equal(triangles(small), report.output.faces);
  assert.ok(triangles(small) <= 312 && triangles(small) > 290);
  assert.deepEqual(Object.keys(small.attributes).sort(), ['color', 'heat', 'id', 'normal', 'position', 'uv']);
  assert.ok(small.getAttribute('color').array instanceof Uint8Array && small.getAttribute('color').normalized);
  assert.ok(small.getAttribute('color').array.every((x) => x === 51));
  assert.ok(small.getAttribute('id').array.every((x) => x === -4));
  assert.deepEqual(small.groups.map((g) => g.materialIndex), [1, 0]);
  assert.equal(small.groups[0].count + small.groups[1].count, small.getIndex().count);
  assert.ok(small.boundingSphere.radius > 0.9);
  assert.deepEqual(small.userData, { name: 'ball' });
  const { array: positions } = small.getAttribute('position');
  assert.equal(openEdges({ positions, indices: small.getIndex().array }), 0);
  assert.equal(triangles(geometry), 3120, 'the input is as before');
});

test('geometries without an index and interleaved geometries are supported', () => {
  const geometry = ballGeometry(24);
  const soup = simplifyGeometry(geometry.toNonIndexed(), { ratio: 0.25 });
  assert.ok(triangles(soup) <= 276 && soup.getAttribute('position').count < 3 * triangles(soup));
  const count = geometry.getAttribute('position').count;
  const rows = new Float32Array(5 * count);
  for (let i = 0; i < count; i++) {
    rows.set(geometry.getAttribute('position').array.subarray(3 * i, 3 * i + 3), 5 * i);
    rows.set(geometry.getAttribute('uv').array.subarray(2 * i, 2 * i + 2), 5 * i + 3);
  }
  const buffer = new THREE.InterleavedBuffer(rows, 5);
  const woven = new THREE.BufferGeometry().setIndex(geometry.getIndex());
  woven.setAttribute('position', new THREE.InterleavedBufferAttribute(buffer, 3, 0));
  woven.setAttribute('uv', new THREE.InterleavedBufferAttribute(buffer, 2, 3));
  const plain = new THREE.BufferGeometry().setIndex(geometry.getIndex());
  for (const name of ['position', 'uv']) plain.setAttribute(name, geometry.getAttribute(name));
  const [a, b] = [woven, plain].map((g) => simplifyGeometry(g, { ratio: 0.25 }));
  for (const name of ['position', 'uv']) assert.deepEqual(a.getAttribute(name).array, b.getAttribute(name).array);
});

test('skins and morph targets of both kinds stay', () => {
  const results = [true, false].map((isRelative) => {
    const geometry = ballGeometry(24);
    const { array, count } = geometry.getAttribute('position');
    geometry.setAttribute('skinIndex', new THREE.Uint16BufferAttribute(new Uint16Array(4 * count).fill(1), 4));
    const weights = Float32Array.from({ length: 4 * count }, (_, i) => (i % 4 === 0 ? 1 : 0));
    geometry.setAttribute('skinWeight', new THREE.Float32BufferAttribute(weights, 4));
    // Twice as large.
    const target = isRelative ? array.slice() : array.map((x) => 2 * x);
    geometry.morphAttributes.position = [new THREE.Float32BufferAttribute(target, 3)];
    geometry.morphTargetsRelative = isRelative;
    return simplifyGeometry(geometry, { ratio: 0.25 });
  });
  for (const small of results) {
    const { array } = small.getAttribute('position');
    const target = small.morphAttributes.position[0].array;
    const factor = small.morphTargetsRelative ? 1 : 2;
    array.forEach((x, i) => assert.ok(Math.abs(target[i] - factor * x) < 0.15, `${target[i]} ${x}`));
    assert.ok(small.getAttribute('skinIndex').array instanceof Uint16Array);
    const { array: weights, count } = small.getAttribute('skinWeight');
    for (let i = 0; i < count; i++) assert.ok(Math.abs(weights[4 * i] - 1) < 1e-5);
  }
});

test('faces with invalid positions are named on the console', (t) => {
  const warn = t.mock.method(console, 'warn', () => {});
  const geometry = ballGeometry(16);
  geometry.getAttribute('position').array[3 * 40] = NaN;
  simplifyGeometry(geometry, { ratio: 0.5 });
  assert.deepEqual(warn.mock.calls.map((call) => call.arguments), [['lodsmith: 6 faces have a position that is not finite: removed']]);
});

test('wrong options are errors', () => {
  assert.throws(() => simplifyGeometry(ballGeometry(8), { rato: 0.5 }), TypeError);
  assert.throws(() => simplifyGeometry(new THREE.BufferGeometry(), { ratio: 0.5 }), TypeError);
});
