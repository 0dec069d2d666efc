// Runs in a worker of Node. The documentation is in worker.d.ts.
import { Worker } from 'node:worker_threads';
import { workerOf } from '../worker-queue.js';

/** Starts a worker. The functions are called with each message, and with an error. */
function start(onMessage, onError) {
  const worker = new Worker(new URL('./worker-entry.js', import.meta.url));
  worker.on('message', (message) => {
    // A worker without a run does not keep the process alive.
    if (message.done) worker.unref();
    onMessage(message);
  });
  worker.on('error', onError);
  const post = (message) => {
    worker.ref();
    worker.postMessage(message);
  };
  return { post, end: () => worker.terminate() };
}

export function createWorker() {
  return workerOf(start);
}
