/** A distance from the original to the result, from the result to the original, and for both directions. */
export interface BothWays {
  forward: number;
  backward: number;
  symmetric: number;
}

/** A change of an option, and the value or direction that it would need. */
export interface OptionChange {
  option: string;
  /** The value in the run; null if the option was off. */
  now: string | number | null;
  to: string;
}

/** The place of the largest distance. */
export interface Farthest {
  /** `forward`: the point is on the input, and far from the result; `backward`: the opposite. */
  direction: 'forward' | 'backward';
  point: [number, number, number];
  /** The point of the other surface that is nearest to it; null if nothing is left of its mesh. */
  nearest: [number, number, number] | null;
  /** In a scene, the mesh that it belongs to, from 0; the point is in its coordinates, or in those of the file. */
  mesh?: number;
}

/** The report of a run, with the keys of `lodsmith simplify --json`. */
export interface Report {
  input: { faces: number; vertices: number };
  output: { faces: number; vertices: number };
  method: string;
  /** The targets by name. */
  target: Record<string, number | string>;
  /** True if the target was met. */
  reached: boolean;
  stopped_by: string;
  error: {
    /** The estimate of the RMS distance by the engine. */
    estimate: number;
    /** The proven bound, if one was requested. */
    bound: number | null;
    measured: { hausdorff: BothWays; mean: BothWays; rms: BothWays; farthest: Farthest | null } | null;
    unit: 'model';
    /** Of the bounding box of the original. */
    diagonal: number;
  };
  refusals: Record<string, number>;
  collapses: number;
  parts_removed: number;
  necks_cut: number;
  pairs_contracted: number;
  /** Pairs of faces of the input that lie on each other with opposite windings and were simplified as one side. */
  two_sided_pairs: number;
  /** Sheets with two sides that were not simplified as one. */
  unpaired_sheets: number;
  pruned: { parts: number; faces: number };
  locked: { vertices: number; faces: number };
  seams_relaxed: boolean;
  sharp_relaxed: boolean;
  fitted: boolean;
  dropped: string[];
  proposals: { changes: OptionChange[]; gain: number }[];
  escalated: { option: string; to: string; before: number; after: number }[];
  cleanup: {
    welded_vertices: number;
    degenerate_faces: number;
    duplicate_faces: number;
    non_finite_faces: number;
    unused_vertices: number;
  };
  clustered?: { cell: number; faces: number; vertices: number; non_manifold_edges: number };
}
