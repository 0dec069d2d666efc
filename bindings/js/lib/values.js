// Conversion of the values of typed arrays to floats and back.

/** Returns the largest number of an integer type, the divisor of normalised values; undefined for floats. */
function largest(array) {
  if (array instanceof Float32Array || array instanceof Float64Array) return undefined;
  const bits = 8 * array.BYTES_PER_ELEMENT;
  const isSigned = array instanceof Int8Array || array instanceof Int16Array || array instanceof Int32Array;
  return 2 ** (isSigned ? bits - 1 : bits) - 1;
}

/** Returns true if the values of an array are integers, not normalised fractions. */
export function isWhole(array, isNormalized) {
  return largest(array) !== undefined && !isNormalized;
}

/** Returns the values as floats; normalised integers become numbers from -1 or 0 to 1. */
export function floats(array, isNormalized) {
  const max = isNormalized ? largest(array) : undefined;
  if (max === undefined) return array instanceof Float32Array ? array : Float32Array.from(array);
  return Float32Array.from(array, (x) => Math.max(x / max, -1));
}

/** Converts floats to values of the type of another array. */
export function asTypeOf(values, like, isNormalized) {
  if (values.constructor === like.constructor) return values;
  const max = largest(like);
  if (max === undefined) return like.constructor.from(values);
  const min = like instanceof Int8Array || like instanceof Int16Array || like instanceof Int32Array ? -max : 0;
  const factor = isNormalized ? max : 1;
  // (The smallest integer of a signed type, -max - 1, is not used: as a fraction it would be below -1.)
  return like.constructor.from(values, (x) => Math.min(Math.max(Math.round(x * factor), min), max));
}

/** Returns rows of another size: values are dropped, or `fill` is added. */
export function resized(values, from, to, fill) {
  if (from === to) return values;
  const count = values.length / from;
  const all = new values.constructor(count * to).fill(fill);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < Math.min(from, to); k++) all[i * to + k] = values[i * from + k];
  }
  return all;
}

/**
 * Returns the vertices that some triangles of a mesh use, in the order of their first use, and the triangles with
 * indices into these vertices.
 */
export function used(indices, regions, region) {
  const number = new Map();
  const rows = [];
  const left = [];
  for (let at = 0; at < indices.length; at++) {
    if (regions && regions[Math.floor(at / 3)] !== region) continue;
    const i = indices[at];
    let n = number.get(i);
    if (n === undefined) {
      n = rows.length;
      number.set(i, n);
      rows.push(i);
    }
    left.push(n);
  }
  return { rows, indices: left };
}

/** Returns some rows of an array. */
export function pick(values, size, rows) {
  const all = new values.constructor(rows.length * size);
  rows.forEach((row, i) => {
    for (let k = 0; k < size; k++) all[i * size + k] = values[row * size + k];
  });
  return all;
}
