// The page of the viewer: the files that the user opens, the workers, and downloads. Nothing is sent anywhere:
// the only requests are for the other files of this page.
import init, { start, zip } from './lodsmith.js';

const status = document.getElementById('status');
const canvas = document.getElementById('window');

/**
 * Files by path: the blob, and the number of the drop or choice that it came with. A model can use the files of its own
 * batch. A worker reads the bytes when it needs them.
 */
const files = new Map();
let batches = 0;
/** Paths that the viewer has not opened yet. */
let opened = [];
let viewer = null;
let compiled = null;

/** Compiles the module once, for the window and all workers. */
async function compile() {
  const url = new URL('./lodsmith_bg.wasm', import.meta.url);
  try {
    return await WebAssembly.compileStreaming(fetch(url));
  } catch {
    // Some hosts send the file with another MIME type.
    return WebAssembly.compile(await (await fetch(url)).arrayBuffer());
  }
}

/** Starts a worker with the compiled module. */
function newWorker() {
  const worker = new Worker(new URL('./worker.js', import.meta.url), { type: 'module' });
  worker.postMessage({ compiled });
  return worker;
}

/** Returns the files of a ZIP archive. */
function unpack(blob) {
  const worker = newWorker();
  return new Promise((resolve, reject) => {
    worker.onerror = (event) => reject(new Error(event.message));
    worker.onmessage = ({ data }) => (data.failed === undefined ? resolve(data.unpacked) : reject(new Error(data.failed)));
    worker.postMessage({ unpack: blob });
  }).finally(() => worker.terminate());
}

/** Adds files, given as pairs of path and blob, and opens them. The viewer gets the bytes of those `isInMemory`. */
async function openFiles(pairs, isInMemory = () => false) {
  const all = [];
  const batch = ++batches;
  for (const [path, blob] of pairs) {
    if (/\.zip$/i.test(path)) {
      const inner = await unpack(blob).catch((why) => {
        throw new Error(`${path}: ${why.message}`);
      });
      all.push(...inner);
    }
    else all.push([path, blob]);
  }
  for (const [path, blob] of all) {
    if (isInMemory(path)) viewer.putFile(path, new Uint8Array(await blob.arrayBuffer()));
    else files.set(path, { blob, batch });
  }
  opened.push(...all.map(([path]) => path));
  viewer.wake();
}

/** Returns the files of a dropped file or folder as pairs of path and file. */
async function filesOf(entry) {
  const path = entry.fullPath.replace(/^\//, '');
  if (entry.isFile) return [[path, await new Promise((resolve, reject) => entry.file(resolve, reject))]];
  const reader = entry.createReader();
  const all = [];
  for (;;) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return all;
    for (const inner of some) all.push(...(await filesOf(inner)));
  }
}

const isSession = (path) => /\.json$/i.test(path);

async function drop(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  const pairs = entries.length > 0 ? (await Promise.all(entries.map(filesOf))).flat() : [...transfer.files].map((f) => [f.name, f]);
  await openFiles(pairs, isSession);
}

/** Shows an error in the window. */
const failed = (why) => viewer.fail(why.message ?? `${why}`);

/** Shows an error of the page instead of the window. */
function fail(why) {
  status.hidden = false;
  status.style.display = '';
  status.textContent = `Lodsmith cannot run here: ${why.message ?? why}`;
}

/** The functions that the viewer calls. */
const host = {
  startWorker(wake) {
    const worker = newWorker();
    const messages = [];
    const push = (message) => {
      messages.push(message);
      wake();
    };
    const sent = new Map();
    worker.onmessage = ({ data }) => push(data);
    worker.onerror = (event) => push({ failed: event.message || 'the worker ran out of memory' });
    return {
      post(request) {
        // Blobs are handles: the worker reads only the files of the model that it opens.
        const added = [...files].filter(([path, file]) => sent.get(path) !== file);
        for (const [path, file] of added) sent.set(path, file);
        worker.postMessage({ request, added });
      },
      poll: () => messages.shift(),
      end: () => worker.terminate(),
    };
  },
  chooseFiles(extensions, areModels) {
    const input = document.createElement('input');
    input.type = 'file';
    input.multiple = areModels;
    const others = areModels ? ['zip', 'mtl', 'bin', 'png', 'jpg', 'jpeg', 'webp'] : [];
    input.accept = [...extensions, ...others].map((e) => `.${e}`).join(',');
    input.onchange = () => openFiles([...input.files].map((f) => [f.name, f]), () => !areModels).catch(failed);
    input.click();
  },
  putFile(path, bytes) {
    files.set(path, { blob: new Blob([bytes]), batch: ++batches });
  },
  takeOpened() {
    const paths = opened;
    opened = [];
    return paths;
  },
  save(name, bytes) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([bytes], { type: 'application/octet-stream' }));
    link.download = name.split('/').at(-1);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  },
  saveAll(folder, all) {
    this.save(`${folder}.zip`, zip(all));
  },
};

/**
 * Removes egui's second texture filter, meant for tests, from its shader: software renderers compute both branches,
 * and take seven times as long for each pixel.
 */
function simplifyShaders() {
  const { shaderSource } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.shaderSource = function (shader, text) {
    shaderSource.call(this, shader, text.replace(/uint (\w+) = \w+\.predictable_texture_filtering;/, 'const uint $1 = 0u;'));
  };
}

async function run() {
  simplifyShaders();
  compiled = await compile();
  await init({ module_or_path: compiled });
  viewer = await start(canvas, host);
  status.hidden = true;
  status.style.display = 'none';
  // (The canvas also gets the drop, so that it hides its hint.)
  addEventListener('dragover', (event) => event.preventDefault());
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    drop(event.dataTransfer).catch(failed);
  }, { capture: true });
  // For tests, and for pages that embed this one in a frame.
  globalThis.lodsmith = {
    open: (pairs) => openFiles(pairs, isSession),
    state: () => JSON.parse(viewer.state()),
    widgets: () => JSON.parse(viewer.widgets()) ?? [],
  };
}

run().catch(fail);
