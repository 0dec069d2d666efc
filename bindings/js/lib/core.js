// The WebAssembly module for meshes, which is loaded once.
import init, * as engine from './wasm/lodsmith.js';
import { source } from './load.js';

let loading;
let isLoaded = false;

/** Loads the module. */
export function load() {
  loading ??= source(new URL('./wasm/lodsmith_bg.wasm', import.meta.url)).then(async (from) => {
    await init({ module_or_path: from });
    isLoaded = true;
  });
  return loading;
}

/** Returns the functions of the module. */
export function core() {
  if (!isLoaded) throw new Error('the WebAssembly module is not loaded: await ready before the first call');
  return engine;
}
