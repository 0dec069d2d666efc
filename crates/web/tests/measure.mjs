// Measures the page: time to the first frame, frames per second while the slider is dragged, memory.
//
// usage: LODSMITH_WEB=FOLDER node measure.mjs MODEL [SCREENSHOT.png]
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';

import { openPage } from './browser.mjs';

/** Seconds of dragging. */
const DRAG_SECS = 6;

/** Returns the proportional memory (PSS) in MB of the processes of a browser, by kind. */
function memory(browser) {
  const main = browser.process().pid;
  const all = execFileSync('ps', ['-eo', 'pid,ppid,args', '--no-headers'], { encoding: 'utf8' }).split('\n');
  const rows = all.map((line) => line.trim().match(/^(\d+)\s+(\d+)\s+(.*)$/)).filter(Boolean).map(([, pid, ppid, args]) => ({ pid: +pid, ppid: +ppid, args }));
  const own = new Set([main]);
  for (let n = 0; n < 5; n++) rows.filter((r) => own.has(r.ppid)).forEach((r) => own.add(r.pid));
  const kinds = {};
  for (const { pid, args } of rows.filter((r) => own.has(r.pid))) {
    const kind = args.match(/--type=(\S+)/)?.[1] ?? 'browser';
    try {
      const pss = +readFileSync(`/proc/${pid}/smaps_rollup`, 'utf8').match(/Pss:\s+(\d+) kB/)[1];
      kinds[kind] = Math.round((kinds[kind] ?? 0) + pss / 1024);
    } catch {
      // The process has just ended.
    }
  }
  return kinds;
}

const [path, screenshot] = process.argv.slice(2);
const started = Date.now();
const user = await openPage({ size: [1440, 900] });
await user.until((s) => s.original === null, 'empty');
console.log(`page ready after ${((Date.now() - started) / 1000).toFixed(2)} s (browser start included)`);
console.log(`memory, empty: ${JSON.stringify(memory(user.browser))} MB`);
const dropped = Date.now();
await user.drop(path);
const { original, adapter } = await user.until((s) => s.original && s.isDrawn, 'opened');
console.log(`${original.faces} faces drawn ${((Date.now() - dropped) / 1000).toFixed(2)} s after the drop, by ${adapter}`);
await user.until((s) => s.hasPreview && s.isIdle, 'ready for the slider', 600_000);
console.log(`slider ready ${((Date.now() - dropped) / 1000).toFixed(2)} s after the drop`);
console.log(`memory: ${JSON.stringify(memory(user.browser))} MB`);

// Counts the frames that show another level.
await user.page.evaluate(() => {
  const seen = { times: [], faces: null, isRunning: true };
  globalThis.seen = seen;
  const observe = () => {
    const { result } = globalThis.lodsmith.state();
    if (result && result.faces !== seen.faces) {
      seen.faces = result.faces;
      seen.times.push(performance.now());
    }
    if (seen.isRunning) requestAnimationFrame(observe);
  };
  requestAnimationFrame(observe);
});
const end = Date.now() + DRAG_SECS * 1000;
const sweep = function* () {
  for (let n = 0; ; n++) yield 0.9 - 0.6 * (0.5 - 0.5 * Math.cos(n / 25));
};
const at = sweep();
const rect = (await user.widget('Target slider')).rect;
const point = (position) => [rect[0] + 10 + (rect[2] - rect[0] - 20) * position, rect[1] + 13];
await user.page.mouse.move(...point(at.next().value));
await user.page.mouse.down();
while (Date.now() < end) {
  await user.page.mouse.move(...point(at.next().value));
  await new Promise((done) => setTimeout(done, 12));
}
const times = await user.page.evaluate(() => ((globalThis.seen.isRunning = false), globalThis.seen.times));
await user.page.mouse.up();
const gaps = times.slice(1).map((t, i) => t - times[i]);
const rate = (1000 * gaps.length) / (times.at(-1) - times[0]);
console.log(`slider: ${rate.toFixed(1)} frames per second, longest gap ${(Math.max(...gaps) / 1000).toFixed(2)} s (${times.length} levels)`);
await user.until((s) => s.isIdle && s.result?.isExact, 'exact', 600_000);
console.log(`memory at the end: ${JSON.stringify(memory(user.browser))} MB`);
if (screenshot) await user.page.screenshot({ path: screenshot });
console.log(`errors: ${JSON.stringify(user.errors)}`);
await user.close();
