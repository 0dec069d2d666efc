import type { EngineOptions } from './options.js';
import type { Report } from './report.js';

/** Loads the module of this file, which `simplifyGlb` does otherwise. */
export function load(): Promise<void>;

/** Options of a run. */
export interface GlbOptions extends EngineOptions {
  /** Called with the progress of each stage from 0 to 1; the run is cancelled if it returns `false`. */
  onProgress?: (done: number, stage: string) => boolean | void;
}

/** A file, and the report of the run. */
export interface SimplifiedGlb {
  bytes: Uint8Array;
  report: Report;
  /** What the file or its format made us change or leave out. */
  warnings: string[];
}

/**
 * Simplifies all meshes of a GLB file under one budget, with the bytes of `lodsmith simplify IN.glb -o OUT.glb`. Everything
 * else in the file stays. Geometry may be compressed (Draco, meshopt); it is not in the result.
 */
export function simplifyGlb(bytes: Uint8Array | ArrayBuffer, options: GlbOptions): Promise<SimplifiedGlb>;
