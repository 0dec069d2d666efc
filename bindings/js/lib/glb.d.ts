import type { FileOptions } from './options.js';
import type { Report } from './report.js';

/** Loads the module of this file, which `simplifyGlb` does otherwise. */
export function load(): Promise<void>;

/** Options of a run. */
export interface GlbOptions extends FileOptions {
  /** Called with the progress of each stage from 0 to 1; the run is cancelled if it returns `false`. */
  onProgress?: (done: number, stage: string) => boolean | void;
}

/** The report of a run on a file: that of the run, and what is known of the file. */
export interface FileReport extends Report {
  /** Seconds by stage. */
  seconds: Record<string, number>;
  /** The meshes that were simplified. */
  meshes?: { name: string; instances: number; reached: boolean }[];
  /** The maps that were baked. */
  baked?: { sets: { material: string; size: number; atlas: 'keep' | 'new'; maps: string[] }[] };
}

/** A file, and the report of the run. */
export interface SimplifiedGlb {
  bytes: Uint8Array;
  report: FileReport;
  /** What the file or its format made us change or leave out. */
  warnings: string[];
}

/**
 * Simplifies all meshes of a GLB file under one budget, with the bytes of `lodsmith simplify IN.glb -o OUT.glb`. Everything
 * else in the file stays. Geometry may be compressed (Draco, meshopt); in the result it is if `compress` says so.
 */
export function simplifyGlb(bytes: Uint8Array | ArrayBuffer, options: GlbOptions): Promise<SimplifiedGlb>;
