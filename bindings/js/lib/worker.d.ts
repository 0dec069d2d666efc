import type { EngineOptions } from './options.js';
import type { SimplifiedGlb } from './glb.js';
import type { Mesh, MeshResult, ScenePart, SceneResult, SimplifyOptions } from './index.js';

/** Progress and cancellation of a run in a worker. */
export interface WorkerControl {
  /** Called with the progress of each stage from 0 to 1. If it throws, the run ends with its exception. */
  onProgress?: (done: number, stage: string) => void;
  /** Aborting it ends the worker; the next run starts a new one. */
  signal?: AbortSignal;
}

type WorkerOptions = Omit<SimplifyOptions, 'onProgress'>;

/** A worker of the browser or of Node, started at the first run. Runs are queued. */
export interface LodsmithWorker {
  simplifyMesh(mesh: Mesh, options: WorkerOptions, control?: WorkerControl): Promise<MeshResult>;
  simplifyScene(
    scene: { meshes: ScenePart[]; diagonal?: number },
    options: WorkerOptions,
    control?: WorkerControl,
  ): Promise<SceneResult>;
  simplifyGlb(bytes: Uint8Array | ArrayBuffer, options: EngineOptions, control?: WorkerControl): Promise<SimplifiedGlb>;
  /** Ends the worker; later runs fail. */
  terminate(): void;
}

/** Returns a worker. */
export function createWorker(): LodsmithWorker;
