// Loads the WebAssembly module for meshes as soon as this file is imported.
import { load } from './core.js';

/** Resolves when functions of the module may be called. */
export const ready = load();
// Whoever waits for it gets the error; nobody else needs to be told.
ready.catch(() => {});
