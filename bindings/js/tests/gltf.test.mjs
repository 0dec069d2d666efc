import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { before, test } from 'node:test';
import { Document, NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS } from '@gltf-transform/extensions';
import { simplify, weld } from '@gltf-transform/functions';
import { LodsmithSimplifier, lodsmith } from 'lodsmith/gltf-transform';
import { simplifyGlb } from 'lodsmith/glb';
import { testdata } from './command.mjs';
import { bumpyBall, openEdges } from './shapes.mjs';

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS);
const skip = !testdata && 'LODSMITH_TESTDATA is not set';
const read = async (name) => io.readBinary(new Uint8Array(await readFile(join(testdata, name))));

before(() => LodsmithSimplifier.ready);

function faces(document) {
  const count = (p) => (p.getIndices() ?? p.getAttribute('POSITION')).getCount() / 3;
  return document.getRoot().listMeshes().flatMap((m) => m.listPrimitives()).reduce((n, p) => n + count(p), 0);
}

/** A document with the sphere as a mesh of two primitives, and two instances of a smaller one. */
function ballDocument() {
  const document = new Document();
  const buffer = document.createBuffer();
  const accessor = (type, array, isNormalized = false) =>
    document.createAccessor().setType(type).setArray(array).setNormalized(isNormalized).setBuffer(buffer);
  const scene = document.createScene();
  const of = (n, cut) => {
    const ball = bumpyBall(n);
    const count = ball.positions.length / 3;
    const colors = Uint8Array.from({ length: 4 * count }, (_, i) => (i % 4 === 3 ? 255 : 40));
    const ids = Uint16Array.from({ length: count }, () => 5);
    const mesh = document.createMesh();
    const parts = cut ? [ball.indices.slice(0, cut), ball.indices.slice(cut)] : [ball.indices];
    for (const indices of parts) {
      mesh.addPrimitive(
        document
          .createPrimitive()
          .setIndices(accessor('SCALAR', indices))
          .setMaterial(document.createMaterial())
          .setAttribute('POSITION', accessor('VEC3', ball.positions))
          .setAttribute('NORMAL', accessor('VEC3', ball.normals))
          .setAttribute('TEXCOORD_0', accessor('VEC2', Uint16Array.from(ball.uvs, (x) => Math.round(65535 * x)), true))
          .setAttribute('COLOR_0', accessor('VEC4', colors, true))
          .setAttribute('_ID', accessor('SCALAR', ids)),
      );
    }
    return mesh;
  };
  scene.addChild(document.createNode().setMesh(of(40, 3 * 1200)));
  const small = of(20);
  scene.addChild(document.createNode().setMesh(small).setTranslation([3, 0, 0]));
  scene.addChild(document.createNode().setMesh(small).setTranslation([6, 0, 0]).setScale([2, 2, 2]));
  document.getRoot().setDefaultScene(scene);
  return document;
}

test('simplify of glTF Transform takes the simplifier', { skip }, async () => {
  for (const name of ['wave.glb', 'arm.glb', 'wave_meshopt_khr.glb']) {
    const document = await read(name).catch(() => null);
    if (document === null) continue; // (Its decoder is in another package.)
    const before = faces(document);
    await document.transform(weld(), simplify({ simplifier: LodsmithSimplifier, ratio: 0.5, error: 1 }));
    const left = faces(document);
    assert.ok(left > 0 && left < before, `${name}: ${left} of ${before}`);
    await io.writeBinary(document);
  }
});

test('simplify of glTF Transform stops by error', async () => {
  const of = async (error) => {
    const document = ballDocument();
    await document.transform(weld(), simplify({ simplifier: LodsmithSimplifier, ratio: 0, error }));
    return faces(document);
  };
  const [fine, coarse] = [await of(0.003), await of(0.02)];
  assert.ok(coarse < fine && fine < faces(ballDocument()), `${coarse} ${fine}`);
});

