// The package in bundles for browsers, made as the page says.
import assert from 'node:assert/strict';
import { cp, mkdtemp, readFile, readdir, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { open, skip as noChromium } from './chromium.mjs';

const here = fileURLToPath(new URL('.', import.meta.url));
const installed = (name) => import(name).catch(() => null);
const [esbuild, vite] = [await installed('esbuild'), await installed('vite')];
const lodsmith = join(here, 'node_modules/lodsmith');

/** Calls a function with a folder in which packages are found. */
async function inFolder(work) {
  const folder = await mkdtemp(join(here, 'bundle-'));
  try {
    return await work(folder);
  } finally {
    await rm(folder, { recursive: true });
  }
}

const GEOMETRY = `
import { BufferAttribute, BufferGeometry } from 'three';
import { ready, simplifyGeometry } from 'lodsmith/three';
import { bumpyBall } from '../shapes.mjs';

export async function run() {
  await ready;
  const { positions, indices } = bumpyBall(24);
  const geometry = new BufferGeometry().setIndex(new BufferAttribute(indices, 1));
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  return simplifyGeometry(geometry, { faces: 200 }).getIndex().count / 3;
}`;

test('esbuild bundles lodsmith/three', { skip: !esbuild && 'no esbuild' }, async () => {
  await inFolder(async (folder) => {
    await writeFile(join(folder, 'app.js'), GEOMETRY);
    const out = join(folder, 'out');
    const entryPoints = [join(folder, 'app.js'), join(lodsmith, 'worker-entry.js')];
    const options = { bundle: true, minify: true, format: 'esm', outdir: out, entryNames: '[name]', logLevel: 'silent' };
    const { errors } = await esbuild.build({ entryPoints, ...options }).catch((error) => error);
    assert.deepEqual(errors, []);
    await cp(join(lodsmith, 'wasm/lodsmith_bg.wasm'), join(out, 'wasm/lodsmith_bg.wasm'));
    const fetched = globalThis.fetch;
    globalThis.fetch = async (url) => new Response(await readFile(url), { headers: { 'content-type': 'application/wasm' } });
    try {
      const { run } = await import(pathToFileURL(join(out, 'app.js')).href);
      const faces = await run();
      assert.ok(faces > 150 && faces <= 200, `${faces}`);
    } finally {
      globalThis.fetch = fetched;
    }
    assert.match(await readFile(join(out, 'worker-entry.js'), 'utf8'), /addEventListener/);
  });
});

test('esbuild bundles the package for Node', { skip: !esbuild && 'no esbuild' }, async () => {
  await inFolder(async (folder) => {
    await writeFile(join(folder, 'app.js'), GEOMETRY);
    const options = { bundle: true, format: 'esm', platform: 'node', outfile: join(folder, 'out/app.mjs') };
    await esbuild.build({ entryPoints: [join(folder, 'app.js')], logLevel: 'silent', ...options });
    await cp(join(lodsmith, 'wasm/lodsmith_bg.wasm'), join(folder, 'out/wasm/lodsmith_bg.wasm'));
    const { run } = await import(pathToFileURL(join(folder, 'out/app.mjs')).href);
    assert.ok((await run()) <= 200);
  });
});

const PAGE = `<!doctype html><script type="module" src="./app.js"></script>`;
const WORKER = `
import { createWorker } from 'lodsmith/worker';
import { bumpyBall } from '../shapes.mjs';

const worker = createWorker();
const { positions, indices } = bumpyBall(24);
const found = worker.simplifyMesh({ positions, indices }, { faces: 200 }).then(async (small) => {
  const name = await worker.simplifyGlb(new Uint8Array(4), { ratio: 0.5 }).catch((error) => error.name);
  return { faces: small.indices.length / 3, name };
});
found.then((done) => (window.done = done), (error) => (window.done = { error: String(error.stack) }));`;

test('Vite builds lodsmith/worker', { skip: !vite && 'no vite', timeout: 240_000 }, async () => {
  await inFolder(async (folder) => {
    await writeFile(join(folder, 'index.html'), PAGE);
    await writeFile(join(folder, 'app.js'), WORKER);
    await vite.build({ root: folder, configFile: false, logLevel: 'silent', build: { outDir: 'dist' } });
    const names = (await readdir(join(folder, 'dist/assets'))).map((name) => name.replace(/-[\w-]{8}\./, '.')).sort();
    assert.deepEqual(names.filter((name) => !name.startsWith('index')), ['lodsmith_bg.wasm', 'lodsmith_files_bg.wasm', 'worker-entry.js']);
    if (noChromium) return;
    const { done, errors } = await open(join(folder, 'dist'), 'index.html');
    assert.deepEqual({ done, errors }, { done: { faces: 200, name: 'RangeError' }, errors: [] });
  });
});
