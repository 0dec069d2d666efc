// Loads a WebAssembly module from the folder of this file.

/** Returns what the `init` of a module takes: a URL to fetch, or the bytes of the file. */
let read = async (url) => url;

/** Reads modules by another function; `node/load.js` sets one that reads files. */
export function readBy(other) {
  read = other;
}

/** @param {URL} url */
export function source(url) {
  return read(url);
}
