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

  simplifyPoints() {
    throw new Error('points are not simplified');
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
