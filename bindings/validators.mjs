// Runs the glTF validator of Khronos: prints the errors of each named file, a line of JSON for each.
//
// The validator does not know the extensions of meshoptimizer, so such files are also validated as the decoder of
// meshoptimizer unpacks them.
//
// usage: node validators.mjs FOLDER FILE...     (FOLDER has the packages gltf-validator and meshoptimizer)

import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, ...files] = process.argv.slice(2);
const require = createRequire(path.resolve(folder, 'none.js'));
const { validateBytes } = require('gltf-validator');
const { MeshoptDecoder } = await import(pathToFileURL(require.resolve('meshoptimizer')));
await MeshoptDecoder.ready;

const MESHOPT = ['EXT_meshopt_compression', 'KHR_meshopt_compression'];

/** Returns the JSON of a file, and the contents of its buffers; those without a place are `undefined`. */
async function parsed(bytes, read) {
    let json = bytes;
    let bin;
    if (bytes.toString('latin1', 0, 4) === 'glTF') {
        const end = 20 + bytes.readUInt32LE(12);
        json = bytes.subarray(20, end);
        bin = bytes.subarray(end + 8);
    }
    json = JSON.parse(json);
    const buffers = (json.buffers ?? []).map(({ uri }, at) => {
        if (uri === undefined) return at === 0 ? bin : undefined;
        return uri.startsWith('data:') ? Buffer.from(uri.slice(uri.indexOf(',') + 1), 'base64') : read(uri);
    });
    return { json, buffers: await Promise.all(buffers) };
}

/** Returns a GLB with all of its views unpacked, `undefined` if none is packed. */
async function unpacked(bytes, read) {
    const { json, buffers } = await parsed(bytes, read);
    if (!json.extensionsUsed?.some((name) => MESHOPT.includes(name))) return undefined;
    const parts = [];
    let length = 0;
    for (const view of json.bufferViews) {
        const name = MESHOPT.find((name) => view.extensions?.[name]);
        let part;
        if (name === undefined) {
            const start = view.byteOffset ?? 0;
            part = buffers[view.buffer].subarray(start, start + view.byteLength);
        } else {
            const { buffer, byteOffset = 0, byteLength, byteStride, count, mode, filter } = view.extensions[name];
            part = new Uint8Array(count * byteStride);
            const source = buffers[buffer].subarray(byteOffset, byteOffset + byteLength);
            MeshoptDecoder.decodeGltfBuffer(part, count, byteStride, source, mode, filter);
            delete view.extensions;
        }
        parts.push(part, new Uint8Array(-part.length & 3));
        [view.buffer, view.byteOffset] = [0, length];
        length += part.length + (-part.length & 3);
    }
    json.buffers = [{ byteLength: length }];
    for (const list of ['extensionsUsed', 'extensionsRequired']) {
        json[list] = json[list]?.filter((name) => !MESHOPT.includes(name));
        if (!json[list]?.length) delete json[list];
    }
    const text = Buffer.from(JSON.stringify(json));
    const spaces = Buffer.alloc(-text.length & 3, ' ');
    const words = [0x46546c67, 2, 28 + text.length + spaces.length + length, text.length + spaces.length, 0x4e4f534a];
    const head = Buffer.from(Uint32Array.from(words).buffer);
    const between = Buffer.from(Uint32Array.of(length, 0x004e4942).buffer);
    return Buffer.concat([head, text, spaces, between, ...parts]);
}

async function errorsOf(bytes, uri, read) {
    const externalResourceFunction = async (uri) => new Uint8Array(await read(uri));
    // As many issues as there are.
    const report = await validateBytes(new Uint8Array(bytes), { uri, maxIssues: 0, externalResourceFunction });
    return report.issues.messages.filter((issue) => issue.severity === 0);
}

for (const file of files) {
    const read = (uri) => readFile(path.resolve(path.dirname(file), decodeURIComponent(uri)));
    const name = path.basename(file);
    let errors;
    try {
        const bytes = await readFile(file);
        errors = await errorsOf(bytes, name, read);
        const plain = await unpacked(bytes, read);
        if (plain !== undefined) errors = errors.concat(await errorsOf(plain, name, read));
    } catch (error) {
        // It is no glTF file, or cannot be unpacked.
        errors = [...(errors ?? []), { code: 'REFUSED', message: String(error), pointer: '' }];
    }
    const shown = ({ code, message, pointer, offset }) => ({ code, message, pointer: pointer ?? `byte ${offset}` });
    console.log(JSON.stringify(errors.map(shown)));
}
