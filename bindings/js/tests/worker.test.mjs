import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { ready, simplifyMesh } from 'lodsmith';
import { simplifyGlb } from 'lodsmith/glb';
import { createWorker } from 'lodsmith/worker';
import { testdata } from './command.mjs';
import { bumpyBall } from './shapes.mjs';

const worker = createWorker();
before(() => ready);
after(() => worker.terminate());

test('a worker has the same results, and reports its progress', async () => {
  const ball = bumpyBall(30);
  const calls = [];
  const small = await worker.simplifyMesh(ball, { ratio: 0.2 }, { onProgress: (...args) => void calls.push(args) });
  assert.deepEqual(small, simplifyMesh(ball, { ratio: 0.2 }));
  assert.ok(calls.length > 0 && calls.every(([done, stage]) => done >= 0 && done <= 1 && typeof stage === 'string'));
  assert.equal(ball.indices.length, 30 * 29 * 6, 'the input is as before');
});

test('whole files go through a worker', { skip: !testdata && 'LODSMITH_TESTDATA is not set' }, async () => {
  const bytes = new Uint8Array(await readFile(join(testdata, 'wave.glb')));
  const made = [await worker.simplifyGlb(bytes, { ratio: 0.3 }), await simplifyGlb(bytes, { ratio: 0.3 })];
  for (const { report } of made) {
    assert.ok(report.seconds.simplify > 0);
    delete report.seconds;
  }
  assert.deepEqual(...made);
});

test('errors are of the same kinds', async () => {
  const ball = bumpyBall(8);
  await assert.rejects(worker.simplifyMesh(ball, { rato: 0.2 }), { constructor: TypeError, message: /similar one is ratio/ });
  await assert.rejects(worker.simplifyMesh(ball, { ratio: 7 }), RangeError);
});

test('a run is cancelled, and later runs are not', async () => {
  const control = new AbortController();
  const ball = bumpyBall(300);
  const run = worker.simplifyMesh(ball, { ratio: 0.01 }, { signal: control.signal, onProgress: () => control.abort() });
  const next = worker.simplifyMesh(bumpyBall(10), { faces: 60 });
  await assert.rejects(run, { name: 'AbortError' });
  assert.equal((await next).indices.length, 180);
  await assert.rejects(worker.simplifyMesh(ball, { ratio: 0.1 }, { signal: AbortSignal.abort() }), { name: 'AbortError' });
});

test('an exception of the progress function ends the run', async () => {
  const onProgress = () => {
    throw new RangeError('enough');
  };
  await assert.rejects(worker.simplifyMesh(bumpyBall(60), { ratio: 0.1 }, { onProgress }), { message: 'enough' });
  assert.equal((await worker.simplifyMesh(bumpyBall(10), { faces: 60 })).indices.length, 180);
});

test('an ended worker refuses runs', async () => {
  const own = createWorker();
  const run = own.simplifyMesh(bumpyBall(100), { ratio: 0.1 });
  own.terminate();
  await assert.rejects(run, /ended/);
  await assert.rejects(own.simplifyMesh(bumpyBall(8), { ratio: 0.1 }), /ended/);
});
