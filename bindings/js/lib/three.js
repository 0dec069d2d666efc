// Simplification of the geometries of three.js. The documentation is in three.d.ts.
import { BufferAttribute, BufferGeometry } from 'three';
import { simplifyMesh } from './index.js';
import { asTypeOf, floats, isWhole, resized } from './values.js';

export { ready } from './index.js';

const OWN = { normal: ['normals', 3], uv: ['uvs', 2], color: ['colors', 4], tangent: ['tangents', 4] };
const NAMED = { skinIndex: ['joints0', 4], skinWeight: ['weights0', 4], uv1: ['uvs1', 2], uv2: ['uvs2', 2], uv3: ['uvs3', 2] };
const MORPHED = { position: 'positions', normal: 'normals' };

export function simplifyGeometry(geometry, options) {
  const { onReport, ...rest } = options ?? {};
  const position = geometry.getAttribute('position');
  if (!position) throw new TypeError('the geometry has no positions');
  const indices = trianglesOf(geometry, position.count);
  const given = { positions: valuesOf(position, 3, 0), indices, attributes: {} };
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    if (name in OWN) given[OWN[name][0]] = valuesOf(attribute, OWN[name][1], 1);
    else if (name !== 'position') given.attributes[nameOf(name)] = labelsOrValues(name, attribute);
  }
  addMorphs(geometry, given);
  if (geometry.groups.length > 0) given.regions = regionsOf(geometry.groups, indices.length / 3);

  const result = simplifyMesh(given, rest);
  const lighter = new BufferGeometry();
  lighter.name = geometry.name;
  lighter.userData = { ...geometry.userData };
  lighter.morphTargetsRelative = geometry.morphTargetsRelative;
  const { order, groups } = grouped(result, geometry.groups);
  const count = result.positions.length / 3;
  const array = count <= 65535 ? Uint16Array.from(order) : order;
  lighter.setIndex(new BufferAttribute(array, 1));
  for (const group of groups) lighter.addGroup(group.start, group.count, group.materialIndex);
  lighter.setAttribute('position', attributeLike(position, result.positions, 3));
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    if (name === 'position') continue;
    const [values, size] = name in OWN ? [result[OWN[name][0]], OWN[name][1]] : namedOf(result, nameOf(name));
    if (values) lighter.setAttribute(name, attributeLike(attribute, values, size));
  }
  takeMorphs(geometry, result, lighter);
  if (geometry.boundingBox) lighter.computeBoundingBox();
  if (geometry.boundingSphere) lighter.computeBoundingSphere();
  for (const text of result.warnings) console.warn(`lodsmith: ${text}`);
  onReport?.(result.report);
  return lighter;
}

function nameOf(name) {
  return NAMED[name]?.[0] ?? name;
}

function namedOf(result, name) {
  const found = result.attributes?.[name];
  return [found?.array, found?.itemSize];
}

/** Returns the triangles of the draw range. */
function trianglesOf(geometry, count) {
  const own = geometry.getIndex();
  const all = own ? plain(own) : Uint32Array.from({ length: count }, (_, i) => i);
  const { start } = geometry.drawRange;
  const end = Math.min(all.length, start + geometry.drawRange.count);
  return Uint32Array.from(all.subarray(start, start + Math.max(0, Math.floor((end - start) / 3) * 3)));
}

/** Returns the values of an attribute without gaps, in the type of its array. */
function plain(attribute) {
  if (!attribute.isInterleavedBufferAttribute) return attribute.array;
  const { count, itemSize, offset, data } = attribute;
  const all = new data.array.constructor(count * itemSize);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < itemSize; k++) all[i * itemSize + k] = data.array[i * data.stride + offset + k];
  }
  return all;
}

/** Returns the values of an attribute as floats, in rows of a size. */
function valuesOf(attribute, size, filled) {
  const values = floats(plain(attribute), attribute.normalized);
  return resized(values, attribute.itemSize, size, filled);
}

/** Returns integers unchanged, which are not interpolated, and other values as floats. */
function labelsOrValues(name, attribute) {
  const values = plain(attribute);
  const isLabel = isWhole(values, attribute.normalized) && !(name in NAMED);
  const size = NAMED[name]?.[1] ?? attribute.itemSize;
  const array = isLabel && !(values instanceof Uint8ClampedArray) ? values : floats(values, attribute.normalized);
  return { array: resized(array, attribute.itemSize, size, 0), itemSize: size };
}

/** Returns an attribute with the type of another attribute. */
function attributeLike(attribute, values, size) {
  const rows = resized(values, size, attribute.itemSize, 0);
  const like = attribute.isInterleavedBufferAttribute ? attribute.data.array : attribute.array;
  const made = new BufferAttribute(asTypeOf(rows, like, attribute.normalized), attribute.itemSize, attribute.normalized);
  made.name = attribute.name;
  return made;
}

/** Returns the group number of each triangle; triangles without a group share an additional number. */
function regionsOf(groups, faces) {
  const regions = new Uint32Array(faces).fill(groups.length);
  groups.forEach(({ start, count }, i) => {
    regions.fill(i, Math.floor(start / 3), Math.min(faces, Math.ceil((start + count) / 3)));
  });
  return regions;
}

/** Returns the triangles of a result group by group, and the groups. Triangles without a group come last. */
function grouped({ indices, regions }, groups) {
  if (!regions) return { order: indices, groups: [] };
  const order = new Uint32Array(indices.length);
  const made = [];
  let at = 0;
  for (let region = 0; region <= groups.length; region++) {
    const start = at;
    regions.forEach((of, face) => {
      if (of !== region) return;
      order.set(indices.subarray(3 * face, 3 * face + 3), at);
      at += 3;
    });
    if (at > start && region < groups.length) {
      made.push({ start, count: at - start, materialIndex: groups[region].materialIndex });
    }
  }
  return { order, groups: made };
}

/** Adds the morph targets as offsets. */
function addMorphs(geometry, given) {
  for (const [name, targets] of Object.entries(geometry.morphAttributes)) {
    targets.forEach((target, t) => {
      const array = valuesOf(target, target.itemSize, 0);
      if (geometry.morphTargetsRelative || !(name in MORPHED)) {
        given.attributes[morphName(name, t)] = { array, itemSize: target.itemSize };
        return;
      }
      const base = valuesOf(geometry.getAttribute(name), 3, 0);
      given.attributes[morphName(name, t)] = { array: array.map((x, i) => x - base[i]), itemSize: 3 };
    });
  }
}

function morphName(name, target) {
  return `morph${target}_${MORPHED[name] ?? name}`;
}

/** Sets the morph targets of a result. */
function takeMorphs(geometry, result, lighter) {
  for (const [name, targets] of Object.entries(geometry.morphAttributes)) {
    const made = targets.map((target, t) => {
      const [values, size] = namedOf(result, morphName(name, t));
      if (!values) return undefined;
      const base = name === 'position' ? result.positions : result.normals;
      const isAbsolute = !geometry.morphTargetsRelative && name in MORPHED;
      return attributeLike(target, isAbsolute ? values.map((x, i) => x + base[i]) : values, size);
    });
    if (made.every((x) => x !== undefined)) lighter.morphAttributes[name] = made;
  }
}
