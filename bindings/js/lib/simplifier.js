// An object with the functions of MeshoptSimplifier. The documentation is in simplifier.d.ts.
import { core } from './core.js';
import { ready } from './ready.js';

const FLAGS = {
  LockBorder: 1,
  Sparse: 2,
  ErrorAbsolute: 4,
  Prune: 8,
  Regularize: 16,
  Permissive: 32,
  RegularizeLight: 64,
  PreserveFolds: 128,
  ErrorClamped: 256,
};

function bits(flags) {
  let all = 0;
  for (const flag of flags ?? []) {
    if (!Object.hasOwn(FLAGS, flag)) throw new TypeError(`there is no flag ${flag}`);
    all |= FLAGS[flag];
  }
  return all;
}

/** Checks arguments that the engine does not check. */
function target(count, error, indices) {
  if (!(count >= 0) || count % 3 !== 0) {
    throw new RangeError(`a target of ${count} indices is not a multiple of three`);
  }
  if (count > indices.length) {
    throw new RangeError(`a target of ${count} indices is more than the ${indices.length} there are`);
  }
  if (!(error >= 0)) throw new RangeError(`a target error of ${error} is not 0 or more`);
}

/** Returns the attribute rows for the given weights; without weights there are none. */
function attributeRows(attributes, stride, weights) {
  if (stride < weights.length) {
    throw new RangeError(`a stride of ${stride} is too small for ${weights.length} attributes`);
  }
  return { attributes, attributeStride: stride, weights: Float32Array.from(weights) };
}

function checkStride(positions, stride) {
  if (!(stride >= 3) || positions.length % stride !== 0) {
    throw new RangeError(`a stride of ${stride} is below 3, or does not fit ${positions.length} numbers`);
  }
}

/** Returns a function that gives the number of the connected part of a vertex. */
function partsOf(indices, place) {
  const root = place.slice();
  const find = (vertex) => {
    let at = root[vertex];
    while (root[at] !== at) at = root[at] = root[root[at]];
    return at;
  };
  for (let at = 0; at + 2 < indices.length; at += 3) {
    const [a, b, c] = [find(indices[at]), find(indices[at + 1]), find(indices[at + 2])];
    root[b] = root[c] = a;
  }
  return find;
}

/** Returns the radius of each part around the mean of its corners. */
function radii(indices, positions, stride, part) {
  const sums = new Map();
  const each = (visit) => {
    for (const vertex of indices) visit(part(vertex), [0, 1, 2].map((k) => positions[vertex * stride + k]));
  };
  each((of, p) => {
    const sum = sums.get(of) ?? [0, 0, 0, 0];
    sums.set(of, [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2], sum[3] + 1]);
  });
  const found = new Map();
  each((of, p) => {
    const sum = sums.get(of);
    const distance = Math.hypot(...p.map((x, k) => x - sum[k] / sum[3]));
    found.set(of, Math.max(found.get(of) ?? 0, distance));
  });
  return found;
}

export const LodsmithSimplifier = {
  supported: typeof WebAssembly === 'object',
  get ready() {
    return ready;
  },

  simplify(indices, positions, positionStride, targetIndexCount, targetError, flags) {
    target(targetIndexCount, targetError, indices);
    return core().simplifyIndices({ indices, positions, positionStride, targetIndexCount, targetError, flags: bits(flags) });
  },

  simplifyWithAttributes(
    indices, positions, positionStride, attributes, attributeStride, weights, locks, targetIndexCount, targetError, flags,
  ) {
    target(targetIndexCount, targetError, indices);
    return core().simplifyIndices({
      indices, positions, positionStride, ...attributeRows(attributes, attributeStride, weights), locks,
      targetIndexCount, targetError, flags: bits(flags),
    });
  },

  simplifyWithUpdate(
    indices, positions, positionStride, attributes, attributeStride, weights, locks, targetIndexCount, targetError, flags,
  ) {
    target(targetIndexCount, targetError, indices);
    const [left, error, newPositions, newAttributes] = core().updateIndices({
      indices, positions, positionStride, ...attributeRows(attributes, attributeStride, weights), locks,
      targetIndexCount, targetError, flags: bits(flags),
    });
    indices.set(left);
    positions.set(newPositions);
    attributes.set(newAttributes);
    return [left.length, error];
  },

  simplifyPrune(indices, positions, positionStride, targetError) {
    if (!(targetError >= 0)) throw new RangeError(`a target error of ${targetError} is not 0 or more`);
    const limit = targetError * LodsmithSimplifier.getScale(positions, positionStride);
    const place = LodsmithSimplifier.generatePositionRemap(positions, positionStride);
    const part = partsOf(indices, place);
    const radius = radii(indices, positions, positionStride, part);
    const isKept = (at) => radius.get(part(indices[3 * at])) > limit;
    const kept = Array.from({ length: indices.length / 3 }, (_, at) => at).filter(isKept);
    return Uint32Array.from(kept.flatMap((at) => Array.from(indices.subarray(3 * at, 3 * at + 3))));
  },

  generatePositionRemap(positions, positionStride) {
    checkStride(positions, positionStride);
    const first = new Map();
    return Uint32Array.from({ length: positions.length / positionStride }, (_, vertex) => {
      const at = vertex * positionStride;
      // (Both zeros are the same in a text.)
      const key = `${positions[at]} ${positions[at + 1]} ${positions[at + 2]}`;
      if (!first.has(key)) first.set(key, vertex);
      return first.get(key);
    });
  },

  simplifySloppy() {
    throw new Error("there is no simplifySloppy: use simplify with the flags 'Permissive' and 'Prune', or method cluster of simplifyMesh");
  },

  simplifyPoints() {
    throw new Error('points are not simplified');
  },

  remesh() {
    throw new Error('there is no remesh: use method remesh of simplifyMesh');
  },

  getScale(positions, stride) {
    const [min, max] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let i = 0; i + 2 < positions.length; i += stride) {
      for (let k = 0; k < 3; k++) {
        const x = positions[i + k];
        if (x < min[k]) min[k] = x;
        if (x > max[k]) max[k] = x;
      }
    }
    return Math.max(0, ...[0, 1, 2].map((k) => max[k] - min[k]));
  },

  compactMesh(indices) {
    let count = 0;
    for (const i of indices) if (i >= count) count = i + 1;
    const remap = new Uint32Array(count).fill(0xffffffff);
    let unique = 0;
    for (let at = 0; at < indices.length; at++) {
      const i = indices[at];
      if (remap[i] === 0xffffffff) remap[i] = unique++;
      indices[at] = remap[i];
    }
    return [remap, unique];
  },
};
