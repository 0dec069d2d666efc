// Transforms for glTF Transform. The documentation is in gltf-transform.d.ts.
import { getBounds } from '@gltf-transform/core';
import { ready, simplifyScene } from './index.js';
import { asTypeOf, floats, isWhole, pick, resized, used } from './values.js';

export { LodsmithSimplifier } from './simplifier.js';

const [TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN] = [4, 5, 6];
const MORPHED = { POSITION: 'positions', NORMAL: 'normals', TANGENT: 'tangents' };

export function lodsmith(options) {
  const { onReport, ...rest } = options ?? {};
  const transform = async (document) => {
    await ready;
    const root = document.getRoot();
    const scene = root.getDefaultScene() ?? root.listScenes()[0] ?? null;
    const placed = placements(scene);
    const isPlaced = placed.size > 0;
    const taken = root
      .listMeshes()
      .filter((mesh) => !isPlaced || placed.has(mesh))
      .map((mesh) => gathered(document, mesh, placed.get(mesh)))
      .filter((mesh) => mesh !== null);
    if (taken.length === 0) return;
    const { min, max } = scene ? getBounds(scene) : { min: [0, 0, 0], max: [0, 0, 0] };
    const diagonal = Math.hypot(...max.map((x, k) => x - min[k]));
    const { meshes, report, warnings } = simplifyScene(
      { meshes: taken.map((mesh) => mesh.given), diagonal: Number.isFinite(diagonal) ? diagonal : 0 },
      rest,
    );
    meshes.forEach((result, i) => replace(document, taken[i], result));
    for (const text of warnings) document.getLogger().warn(`lodsmith: ${text}`);
    document.getLogger().debug(`lodsmith: ${report.input.faces} to ${report.output.faces} triangles`);
    onReport?.(report);
  };
  return Object.defineProperty(transform, 'name', { value: 'lodsmith' });
}

/** Returns, for each mesh of a scene, its number of instances, its scale, and its world matrix if it has one instance. */
function placements(scene) {
  const placed = new Map();
  scene?.traverse((node) => {
    const mesh = node.getMesh();
    if (!mesh) return;
    const matrix = node.getWorldMatrix();
    const copies = node.getExtension('EXT_mesh_gpu_instancing')?.listAttributes()[0]?.getCount() ?? 1;
    // The node of a skinned mesh does not transform it.
    const scale = node.getSkin() ? 0 : largestScale(matrix);
    const of = placed.get(mesh) ?? { instances: 0, scale: 0, matrix };
    placed.set(mesh, { instances: of.instances + copies, scale: Math.max(of.scale, scale), matrix });
  });
  return placed;
}

/** Returns the largest factor by which a matrix scales a length: the square root of the largest eigenvalue of MᵀM. */
function largestScale(m) {
  const times = (v) => [0, 1, 2].map((r) => m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2]);
  const back = (v) => [0, 1, 2].map((c) => m[4 * c] * v[0] + m[4 * c + 1] * v[1] + m[4 * c + 2] * v[2]);
  // (This direction is not orthogonal to an axis of usual matrices.)
  let v = [0.577, 0.578, 0.579];
  let scale = 0;
  for (let i = 0; i < 32; i++) {
    const next = back(times(v));
    const length = Math.hypot(...next);
    if (!(length > 0)) return 0;
    scale = Math.sqrt(length);
    v = next.map((x) => x / length);
  }
  return scale;
}

/** Returns the number of the coordinate system of a mesh: meshes with equal matrices share one. */
function systemOf(matrix) {
  const size = Math.max(...matrix.map(Math.abs));
  const text = matrix.map((x) => Math.round((x / size) * 1e6)).join() + ` ${size.toPrecision(6)}`;
  let hash = 0;
  for (const letter of text) hash = (hash * 31 + letter.charCodeAt(0)) % 2147483647;
  return hash;
}

/** Returns the name of an attribute of a mesh, and the size of its rows there. */
function slotOf(semantic, size) {
  const [, word, set] = /^([A-Z]+)(?:_(\d+))?$/.exec(semantic) ?? [null, semantic, undefined];
  const numbered = (name, first, width) => ({ name: set === '0' ? first : `${name}${set}`, size: width });
  switch (word) {
    case 'NORMAL':
      return { name: 'normals', size: 3 };
    case 'TANGENT':
      return { name: 'tangents', size: 4 };
    case 'TEXCOORD':
      return numbered('uvs', 'uvs', 2);
    case 'COLOR':
      return numbered('colors', 'colors', 4);
    case 'JOINTS':
      return numbered('joints', 'joints0', 4);
    case 'WEIGHTS':
      return numbered('weights', 'weights0', 4);
    default:
      return { name: semantic, size };
  }
}

const OWN = ['normals', 'tangents', 'uvs', 'colors'];

/** Returns the attributes of a primitive and of its morph targets, with their accessors. */
function attributesOf(primitive) {
  const all = [];
  for (const semantic of primitive.listSemantics().filter((semantic) => semantic !== 'POSITION')) {
    const accessor = primitive.getAttribute(semantic);
    const slot = slotOf(semantic, accessor.getElementSize());
    all.push({ accessor, slot, put: (made) => primitive.setAttribute(semantic, made) });
  }
  primitive.listTargets().forEach((target, t) => {
    for (const semantic of target.listSemantics()) {
      const accessor = target.getAttribute(semantic);
      const word = MORPHED[semantic] ?? semantic;
      const slot = { name: `morph${t}_${word}`, size: accessor.getElementSize() };
      all.push({ accessor, slot, put: (made) => target.setAttribute(semantic, made) });
    }
  });
  return all;
}

