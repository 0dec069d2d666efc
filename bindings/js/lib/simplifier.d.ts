/** Flags of a call. */
export type SimplifierFlag =
  | 'LockBorder'
  | 'Sparse'
  | 'ErrorAbsolute'
  | 'Prune'
  | 'Regularize'
  | 'Permissive'
  | 'RegularizeLight'
  | 'PreserveFolds'
  | 'ErrorClamped';

type Indices = Uint32Array | Int32Array | Uint16Array | Int16Array;

/**
 * A replacement for `MeshoptSimplifier` (package meshoptimizer), with the same arguments and results: for
 * `simplify({ simplifier })` of glTF Transform, or by itself. Strides count floats, and errors are fractions of the
 * largest extent of the positions. `simplifySloppy`, `simplifyPoints` and `remesh` are there for the type, and throw.
 */
export const LodsmithSimplifier: {
  readonly supported: boolean;
  /** Resolves when the other functions may be called. */
  readonly ready: Promise<void>;

  /** Returns the remaining indices, which refer to vertices of the input, and an estimate of the error. */
  simplify(
    indices: Indices,
    positions: Float32Array,
    positionStride: number,
    targetIndexCount: number,
    targetError: number,
    flags?: SimplifierFlag[],
  ): [Uint32Array, number];

  /** Like `simplify`, with attributes in the cost. `locks` has flags for each vertex: 1 lock, 2 protect, 4 priority. */
  simplifyWithAttributes(
    indices: Indices,
    positions: Float32Array,
    positionStride: number,
    attributes: Float32Array,
    attributeStride: number,
    weights: ArrayLike<number>,
    locks: Uint8Array | null,
    targetIndexCount: number,
    targetError: number,
    flags?: SimplifierFlag[],
  ): [Uint32Array, number];

  /** Like `simplifyWithAttributes`, but moves vertices: changes the arrays, and returns the number of remaining indices. */
  simplifyWithUpdate(
    indices: Indices,
    positions: Float32Array,
    positionStride: number,
    attributes: Float32Array,
    attributeStride: number,
    weights: ArrayLike<number>,
    locks: Uint8Array | null,
    targetIndexCount: number,
    targetError: number,
    flags?: SimplifierFlag[],
  ): [number, number];

  /**
   * Returns the triangles of the connected parts whose radius, the largest distance of a vertex from their mean, is above
   * the error.
   */
  simplifyPrune(indices: Indices, positions: Float32Array, positionStride: number, targetError: number): Uint32Array;

  /** Returns, for each vertex, the first vertex at the same position. */
  generatePositionRemap(positions: Float32Array, positionStride: number): Uint32Array;

  /** Throws: `simplify` with the flags `Permissive` and `Prune`, or method `cluster` of `simplifyMesh`, is the nearest. */
  simplifySloppy(...args: unknown[]): never;

  /** Throws: points are not simplified. */
  simplifyPoints(...args: unknown[]): never;

  /** Throws: method `remesh` of `simplifyMesh` is the nearest. */
  remesh(...args: unknown[]): never;

  /** Returns the largest extent of the positions: errors times this extent are distances. */
  getScale(positions: Float32Array, stride: number): number;

  /**
   * Renumbers the vertices in the order of their use. Changes the indices; returns the new index of each vertex
   * (0xffffffff if it is unused), and the number of used vertices.
   */
  compactMesh(indices: Indices): [Uint32Array, number];
};
