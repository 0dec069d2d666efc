// The command, if LODSMITH is set to its path.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

export const command = process.env.LODSMITH;
/** The folder of the test data of the repository. */
export const testdata = process.env.LODSMITH_TESTDATA;

/** Returns the output of `lodsmith simplify` for a file with these bytes. */
export function simplifyFile(bytes, extension, args) {
  const folder = mkdtempSync(join(tmpdir(), 'lodsmith-'));
  try {
    const [input, output] = ['in', 'out'].map((name) => join(folder, `${name}.${extension}`));
    writeFileSync(input, bytes);
    execFileSync(command, ['simplify', input, '-o', output, '--quiet', ...args]);
    return readFileSync(output);
  } finally {
    rmSync(folder, { recursive: true });
  }
}
