// Writes the types of the options, from the table of the engine, into options.d.ts of the package.
//
// usage: node options_types.mjs DIST
import { writeFile } from 'node:fs/promises';
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const dist = resolve(process.argv[2]);
const { options, ready } = await import(pathToFileURL(`${dist}/index.js`).href);
await ready;

const TYPES = {
  count: 'number',
  ratio: 'number | `${number}%`',
  length: 'number | `${number}%`',
  degrees: 'number',
  flag: 'boolean',
  number: 'number',
  weights: 'Record<string, number>',
  seed: 'number',
};
const rows = options().map(({ name, kind, words, default: initial, help }) => {
  const type = kind === 'word' ? words.map((word) => `'${word}'`).join(' | ') : TYPES[kind];
  const remark = initial === null ? '' : ` Default: ${initial}.`;
  return `  /** ${help}${remark} */\n  ${name}?: ${type};\n`;
});
await writeFile(
  `${dist}/options.d.ts`,
  `/** Options of the engine: those of \`lodsmith simplify\`, with the same values and the same defaults. */
export interface EngineOptions {\n${rows.join('')}}\n`,
);
