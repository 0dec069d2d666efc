// The WebAssembly module for meshes, which is loaded once.
import init from './wasm/lodsmith.js';
import { source } from './load.js';

/** Loads the module; its functions may be called afterwards. */
export const ready = source(new URL('./wasm/lodsmith_bg.wasm', import.meta.url)).then(async (from) => {
  await init({ module_or_path: from });
});
// Whoever waits for it gets the error; nobody else needs to be told.
ready.catch(() => {});
