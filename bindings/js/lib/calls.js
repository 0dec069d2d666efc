// The functions of index.js; importing them does not load the module.
import { core } from './core.js';
import { withProgress } from './progress.js';

const ARRAYS = ['positions', 'indices', 'normals', 'uvs', 'colors', 'tangents', 'regions', 'attributes'];
/** Names of three.js and glTF. */
const OTHERS = {
  position: 'positions', index: 'indices', normal: 'normals', uv: 'uvs', color: 'colors', tangent: 'tangents',
};
const OF_SCENES = ['instances', 'scale', 'system'];
/** A result can be an input again. */
const OF_RESULTS = ['report', 'warnings'];

/** Throws for properties that would not be used. */
function check(mesh, further = []) {
  const isUsed = (name) => ARRAYS.includes(name) || OF_RESULTS.includes(name) || further.includes(name);
  for (const name of Object.keys(mesh ?? {})) {
    if (isUsed(name) || mesh[name] === undefined || mesh[name] === null) continue;
    const like = OTHERS[name] ? `it is called ${OTHERS[name]}` : 'other attributes belong into attributes';
    throw new TypeError(`a mesh has no ${name}: ${like}`);
  }
}

/** Returns indices in the type of those of the input, if it is large enough. */
function indicesLike(given, made, count) {
  const like = given?.constructor ?? Uint32Array;
  if (made.constructor === like) return made;
  const bits = 8 * like.BYTES_PER_ELEMENT - (like.name.startsWith('I') ? 1 : 0);
  return count <= 2 ** bits ? like.from(made) : made;
}

/** Returns the losses of a run as texts. */
function losses(report) {
  const faces = report.cleanup.non_finite_faces;
  const texts = report.dropped.map((name) => `${name} dropped: a skin needs both joints and weights`);
  if (faces > 0) texts.unshift(`${faces} ${faces === 1 ? 'face has' : 'faces have'} a position that is not finite: removed`);
  return texts;
}

function finish(given, made) {
  return { ...made, indices: indicesLike(given.indices, made.indices, made.positions.length / 3) };
}

export function simplifyMesh(mesh, options) {
  const { simplifyMesh: call } = core();
  check(mesh);
  const made = withProgress(options, (rest, onProgress) => call(mesh, rest, onProgress));
  return { ...finish(mesh, made), warnings: losses(made.report) };
}

export function simplifyScene(scene, options) {
  const { simplifyScene: call } = core();
  for (const mesh of scene.meshes) check(mesh, OF_SCENES);
  const made = withProgress(options, (rest, onProgress) => call(scene.meshes, scene.diagonal ?? 0, rest, onProgress));
  const meshes = made.meshes.map((mesh, i) => finish(scene.meshes[i], mesh));
  return { ...made, meshes, warnings: losses(made.report) };
}

export function options() {
  return core().optionTable();
}
