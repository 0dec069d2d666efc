// A worker of the page: runs the engine. Its first message is the compiled module, and all others are requests. It
// posts progress and then the bytes of the answer. Cancelling terminates it.
import init, { WebEngine, unpack } from './lodsmith.js';

const files = new Map();
let engine = null;
let ready = null;

const isModel = (path) => /\.(3mf|dae|fbx|glb|gltf|lpm|obj|off|ply|stl)(\.gz)?$/i.test(path);

/** Gives the engine a model and the files that came with it, without other models. */
async function putFiles(model) {
  const { batch } = files.get(model) ?? {};
  for (const [path, file] of files) {
    if (path === model || (file.batch === batch && !isModel(path))) {
      engine.putFile(path, new Uint8Array(await file.blob.arrayBuffer()));
    }
  }
}

async function handle({ compiled, request, added, unpack: archive }) {
  if (compiled) {
    ready = init({ module_or_path: compiled });
    return;
  }
  await ready;
  if (archive) {
    const all = unpack(new Uint8Array(await archive.arrayBuffer()));
    postMessage({ unpacked: all.map(([path, bytes]) => [path, new Blob([bytes])]) });
    return;
  }
  engine ??= new WebEngine();
  for (const [path, file] of added) files.set(path, file);
  if (engine.needsFiles(request)) await putFiles(JSON.parse(request).path);
  const answer = engine.run(request, (done, stage) => postMessage({ done, stage }));
  postMessage({ answer }, [answer.buffer]);
}

let last = Promise.resolve();
addEventListener('message', ({ data }) => {
  last = last.then(() => handle(data)).catch((why) => postMessage({ failed: String(why.message ?? why) }));
});
