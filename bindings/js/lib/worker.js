// Runs in a worker. The documentation is in worker.d.ts.

/** Starts a worker of the browser or of Node. The functions are called with each message, and with an error. */
async function start(onMessage, onError) {
  if (typeof Worker === 'function') {
    const worker = new Worker(new URL('./worker-entry.js', import.meta.url), { type: 'module' });
    worker.addEventListener('message', (event) => onMessage(event.data));
    worker.addEventListener('error', (event) => onError(new Error(event.message || 'the worker did not start')));
    return { post: (message) => worker.postMessage(message), end: () => worker.terminate() };
  }
  const threads = await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:worker_threads');
  const worker = new threads.Worker(new URL('./worker-entry.js', import.meta.url));
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
  let worker = null;
  let isEnded = false;
  let queue = Promise.resolve();
  // The current run.
  let current = null;

  const end = () => {
    worker?.then((w) => w.end(), () => {});
    worker = null;
  };
  /** Ends the current run with a result or an error. */
  const settle = (how, value) => {
    const run = current;
    current = null;
    run?.[how](value);
  };
  const fail = (error) => {
    end();
    settle('reject', error);
  };
  const onMessage = (message) => {
    if (message.progress) current?.onProgress?.(...message.progress);
    else if (!message.error) settle('resolve', message.result);
    else if (message.isFault) fail(revived(message.error));
    else settle('reject', revived(message.error));
  };

  /** Starts a worker whose messages are handled until another worker replaces it. */
  const started = () => {
    const own = start(
      (message) => worker === own && onMessage(message),
      (error) => worker === own && fail(error),
    );
    return own;
  };

  const run = async (name, args, options, { onProgress, signal } = {}) => {
    if (isEnded) throw new Error('the worker has ended');
    signal?.throwIfAborted();
    worker ??= started();
    const { post } = await worker;
    const abort = () => fail(signal.reason);
    try {
      return await new Promise((resolve, reject) => {
        current = { resolve, reject, onProgress };
        signal?.addEventListener('abort', abort);
        if (isEnded) fail(new Error('the worker has ended'));
        else if (signal?.aborted) abort();
        else post({ name, args, options, progress: onProgress !== undefined });
      });
    } finally {
      signal?.removeEventListener('abort', abort);
    }
  };

  /** Queues a run. */
  const queued = (...args) => {
    const result = queue.then(() => run(...args));
    queue = result.catch(() => {});
    return result;
  };

  return {
    simplifyMesh: (mesh, options, control) => queued('simplifyMesh', [mesh], options, control),
    simplifyScene: (scene, options, control) => queued('simplifyScene', [scene], options, control),
    simplifyGlb: (bytes, options, control) => queued('simplifyGlb', [bytes], options, control),
    terminate() {
      isEnded = true;
      fail(new Error('the worker has ended'));
    },
  };
}

/** Returns an error of the worker as an error of the same class. */
function revived({ kind, name, message }) {
  const error = new ({ TypeError, RangeError }[kind] ?? Error)(message);
  if (name !== kind) error.name = name;
  return error;
}
