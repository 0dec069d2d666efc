import assert from 'node:assert/strict';
import { copyFile, mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { BufferAttribute, BufferGeometry } from 'three';
import { testdata } from './command.mjs';
import { bumpyBall } from './shapes.mjs';

const page = process.env.LODSMITH_DOCS;
const here = fileURLToPath(new URL('.', import.meta.url));

test('the examples of the page run', { skip: !(page && testdata) && 'LODSMITH_DOCS is not set' }, async () => {
  const blocks = [...(await readFile(page, 'utf8')).matchAll(/^```js\n([\s\S]*?)^```$/gm)].map((match) => match[1]);
  assert.ok(blocks.length >= 6, `${blocks.length} examples`);
  const ball = bumpyBall(24);
  const geometry = new BufferGeometry().setIndex(new BufferAttribute(ball.indices, 1));
  geometry.setAttribute('position', new BufferAttribute(ball.positions, 3));
  // Variables that the examples use.
  Object.assign(globalThis, ball, { geometry });
  const log = console.log;
  const folder = await mkdtemp(join(here, 'docs-'));
  const before = process.cwd();
  try {
    await copyFile(join(testdata, 'wave.glb'), join(folder, 'model.glb'));
    process.chdir(folder);
    console.log = () => {};
    for (const [i, block] of blocks.entries()) {
      const path = join(folder, `example${i}.mjs`);
      await writeFile(path, block);
      await import(pathToFileURL(path).href);
    }
    const small = await readFile(join(folder, 'small.glb'));
    assert.equal(small.toString('latin1', 0, 4), 'glTF');
  } finally {
    console.log = log;
    process.chdir(before);
    await rm(folder, { recursive: true });
  }
});
