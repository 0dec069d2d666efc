import './load.js';

export * from '../glb.js';
