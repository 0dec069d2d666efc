// The work of a worker: its answers to a call.
import { simplifyMesh, simplifyScene } from './calls.js';
import { load } from './core.js';
import { simplifyGlb } from './glb.js';

const CALLS = { simplifyMesh, simplifyScene, simplifyGlb };

/** Returns the buffers of all arrays in a value, to be transferred with it. */
function buffers(value, all = new Set()) {
  if (ArrayBuffer.isView(value)) all.add(value.buffer);
  else if (value !== null && typeof value === 'object') Object.values(value).forEach((x) => buffers(x, all));
  return all;
}

/** Does a call, and posts its progress and its result. */
export async function answer({ name, args, options, progress }, post) {
  try {
    const callback = progress ? { onProgress: (done, stage) => post({ progress: [done, stage] }) } : {};
    // (The other module is loaded by its function.)
    if (name !== 'simplifyGlb') await load();
    const result = await CALLS[name](...args, { ...options, ...callback });
    post({ done: true, result }, [...buffers(result)]);
  } catch (error) {
    const { name: word, message } = error;
    const isFault = error instanceof WebAssembly.RuntimeError;
    post({ done: true, error: { kind: error.constructor.name, name: word, message }, isFault });
  }
}
