// Pages in headless Chromium, if it is installed.
import { existsSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';

const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
const puppeteer = await import('puppeteer-core').then((m) => m.default, () => null);
/** Why there are no pages, or false. */
export const skip = (!chromium && 'no chromium') || (!puppeteer && 'no puppeteer-core');

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.wasm': 'application/wasm' };

/** Serves a folder. */
async function serve(folder) {
  const server = createServer(async ({ url }, answer) => {
    const path = normalize(join(folder, decodeURIComponent(new URL(url, 'http://localhost').pathname)));
    try {
      if (!path.startsWith(folder)) throw new Error('outside');
      const bytes = await readFile(path);
      answer.writeHead(200, { 'content-type': TYPES[extname(path)] ?? 'application/octet-stream' }).end(bytes);
    } catch {
      answer.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  return server;
}

/** Opens a page of a folder; returns the value that it gives to `window.done`, and its errors. */
export async function open(folder, name) {
  const server = await serve(folder);
  const browser = await puppeteer.launch({ executablePath: chromium, headless: true, args: ['--no-sandbox'] });
  try {
    const page = await browser.newPage();
    const errors = [];
    page.on('pageerror', (error) => errors.push(String(error)));
    await page.goto(`http://127.0.0.1:${server.address().port}/${name}`);
    await page.waitForFunction('window.done !== undefined', { timeout: 100_000 }).catch((error) => {
      throw new Error(`${error.message} ${errors}`);
    });
    return { done: await page.evaluate('window.done'), errors };
  } finally {
    await browser.close();
    server.close();
  }
}
