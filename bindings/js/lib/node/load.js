// In Node, modules are files. This is the only file for the main thread that imports modules of Node, so that bundlers for
// browsers find none.
import { readFile } from 'node:fs/promises';
import { readBy } from '../load.js';

readBy(async (url) => (url.protocol === 'file:' ? readFile(url) : url));
