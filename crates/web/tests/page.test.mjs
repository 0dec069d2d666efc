import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';

import { WEBGPU, chromium, folder, openPage, puppeteer } from './browser.mjs';
import { bumpyBall, obj } from './models.mjs';

const command = process.env.LODSMITH;
const skip = (!chromium && 'no chromium') || (!puppeteer && 'no puppeteer-core') || (!folder && 'LODSMITH_WEB is not set') ||
  (!command && 'LODSMITH is not set');
const options = { skip, timeout: 300_000 };

const work = mkdtempSync(join(tmpdir(), 'lodsmith-web-'));
after(() => rmSync(work, { recursive: true }));
const lodsmith = (...args) => execFileSync(command, args, { encoding: 'utf8' });
/** Writes a model of 11,520 faces to a file of this name. */
const model = (name) => {
  const path = join(work, name);
  const text = join(work, 'source.obj');
  writeFileSync(text, obj(bumpyBall(120, 49)));
  lodsmith('convert', text, path, '--quiet');
  return path;
};
/** Waits for a download; returns its bytes. */
const downloaded = async (folder, name) => {
  for (let n = 0; n < 600; n++) {
    if (readdirSync(folder).includes(name)) return readFileSync(join(folder, name));
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`no ${name} among ${readdirSync(folder)}`);
};

test('a dropped model is simplified and downloaded, and nothing is sent', options, async () => {
  const downloads = join(work, 'downloads');
  mkdirSync(downloads);
  const user = await openPage({ downloads });
  try {
    await user.until((s) => s.original === null, 'empty');
    const loaded = user.requests.length;
    const path = model('ball.glb');
    await user.drop(path);
    const { original } = await user.until((s) => s.original && s.hasPreview && s.isIdle, 'opened');
    assert.deepEqual([original.path, original.faces], ['ball.glb', 11_520]);

    // The result follows the slider during the drag.
    const counts = [];
    await user.drag([0.9, 0.7, 0.5, 0.3, 0.6], async (before) => {
      await user.until((s) => s.result && s.result.faces !== before.result?.faces, 'a level');
      counts.push((await user.settled()).result.faces);
    });
    assert.ok(counts[0] > counts[1] && counts[1] > counts[2] && counts[2] > counts[3] && counts[3] < counts[4], `${counts}`);
    const exact = await user.until((s) => s.isIdle && s.result?.isExact, 'exact');
    assert.ok(exact.result.faces < original.faces);

    // The heat map.
    await user.page.keyboard.press('KeyE');
    const { distances } = await user.until((s) => s.distances && s.isIdle, 'measured');
    assert.ok(distances.largest > 0 && distances.rms <= distances.largest, JSON.stringify(distances));

    // The difference image.
    await user.click('Difference');
    const { difference } = await user.until((s) => s.difference !== null && s.isIdle, 'compared');
    assert.ok(difference > 0 && difference < 1, `${difference}`);

    // The download equals the output of the command that the window shows.
    await user.page.keyboard.down('Control');
    await user.page.keyboard.press('KeyS');
    await user.page.keyboard.up('Control');
    await user.click('Write');
    const bytes = await downloaded(downloads, 'ball_low.glb');
    const given = exact.command.split(' ').slice(3).filter((w, i, all) => w !== '-o' && all[i - 1] !== '-o');
    lodsmith('simplify', path, '-o', join(work, 'by-command.glb'), '--quiet', ...given);
    assert.ok(bytes.equals(readFileSync(join(work, 'by-command.glb'))), exact.command);

    assert.deepEqual(user.errors, []);
    const afterLoad = user.requests.slice(loaded).filter((url) => !url.startsWith('blob:'));
    assert.ok(afterLoad.every((url) => /\/some\/where\/(worker\.js|lodsmith\.js)$/.test(url)), `${afterLoad}`);
    assert.ok(user.requests.every((url) => url.startsWith(user.origin) || /^(blob|data):/.test(url)), `${user.requests}`);
  } finally {
    await user.close();
  }
});