/** Returns the triangles of a primitive, for every mode with triangles. */
function trianglesOf(primitive) {
  const count = primitive.getAttribute('POSITION').getCount();
  const own = primitive.getIndices()?.getArray() ?? Uint32Array.from({ length: count }, (_, i) => i);
  const mode = primitive.getMode();
  if (mode === TRIANGLES) return own.length % 3 === 0 ? own : own.subarray(0, own.length - (own.length % 3));
  const all = [];
  for (let i = 0; i + 2 < own.length; i++) {
    if (mode === TRIANGLE_FAN) all.push(own[0], own[i + 1], own[i + 2]);
    else if (i % 2 === 0) all.push(own[i], own[i + 1], own[i + 2]);
    else all.push(own[i + 1], own[i], own[i + 2]);
  }
  return all;
}

/** Returns the triangles of a mesh as arrays, one region for each primitive; null if there are none. */
function gathered(document, mesh, place) {
  const primitives = mesh
    .listPrimitives()
    .filter((p) => [TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN].includes(p.getMode()) && p.getAttribute('POSITION'));
  const parts = primitives.map((primitive) => {
    const position = primitive.getAttribute('POSITION');
    return { primitive, position, triangles: trianglesOf(primitive), attributes: attributesOf(primitive) };
  });
  const faces = parts.reduce((n, p) => n + p.triangles.length / 3, 0);
  if (faces === 0) return null;
  const count = parts.reduce((n, p) => n + p.position.getCount(), 0);

  const given = { positions: new Float32Array(3 * count), indices: new Uint32Array(3 * faces), attributes: {} };
  const regions = new Uint32Array(faces);
  let [vertex, corner] = [0, 0];
  parts.forEach(({ position, triangles, attributes }, region) => {
    given.positions.set(floats(position.getArray(), position.getNormalized()), 3 * vertex);
    regions.fill(region, corner / 3, (corner + triangles.length) / 3);
    for (const i of triangles) given.indices[corner++] = vertex + i;
    for (const { accessor, slot } of attributes) fill(given, slot, accessor, vertex, count);
    vertex += position.getCount();
  });
  if (parts.length > 1) given.regions = regions;
  if (place) {
    given.instances = place.instances;
    given.scale = place.scale || 1;
    if (place.instances === 1) given.system = systemOf(place.matrix);
  }
  return { mesh, parts, given };
}

/** Writes the values of an accessor into the array of its attribute; primitives without it get 0, or white. */
function fill(given, slot, accessor, vertex, count) {
  const isColor = slot.name.startsWith('colors');
  const own = accessor.getArray();
  const isLabel = isWhole(own, accessor.getNormalized()) && !/^(joints|morph|uvs|weights)\d*/.test(slot.name) && !isColor
    && !OWN.includes(slot.name);
  let to = OWN.includes(slot.name) ? given[slot.name] : given.attributes[slot.name]?.array;
  if (!to) {
    to = isLabel ? new own.constructor(slot.size * count) : new Float32Array(slot.size * count).fill(isColor ? 1 : 0);
    if (OWN.includes(slot.name)) given[slot.name] = to;
    else given.attributes[slot.name] = { array: to, itemSize: slot.size };
  }
  const values = isLabel ? own : floats(own, accessor.getNormalized());
  to.set(resized(values, accessor.getElementSize(), slot.size, 1), slot.size * vertex);
}

/** Replaces the triangles of a mesh. */
function replace(document, { mesh, parts }, result) {
  const old = new Set();
  parts.forEach(({ primitive, position, attributes }, region) => {
    const { rows, indices } = used(result.indices, result.regions, region);
    const set = (accessor, values, put) => {
      const like = accessor.getArray();
      const array = asTypeOf(values, like, accessor.getNormalized());
      put(
        document
          .createAccessor(accessor.getName())
          .setType(accessor.getType())
          .setNormalized(accessor.getNormalized())
          .setBuffer(accessor.getBuffer())
          .setArray(array),
      );
      old.add(accessor);
    };
    if (indices.length === 0) {
      [position, primitive.getIndices(), ...attributes.map((a) => a.accessor)].forEach((a) => a && old.add(a));
      primitive.dispose();
      return;
    }
    set(position, pick(result.positions, 3, rows), (a) => primitive.setAttribute('POSITION', a));
    for (const { accessor, slot, put } of attributes) {
      const from = OWN.includes(slot.name) ? result[slot.name] : result.attributes?.[slot.name]?.array;
      if (!from) {
        // The report of the engine names dropped attributes.
        put(null);
        old.add(accessor);
        continue;
      }
      set(accessor, resized(pick(from, slot.size, rows), slot.size, accessor.getElementSize(), 0), put);
    }
    const known = primitive.getIndices();
    const array = rows.length <= 65535 ? Uint16Array.from(indices) : Uint32Array.from(indices);
    const accessor = document.createAccessor(known?.getName() ?? '').setType('SCALAR').setArray(array);
    primitive.setIndices(accessor.setBuffer((known ?? position).getBuffer())).setMode(TRIANGLES);
    if (known) old.add(known);
  });
  for (const accessor of old) {
    if (accessor.listParents().every((parent) => parent.propertyType === 'Root')) accessor.dispose();
  }
  if (mesh.listPrimitives().length === 0) mesh.dispose();
}
