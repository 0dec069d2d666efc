// The program of a worker: it receives a call, and posts its progress and its result.
const isBrowser = typeof WorkerGlobalScope === 'function';
const port = isBrowser
  ? null
  : (await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:worker_threads')).parentPort;
const post = isBrowser ? (message, list) => postMessage(message, list) : (message, list) => port.postMessage(message, list);

/** Returns the buffers of all arrays in a value, to be transferred with it. */
function buffers(value, all = new Set()) {
  if (ArrayBuffer.isView(value)) all.add(value.buffer);
  else if (value !== null && typeof value === 'object') Object.values(value).forEach((x) => buffers(x, all));
  return all;
}

async function answer({ name, args, options, progress }) {
  try {
    const callback = progress ? { onProgress: (done, stage) => post({ progress: [done, stage] }) } : {};
    let call;
    if (name === 'simplifyGlb') {
      call = (await import('./glb.js')).simplifyGlb;
    } else {
      const core = await import('./index.js');
      await core.ready;
      call = core[name];
    }
    const result = await call(...args, { ...options, ...callback });
    post({ done: true, result }, [...buffers(result)]);
  } catch (error) {
    const { name: word, message } = error;
    const isFault = error instanceof WebAssembly.RuntimeError;
    post({ done: true, error: { kind: error.constructor.name, name: word, message }, isFault });
  }
}

if (isBrowser) addEventListener('message', (event) => answer(event.data));
else port.on('message', answer);
