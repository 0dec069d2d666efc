import assert from 'node:assert/strict';
import { readFile, readdir } from 'node:fs/promises';
import { join } from 'node:path';
import { test } from 'node:test';
import { simplifyGlb } from 'lodsmith/glb';
import { command, simplifyFile, testdata } from './command.mjs';

const skip = (!testdata && 'LODSMITH_TESTDATA is not set') || (!command && 'LODSMITH is not set');
/** Folder of additional models to compare, if set. */
const models = process.env.LODSMITH_MODELS;

async function files() {
  const all = (await readdir(testdata)).filter((name) => name.endsWith('.glb')).map((name) => join(testdata, name));
  if (models) {
    const more = await readdir(models, { recursive: true });
    all.push(...more.filter((name) => name.endsWith('.glb')).map((name) => join(models, name)));
  }
  return all;
}

test('files have the same bytes as from the command', { skip }, async () => {
  for (const path of await files()) {
    const bytes = await readFile(path);
    for (const [given, typed] of [
      [{ ratio: 0.3 }, ['--ratio', '0.3']],
      [{ faces: 60, topology: 'preserve', weight: { normal: 2 } }, ['--faces', '60', '--topology', 'preserve', '--weight', 'normal=2']],
      [{ error: '1%' }, ['--error', '1%']],
      [{ ratio: 0.2, method: 'cluster' }, ['--ratio', '0.2', '--method', 'cluster']],
      [{ ratio: 0.3, compress: 'meshopt', quantize: true }, ['--ratio', '0.3', '--compress', 'meshopt', '--quantize']],
    ]) {
      let expected;
      try {
        expected = simplifyFile(bytes, 'glb', typed);
      } catch (error) {
        await assert.rejects(simplifyGlb(bytes, given), RangeError, `${path} ${typed}: ${error.stderr}`);
        continue;
      }
      const { bytes: made } = await simplifyGlb(bytes, given);
      assert.ok(Buffer.from(made).equals(expected), `${path} ${typed.join(' ')}`);
    }
  }
});

test('other files than GLB are an error', async () => {
  await assert.rejects(simplifyGlb(new Uint8Array(0), { ratio: 0.5 }), RangeError);
  await assert.rejects(simplifyGlb(new TextEncoder().encode('solid x'), { ratio: 0.5 }), RangeError);
  await assert.rejects(simplifyGlb(new Uint8Array(0), { rato: 0.5 }), TypeError);
  await assert.rejects(simplifyGlb(new Uint8Array(0), { ratio: 0.5, compress: 'zip' }), RangeError);
  await assert.rejects(simplifyGlb(new Uint8Array(0), { ratio: 0.5, quantize: 8 }), RangeError);
});

test('an exception of the progress function is not lost', { skip: !testdata && skip }, async () => {
  const onProgress = () => {
    throw new RangeError('enough');
  };
  await assert.rejects(simplifyGlb(await readFile(join(testdata, 'wave.glb')), { ratio: 0.5, onProgress }), { message: 'enough' });
});

test('a truncated file is an error, and the module still works', { skip: !testdata && skip }, async () => {
  const bytes = new Uint8Array(await readFile(join(testdata, 'wave.glb')));
  await assert.rejects(simplifyGlb(bytes.subarray(0, bytes.length / 2), { ratio: 0.5 }), RangeError);
  const { report, warnings } = await simplifyGlb(bytes.buffer, { ratio: 0.5 });
  assert.equal(report.reached, true);
  assert.deepEqual(warnings, []);
});
