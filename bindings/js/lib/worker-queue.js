// The runs of a worker, one after the other, whatever starts it.

/** Returns a worker for a function that starts one. */
export function workerOf(start) {
  let worker = null;
  let isEnded = false;
  let queue = Promise.resolve();
  // The current run.
  let current = null;

  const end = () => {
    worker?.end();
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
  /** Calls the progress function of the current run; an exception of it ends the run. */
  const report = (progress) => {
    try {
      current?.onProgress?.(...progress);
    } catch (error) {
      fail(error);
    }
  };
  const onMessage = (message) => {
    if (message.progress) report(message.progress);
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
    const { post } = worker;
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
