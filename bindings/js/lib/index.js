// Simplification of meshes in typed arrays. The documentation is in index.d.ts.
import * as engine from './wasm/lodsmith.js';

export { ready } from './ready.js';
export { LodsmithSimplifier } from './simplifier.js';

/** Separates the options of a call from its progress function. */
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
