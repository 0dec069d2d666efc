// Loads a WebAssembly module from the folder of this file.

/**
 * Returns what the `init` of a module takes: a URL to fetch, or in Node the bytes of the file.
 * @param {URL} url
 */
export async function source(url) {
  if (url.protocol !== 'file:') return url;
  const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:fs/promises');
  return readFile(url);
}
