/** Rules of a call. */
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
 * An object with functions of `MeshoptSimplifier` (package meshoptimizer), with the same arguments and results, to be used
 * in its place: in `simplify({ simplifier })` of glTF Transform, or by itself. Strides count floats, and errors are shares
 * of the largest extent of the positions.
 */
export const LodsmithSimplifier: {
  readonly supported: boolean;
  /** Resolves when the other functions may be called. */
  readonly ready: Promise<void>;

  /** Returns the indices that are left, all of vertices of the input, and an estimate of the error. */
  simplify(
    indices: Indices,
    positions: Float32Array,
    positionStride: number,
    targetIndexCount: number,
    targetError: number,
    flags?: SimplifierFlag[],
  ): [Uint32Array, number];

  /** The same, with attributes in the cost. `locks` has flags for each vertex: 1 lock, 2 protect, 4 priority. */
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

  /** The same with vertices that move: changes the arrays, and returns the number of indices that are left. */
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

  /** Throws: points are not simplified. */
  simplifyPoints(): never;

  /** Returns the largest extent of the positions, by which errors are multiplied to be distances. */
  getScale(positions: Float32Array, stride: number): number;

  /**
   * Numbers the vertices in the order of their use. Changes the indices; returns the new number of each vertex
   * (0xffffffff if no index names it), and how many there are.
   */
  compactMesh(indices: Indices): [Uint32Array, number];
};
