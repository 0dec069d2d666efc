import type { BufferGeometry } from 'three';
import type { SimplifyOptions } from './index.js';
import type { Report } from './report.js';

export { ready } from './index.js';

/** Options of a run. */
export interface GeometryOptions extends SimplifyOptions {
  /** Called with the report of the run. */
  onReport?: (report: Report) => void;
}

/**
 * Returns a simplified copy of a geometry, with its attributes, groups and morph targets. Await `ready` first. Lost data,
 * such as faces with invalid positions, are named on the console.
 */
export function simplifyGeometry(geometry: BufferGeometry, options: GeometryOptions): BufferGeometry;
