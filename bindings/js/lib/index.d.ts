import type { EngineOptions } from './options.js';
import type { Report } from './report.js';

export type { EngineOptions } from './options.js';
export type { Report } from './report.js';
export { LodsmithSimplifier } from './simplifier.js';

/** Resolves when the WebAssembly module is loaded. Before, other functions of this file throw an error. */
export const ready: Promise<void>;

/** Integers of any size for indices. */
export type IndexArray = Uint32Array | Uint16Array | Uint8Array | Int32Array | Int16Array;
/** Values of an attribute: floats are interpolated; integers are labels and are not. */
export type AttributeArray =
  Float32Array | Uint8Array | Int8Array | Uint16Array | Int16Array | Uint32Array | Int32Array;

/** Values of an attribute, and the number of values for each vertex. */
export interface Attribute<A extends AttributeArray = AttributeArray> {
  array: A;
  itemSize: number;
}

/** A triangle mesh: each vertex has one row in every array except `indices` and `regions`. */
export interface Mesh {
  /** Three numbers for each vertex. */
  positions: Float32Array | Float64Array;
  /** Three vertices for each triangle, counter-clockwise seen from outside; by default three consecutive vertices. */
  indices?: IndexArray;
  /** Three numbers for each vertex. */
  normals?: Float32Array;
  /** Two numbers for each vertex. */
  uvs?: Float32Array;
  /** Three or four numbers from 0 to 1 for each vertex. */
  colors?: Float32Array;
  /** Four numbers for each vertex: a direction, and 1 or -1. */
  tangents?: Float32Array;
  /** The number of a material or group for each triangle; borders between them keep their lines. */
  regions?: Uint32Array;
  /**
   * Other attributes by name. Some names have a meaning: `uvs1`, `colors1` and so on, `joints0` and `weights0` of a
   * skin, `morph0_positions`, `morph0_normals` and `morph0_tangents` for the offsets of morph targets.
   */
  attributes?: Record<string, AttributeArray | Attribute>;
}

/** The result of a run: the arrays of the mesh, in the same types, with fewer rows. */
export interface SimplifiedMesh extends Mesh {
  /** In the type of those of the input if it is large enough, else `Uint32Array`. */
  indices: IndexArray;
  attributes?: Record<string, Attribute>;
}

/** Options of a run. */
export interface SimplifyOptions extends EngineOptions {
  /** For each vertex, 1 to keep its position and its attributes, else 0. */
  locked?: Uint8Array;
  /** For each vertex, the factor on the density of triangles around it. */
  importance?: Float32Array;
  /** For each vertex, its share of the limit `error`, from 0 (keep the vertex) to 1. */
  errorMap?: Float32Array;
  /**
   * Called with the progress of each stage from 0 to 1; the run is cancelled if it returns `false` or throws. Its exception
   * is thrown by the run.
   */
  onProgress?: (done: number, stage: string) => boolean | void;
}

/** A mesh of a scene. */
export interface ScenePart extends Mesh {
  /** Number of instances in the scene; 1 by default. */
  instances?: number;
  /** Scale of the mesh in the scene; 1 by default. */
  scale?: number;
  /** Number of its coordinate system, if it has one instance: touching parts in the same system stay connected. */
  system?: number;
}

/** Counts of a mesh of a scene. */
export interface MeshCounts {
  instances: number;
  inputFaces: number;
  inputVertices: number;
  faces: number;
  vertices: number;
  reached: boolean;
}

/**
 * Returns a simplified copy of a mesh.
 *
 * Vertices at equal positions count as one vertex; if their attributes differ, they are a seam, which keeps its line.
 * `warnings` of the result name lost data: faces with positions that are NaN or infinite, and attributes without use.
 * @throws {TypeError} for an option or an array that does not exist, or an array of the wrong type.
 * @throws {RangeError} for an invalid value, or arrays that are not a mesh.
 */
export function simplifyMesh(mesh: Mesh, options: SimplifyOptions): MeshResult;

/** A simplified mesh, the report of the run, and the data that were lost. */
export type MeshResult = SimplifiedMesh & { report: Report; warnings: string[] };

/** Simplified meshes, the report of the run, and the data that were lost. */
export interface SceneResult {
  meshes: SimplifiedMesh[];
  counts: MeshCounts[];
  report: Report;
  warnings: string[];
}

/** Returns simplified copies of meshes, with one target for all. */
export function simplifyScene(
  scene: { meshes: ScenePart[]; /** Of the bounding box of all instances. */ diagonal?: number },
  options: SimplifyOptions,
): SceneResult;

/** An option of a run. */
export interface OptionRow {
  name: string;
  kind: 'count' | 'ratio' | 'length' | 'degrees' | 'word' | 'flag' | 'number' | 'weights' | 'seed';
  /** The values of a `word`. */
  words: string[];
  /** The default as on the command line; null if the option is off. */
  default: string | null;
  help: string;
}

/** Returns all options. */
export function options(): OptionRow[];