test('a run is cancelled, and the next one works', options, async () => {
  const user = await openPage();
  try {
    const path = join(work, 'large.obj');
    writeFileSync(path, obj(bumpyBall(700, 350)));
    await user.until((s) => s.original === null, 'empty');
    await user.drop(path);
    await user.until((s) => s.progress?.job === 'Opening', 'opening');
    await user.click('Stop').catch(() => user.page.keyboard.press('Escape'));
    await user.until((s) => s.isIdle && s.original === null, 'cancelled');
    await user.drop(path);
    const { original } = await user.until((s) => s.original && s.isIdle, 'opened');
    assert.equal(original.faces, 2 * 700 * 349);
    assert.deepEqual(user.errors, []);
  } finally {
    await user.close();
  }
});

test('a folder and an archive with textures are opened', options, async () => {
  const downloads = join(work, 'textured');
  mkdirSync(downloads);
  const source = join(work, 'box');
  mkdirSync(join(source, 'tex'), { recursive: true });
  writeFileSync(join(source, 'box.obj'), obj(bumpyBall(24, 13), 'box.mtl', 'paint'));
  writeFileSync(join(source, 'box.mtl'), 'newmtl paint\nmap_Kd tex/paint.png\n');
  cpSync(new URL('./paint.png', import.meta.url), join(source, 'tex', 'paint.png'));
  execFileSync('python3', ['-m', 'zipfile', '-c', join(work, 'box.zip'), source]);
  for (const dropped of [source, join(work, 'box.zip')]) {
    const user = await openPage({ downloads });
    try {
      await user.until((s) => s.original === null, 'empty');
      await user.drop(dropped);
      const { original, problem } = await user.until((s) => s.original && s.isIdle, 'opened');
      assert.deepEqual([original.path, original.faces, problem], ['box/box.obj', 2 * 24 * 12, null]);
      const { rect: [x0, y0, x1, y1] } = await user.widget('Original');
      const clip = { x: x0, y: y0, width: x1 - x0, height: y1 - y0 };
      await user.page.screenshot({ path: join(downloads, 'seen.png'), clip });
      // Other files than models are refused with a message.
      await user.drop(join(source, 'tex', 'paint.png'));
      const refused = await user.until((s) => s.problem, 'refused');
      assert.match(refused.problem, /none of the 1 files is a model/);
      assert.equal(refused.original.faces, original.faces);
      assert.deepEqual(user.errors, []);
    } finally {
      await user.close();
    }
  }
});

test('all model formats are opened, and broken files refused', options, async () => {
  const user = await openPage();
  try {
    await user.until((s) => s.original === null, 'empty');
    for (const name of ['ball.ply', 'ball.stl', 'ball.obj', 'ball.off', 'ball.gltf', 'ball.3mf']) {
      await user.drop(model(name));
      const { original, problem } = await user.until((s) => s.original?.path === name || s.problem, name);
      assert.deepEqual([problem, original.faces], [null, 11_520], name);
    }
    for (const name of ['broken.glb', 'broken.zip']) {
      const broken = join(work, name);
      writeFileSync(broken, 'glTF nothing more');
      await user.drop(broken);
      const { problem, original } = await user.until((s) => s.problem?.includes(name), 'refused');
      assert.match(problem, /^broken\./);
      assert.equal(original.faces, 11_520);
    }
  } finally {
    await user.close();
  }
});

const webGpuOptions = { ...options, skip: options.skip || (process.env.LODSMITH_NO_WEBGPU ? 'no adapter for WebGPU' : false) };

test('the page works with WebGPU', webGpuOptions, async () => {
  const user = await openPage({ flags: WEBGPU });
  try {
    await user.until((s) => s.original === null, 'empty');
    await user.drop(model('ball.ply'));
    const { adapter, original } = await user.until((s) => s.original && s.isIdle, 'opened');
    assert.equal(original.faces, 11_520);
    assert.match(adapter, /WebGpu/);
    assert.deepEqual(user.errors, []);
  } finally {
    await user.close();
  }
});
