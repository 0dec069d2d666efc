// Simplification of meshes in typed arrays. The documentation is in index.d.ts.
import init, * as engine from './wasm/lodsmith.js';
import { source } from './load.js';

export { LodsmithSimplifier } from './simplifier.js';

/** Loads the module; its functions may be called afterwards. */
export const ready = source(new URL('./wasm/lodsmith_bg.wasm', import.meta.url)).then(async (from) => {
  await init({ module_or_path: from });
});
// Whoever waits for it gets the error; nobody else needs to be told.
ready.catch(() => {});

/** Parts options of a call from the function that is told its progress. */
function parted(options) {
  const { onProgress, ...rest } = options ?? {};
  return [rest, onProgress];
}

export function simplifyMesh(mesh, options) {
  return engine.simplifyMesh(mesh, ...parted(options));
}

export function simplifyScene(scene, options) {
  return engine.simplifyScene(scene.meshes, scene.diagonal ?? 0, ...parted(options));
}

export function options() {
  return engine.optionTable();
}
