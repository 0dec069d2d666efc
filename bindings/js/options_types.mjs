// Writes options.d.ts of the package: the types of the options, from the tables of the two modules.
//
// usage: node options_types.mjs DIST
import { readFile, writeFile } from 'node:fs/promises';
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const dist = resolve(process.argv[2]);
const { options, ready } = await import(pathToFileURL(`${dist}/node/index.js`).href);
await ready;
const files = await import(pathToFileURL(`${dist}/wasm/lodsmith_files.js`).href);
await files.default({ module_or_path: await readFile(`${dist}/wasm/lodsmith_files_bg.wasm`) });

const TYPES = {
  count: 'number',
  ratio: 'number | `${number}%`',
  length: 'number | `${number}%`',
  degrees: 'number',
  flag: 'boolean',
  number: 'number',
  weights: 'Record<string, number>',
  seed: 'number',
  text: 'string',
};
/** What has no meaning for bytes: other files, threads, and the format, which is GLB. */
const NOT_OF_BYTES = 'from asset-root allow-outside to ascii textures force dry-run map-files threads'.split(' ');

const camel = (name) => name.replace(/-(.)/g, (_, letter) => letter.toUpperCase());
const row = ({ name, kind, words, list, default: initial, help }) => {
  const one = kind === 'word' ? words.map((word) => `'${word}'`).join(' | ') : TYPES[kind];
  const remark = initial === null ? '' : ` Default: ${initial}.`;
  const text = help.replace(/--([a-z-]+)/g, (_, other) => camel(other));
  return `  /** ${text}.${remark} */\n  ${camel(name)}?: ${list ? `(${one})[] | string` : one};\n`;
};
const engine = options();
const isOfFiles = ({ name }) => !NOT_OF_BYTES.includes(name) && !engine.some((option) => option.name === camel(name));
await writeFile(
  `${dist}/options.d.ts`,
  `/** Options of the engine, with the values and defaults of \`lodsmith simplify\`. */
export interface EngineOptions {\n${engine.map(row).join('')}}

/** Further options for a file. */
export interface FileOptions extends EngineOptions {\n${files.optionTable().filter(isOfFiles).map(row).join('')}}\n`,
);
