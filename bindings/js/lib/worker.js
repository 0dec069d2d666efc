// Runs in a worker of a browser. The documentation is in worker.d.ts.
import { workerOf } from './worker-queue.js';

/** Starts a worker. The functions are called with each message, and with an error. */
function start(onMessage, onError) {
  const worker = new Worker(new URL('./worker-entry.js', import.meta.url), { type: 'module' });
  worker.addEventListener('message', (event) => onMessage(event.data));
  worker.addEventListener('error', (event) => onError(new Error(event.message || 'the worker did not start')));
  return { post: (message) => worker.postMessage(message), end: () => worker.terminate() };
}

export function createWorker() {
  return workerOf(start);
}
