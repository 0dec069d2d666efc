import type { EngineOptions } from './options.js';
import type { SimplifiedGlb } from './glb.js';
import type { Mesh, MeshCounts, ScenePart, SimplifiedMesh, SimplifyOptions } from './index.js';
import type { Report } from './report.js';

/** Progress and cancellation of a run in a worker. */
export interface WorkerControl {
  /** Called with the progress of each stage from 0 to 1. */
  onProgress?: (done: number, stage: string) => void;
  /** Ends the worker if it is aborted; the next run starts another. */
  signal?: AbortSignal;
}

type WorkerOptions = Omit<SimplifyOptions, 'onProgress'>;

/** A worker of the browser or of Node, started at the first run. Runs follow each other. */
export interface LodsmithWorker {
  simplifyMesh(mesh: Mesh, options: WorkerOptions, control?: WorkerControl): Promise<SimplifiedMesh & { report: Report }>;
  simplifyScene(
    scene: { meshes: ScenePart[]; diagonal?: number },
    options: WorkerOptions,
    control?: WorkerControl,
  ): Promise<{ meshes: SimplifiedMesh[]; counts: MeshCounts[]; report: Report }>;
  simplifyGlb(bytes: Uint8Array | ArrayBuffer, options: EngineOptions, control?: WorkerControl): Promise<SimplifiedGlb>;
  /** Ends it for good. */
  terminate(): void;
}

/** Returns a worker. */
export function createWorker(): LodsmithWorker;
