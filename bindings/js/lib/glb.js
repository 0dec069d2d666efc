// Simplification of whole GLB files. The documentation is in glb.d.ts.
import init, * as engine from './wasm/lodsmith_files.js';
import { source } from './load.js';
import { withProgress } from './progress.js';

let loading;

/** Loads the module; otherwise the first call does. */
export function load() {
  loading ??= source(new URL('./wasm/lodsmith_files_bg.wasm', import.meta.url)).then(async (from) => {
    await init({ module_or_path: from });
  });
  return loading;
}

export async function simplifyGlb(bytes, options) {
  await load();
  const view = bytes instanceof Uint8Array ? bytes : new Uint8Array(bytes);
  return withProgress(options, (rest, onProgress) => engine.simplifyGlb(view, rest, onProgress));
}
