// Simplification of meshes in typed arrays. The documentation is in index.d.ts.
export { options, simplifyMesh, simplifyScene } from './calls.js';
export { ready } from './ready.js';
export { LodsmithSimplifier } from './simplifier.js';
