import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { open, skip } from './chromium.mjs';

test('the package works in a browser', { skip, timeout: 120_000 }, async () => {
  const { done, errors } = await open(fileURLToPath(new URL('.', import.meta.url)), 'browser.html');
  assert.deepEqual(errors, []);
  assert.equal(done.error, undefined);
  assert.deepEqual(done.attributes, ['normal', 'position', 'uv']);
  assert.ok(done.faces > 290 && done.faces <= 312, `${done.faces}`);
  assert.ok(done.pixels > 1000, `the simplified ball is seen in ${done.pixels} pixels`);
  assert.ok(done.isSameInWorker && done.progressCalls > 0);
  assert.equal(done.cancelled, 'AbortError');
  assert.equal(done.notGlb, 'RangeError');
});
