import './load.js';

export * from '../three.js';
