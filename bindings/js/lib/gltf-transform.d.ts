import type { Transform } from '@gltf-transform/core';
import type { SimplifyOptions } from './index.js';
import type { Report } from './report.js';

export { LodsmithSimplifier } from './simplifier.js';

/** Options of the transform. */
export interface LodsmithOptions extends Omit<SimplifyOptions, 'locked' | 'importance' | 'errorMap'> {
  /** Called with the report of the run. */
  onReport?: (report: Report) => void;
}

/**
 * Returns a transform that simplifies all meshes of the default scene with one target for all. Normals, texture
 * coordinates, colours, tangents, skins, morph targets and custom attributes are kept, in their types. The logger of the
 * document names lost data.
 */
export function lodsmith(options: LodsmithOptions): Transform;
