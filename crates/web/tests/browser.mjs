// The page in a browser, for tests and measurements: a server for the folder of the page, Chromium with a software
// renderer, and the actions of a user.
import { createServer } from 'node:http';
import { existsSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize, resolve } from 'node:path';

export const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
export const puppeteer = await import('puppeteer-core').then((m) => m.default, () => null);
/** The folder that `cargo xtask web` has made. */
export const folder = process.env.LODSMITH_WEB && resolve(process.env.LODSMITH_WEB);

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
/** The page must work on any static host: below a path, without special headers. */
const PATH = '/some/where/';

/** WebGL 2 on the CPU. */
const GL = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
/** WebGPU on the CPU. */
export const WEBGPU = [
  '--enable-unsafe-webgpu', '--use-webgpu-adapter=swiftshader', '--enable-features=Vulkan', '--use-vulkan=swiftshader',
  '--use-angle=vulkan', '--ignore-gpu-blocklist',
];

async function serve() {
  const server = createServer(async ({ url }, answer) => {
    const path = new URL(url, 'http://localhost').pathname;
    const file = normalize(join(folder, decodeURIComponent(path.slice(PATH.length)) || 'index.html'));
    try {
      if (!path.startsWith(PATH) || !file.startsWith(folder)) throw new Error('outside');
      const bytes = await readFile(file);
      answer.writeHead(200, { 'content-type': TYPES[extname(file)] ?? 'application/octet-stream' }).end(bytes);
    } catch {
      answer.writeHead(404).end();
    }
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return server;
}

/** Opens the page in a browser; returns the actions of a user. */
export async function openPage({ flags = GL, size = [1280, 800], downloads = null } = {}) {
  const server = await serve();
  const origin = `http://127.0.0.1:${server.address().port}`;
  const browser = await puppeteer.launch({
    executablePath: chromium,
    headless: true,
    args: ['--no-sandbox', '--force-device-scale-factor=1', ...flags],
    defaultViewport: { width: size[0], height: size[1] },
  });
  const page = await browser.newPage();
  const requests = [];
  const errors = [];
  page.on('request', (request) => requests.push(request.url()));
  page.on('pageerror', (error) => errors.push(String(error)));
  page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  const devtools = await page.createCDPSession();
  if (downloads) {
    const ofBrowser = await browser.target().createCDPSession();
    await ofBrowser.send('Browser.setDownloadBehavior', { behavior: 'allow', downloadPath: downloads });
  }
  await page.goto(origin + PATH);

  const state = () => page.evaluate(() => globalThis.lodsmith?.state());
  /** Waits until the state meets a condition, and returns the state. */
  const until = async (isMet, what, limit = 120_000) => {
    const end = Date.now() + limit;
    for (;;) {
      const now = await state();
      if (now && isMet(now)) return now;
      if (Date.now() > end) throw new Error(`never ${what}: ${JSON.stringify(now)} ${errors.join('\n')}`);
      await new Promise((done) => setTimeout(done, 20));
    }
  };
  /** Waits until the result has not changed for a second, and returns the state. */
  const settled = async () => {
    for (let before = await state(); ; ) {
      await new Promise((done) => setTimeout(done, 1000));
      const now = await state();
      if (now.isIdle && JSON.stringify(now.result) === JSON.stringify(before.result)) return now;
      before = now;
    }
  };
  /** Waits for the widget with this name; returns its role, value and rectangle. */
  const widget = async (name, limit = 20_000) => {
    const end = Date.now() + limit;
    for (;;) {
      const all = await page.evaluate(() => globalThis.lodsmith.widgets());
      const found = all.find((w) => (name instanceof RegExp ? name.test(w.name) : w.name === name));
      if (found) return found;
      if (Date.now() > end) throw new Error(`no widget ${name} among ${all.map((w) => w.name).join(' | ')}`);
      await new Promise((done) => setTimeout(done, 30));
    }
  };
  const middle = ({ rect: [x0, y0, x1, y1] }) => [(x0 + x1) / 2, (y0 + y1) / 2];
  return {
    browser, page, requests, errors, origin, state, until, settled, widget,
    async click(name) {
      await page.mouse.click(...middle(await widget(name)));
    },
    /** Drops local files or folders on the window. */
    async drop(...files) {
      const data = { items: [], files: files.map((f) => resolve(f)), dragOperationsMask: 1 };
      for (const type of ['dragEnter', 'dragOver', 'drop']) {
        await devtools.send('Input.dispatchDragEvent', { type, x: 640, y: 360, data });
      }
    },
    /** Drags the target slider to positions from 0 to 1; calls `at` at each of them, with the state before. */
    async drag(positions, at = async () => {}) {
      const { rect: [x0, y0, x1] } = await widget('Target slider');
      const point = (position) => [x0 + 10 + (x1 - x0 - 20) * position, y0 + 13];
      // Pressing the button without moving the mouse is not a drag yet.
      await page.mouse.move(...point(positions[0] - 0.05));
      await page.mouse.down();
      for (const position of positions) {
        const before = await state();
        await page.mouse.move(...point(position));
        await at(before);
      }
      await page.mouse.up();
    },
    async close() {
      await browser.close();
      server.close();
    },
  };
}
