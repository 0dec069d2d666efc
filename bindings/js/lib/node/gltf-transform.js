import './load.js';

export * from '../gltf-transform.js';