test('the transform has one target for all meshes, and keeps the types of attributes', async () => {
  const document = ballDocument();
  const instances = (d) => {
    const [a, b] = d.getRoot().listMeshes().map((m) => m.listPrimitives().reduce((n, p) => n + p.getIndices().getCount() / 3, 0));
    return a + 2 * b;
  };
  const before = instances(document);
  let report;
  await document.transform(lodsmith({ ratio: 0.2, onReport: (r) => (report = r) }));
  assert.equal(report.reached, true);
  assert.equal(report.input.faces, before);
  assert.equal(report.output.faces, instances(document));
  assert.ok(instances(document) <= before * 0.2 && instances(document) > before * 0.19);
  const again = await io.readBinary(await io.writeBinary(document));
  const [mesh] = again.getRoot().listMeshes();
  assert.equal(mesh.listPrimitives().length, 2);
  const all = { positions: [], indices: [] };
  for (const primitive of mesh.listPrimitives()) {
    const get = (name) => primitive.getAttribute(name);
    const count = get('POSITION').getCount();
    assert.ok(get('NORMAL').getArray() instanceof Float32Array && get('NORMAL').getCount() === count);
    assert.ok(get('TEXCOORD_0').getArray() instanceof Uint16Array && get('TEXCOORD_0').getNormalized());
    assert.deepEqual(Array.from(get('COLOR_0').getArray().slice(0, 4)), [40, 40, 40, 255]);
    assert.ok(get('_ID').getArray() instanceof Uint16Array && get('_ID').getArray().every((x) => x === 5));
    const base = all.positions.length / 3;
    all.positions.push(...get('POSITION').getArray());
    all.indices.push(...Array.from(primitive.getIndices().getArray(), (i) => base + i));
    // Texture coordinates still agree with the positions.
    const [p, uv] = [get('POSITION').getElement(0, []), get('TEXCOORD_0').getElement(0, [])];
    assert.ok(Math.abs(Math.acos(p[1] / Math.hypot(...p)) / Math.PI - uv[1]) < 0.05);
  }
  all.positions = Float32Array.from(all.positions);
  assert.equal(openEdges(all), 0, 'primitives that touch stay connected');
});

test('skins, morph targets and animations stay', { skip }, async () => {
  const document = await read('arm.glb');
  const about = (d) => ({
    animations: d.getRoot().listAnimations().length,
    skins: d.getRoot().listSkins().length,
    primitives: d.getRoot().listMeshes().flatMap((m) => m.listPrimitives()).map((p) => ({
      semantics: p.listSemantics().sort(),
      types: p.listAttributes().map((a) => a.getComponentType()).sort(),
      targets: p.listTargets().map((t) => t.listSemantics().sort()),
    })),
  });
  const [before, count] = [about(document), faces(document)];
  await document.transform(lodsmith({ ratio: 0.5 }));
  const again = await io.readBinary(await io.writeBinary(document));
  assert.deepEqual(about(again), before);
  assert.ok(faces(again) <= count / 2 && faces(again) > 0);
  for (const mesh of again.getRoot().listMeshes()) {
    for (const primitive of mesh.listPrimitives()) {
      const weights = primitive.getAttribute('WEIGHTS_0');
      if (!weights) continue;
      for (let i = 0; i < weights.getCount(); i++) {
        const sum = weights.getElement(i, []).reduce((a, b) => a + b, 0);
        assert.ok(Math.abs(sum - 1) < 0.02, `weights ${sum}`);
      }
    }
  }
});

test('strips and fans become triangles, and lines stay', async () => {
  const document = new Document();
  const buffer = document.createBuffer();
  const positions = new Float32Array(3 * 102);
  for (let i = 0; i < 102; i++) positions.set([Math.floor(i / 2), i % 2, 0], 3 * i);
  const accessor = () => document.createAccessor().setType('VEC3').setArray(positions.slice()).setBuffer(buffer);
  const primitive = (mode) => document.createPrimitive().setMode(mode).setAttribute('POSITION', accessor());
  const mesh = document.createMesh().addPrimitive(primitive(5)).addPrimitive(primitive(1));
  document.createScene().addChild(document.createNode().setMesh(mesh));
  await document.transform(lodsmith({ ratio: 0.1 }));
  const [strip, lines] = mesh.listPrimitives();
  assert.equal(strip.getMode(), 4);
  assert.ok(strip.getIndices().getCount() <= 30);
  assert.deepEqual(lines.getAttribute('POSITION').getArray(), positions);
});

test('a file and its document have the same result', { skip }, async () => {
  for (const name of ['wave.glb', 'arm.glb']) {
    const bytes = new Uint8Array(await readFile(join(testdata, name)));
    const [document, whole] = [await io.readBinary(bytes), await simplifyGlb(bytes, { ratio: 0.4 })];
    await document.transform(lodsmith({ ratio: 0.4 }));
    assert.equal(faces(document), faces(await io.readBinary(whole.bytes)), name);
  }
});
