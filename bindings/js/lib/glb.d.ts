import type { FileOptions } from './options.js';
import type { Report } from './report.js';

/** Loads the WebAssembly module in advance; otherwise the first call of `simplifyGlb` loads it. */
export function load(): Promise<void>;

/** Options of a run. */
export interface GlbOptions extends FileOptions {
  /** Called with the progress of each stage from 0 to 1; the run is cancelled if it returns `false` or throws. */
  onProgress?: (done: number, stage: string) => boolean | void;
}

/** The report of a run on a file: the report of the run, with additional keys about the file. */
export interface FileReport extends Report {
  /** Seconds by stage. */
  seconds: Record<string, number>;
  /** The meshes that were simplified. */
  meshes?: { name: string; instances: number; reached: boolean }[];
  /** The maps that were baked. */
  baked?: { sets: { material: string; size: number; atlas: 'keep' | 'new'; maps: string[] }[] };
}

/** A simplified file, and the report of the run. */
export interface SimplifiedGlb {
  bytes: Uint8Array;
  report: FileReport;
  /** Warnings about data that were changed or dropped. */
  warnings: string[];
}

/**
 * Simplifies all meshes of a GLB file with one target for all. The result has the bytes of
 * `lodsmith simplify IN.glb -o OUT.glb`; everything else in the file is kept. The input may be compressed (Draco,
 * meshopt); the result is compressed only with `compress`.
 */
export function simplifyGlb(bytes: Uint8Array | ArrayBuffer, options: GlbOptions): Promise<SimplifiedGlb>;
