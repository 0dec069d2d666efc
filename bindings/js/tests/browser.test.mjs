import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('.', import.meta.url));
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
const puppeteer = await import('puppeteer-core').then((m) => m.default, () => null);
const skip = (!chromium && 'no chromium') || (!puppeteer && 'no puppeteer-core');

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.wasm': 'application/wasm' };

/** Serves this folder, with the packages in it. */
async function serve() {
  const server = createServer(async ({ url }, answer) => {
    const path = normalize(join(here, decodeURIComponent(new URL(url, 'http://localhost').pathname)));
    try {
      if (!path.startsWith(here)) throw new Error('outside');
      const bytes = await readFile(path);
      answer.writeHead(200, { 'content-type': TYPES[extname(path)] ?? 'application/octet-stream' }).end(bytes);
    } catch {
      answer.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  return server;
}

test('the package works in a browser', { skip, timeout: 120_000 }, async () => {
  const server = await serve();
  const browser = await puppeteer.launch({ executablePath: chromium, headless: true, args: ['--no-sandbox'] });
  try {
    const page = await browser.newPage();
    const errors = [];
    page.on('pageerror', (error) => errors.push(String(error)));
    await page.goto(`http://127.0.0.1:${server.address().port}/browser.html`);
    await page.waitForFunction('window.done !== undefined', { timeout: 100_000 }).catch((error) => {
      throw new Error(`${error.message} ${errors}`);
    });
    const done = await page.evaluate('window.done');
    assert.deepEqual(errors, []);
    assert.equal(done.error, undefined);
    assert.deepEqual(done.attributes, ['normal', 'position', 'uv']);
    assert.ok(done.faces > 290 && done.faces <= 312, `${done.faces}`);
    assert.ok(done.pixels > 1000, `the simplified ball is seen in ${done.pixels} pixels`);
    assert.ok(done.isSameInWorker && done.progressCalls > 0);
    assert.equal(done.cancelled, 'AbortError');
    assert.equal(done.notGlb, 'RangeError');
  } finally {
    await browser.close();
    server.close();
  }
});
