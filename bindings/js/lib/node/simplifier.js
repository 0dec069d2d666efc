import './load.js';

export * from '../simplifier.js';
