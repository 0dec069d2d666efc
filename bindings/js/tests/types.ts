// Checked by tsc, not run.
import { Document } from '@gltf-transform/core';
import { simplify } from '@gltf-transform/functions';
import { type SimplifyOptions, options, ready, simplifyMesh, simplifyScene } from 'lodsmith';
import { simplifyGlb } from 'lodsmith/glb';
import { LodsmithSimplifier, lodsmith } from 'lodsmith/gltf-transform';
import { simplifyGeometry } from 'lodsmith/three';
import { createWorker } from 'lodsmith/worker';
import { MeshoptSimplifier } from 'meshoptimizer';
import { BufferGeometry } from 'three';

await ready;
const mesh = { positions: new Float32Array(9), indices: Uint32Array.of(0, 1, 2) };
const typed: SimplifyOptions = { ratio: '10%', method: 'cluster', weight: { normal: 2 }, escalate: false };
const small = simplifyMesh(mesh, typed);
const faces: number = small.report.output.faces + small.indices.length;
simplifyScene({ meshes: [{ ...mesh, instances: 2 }], diagonal: 1 }, { faces }).counts[0].reached;
// @ts-expect-error There is no such option.
simplifyMesh(mesh, { rato: 0.1 });
// @ts-expect-error There is no such method.
simplifyMesh(mesh, { method: 'magic' });
// @ts-expect-error Positions are floats.
simplifyMesh({ positions: [0, 0, 0] }, { ratio: 0.1 });
const words: string[] = options().map((row) => row.name);
await new Document().transform(
  simplify({ simplifier: LodsmithSimplifier, ratio: 0.5 }),
  lodsmith({ ratio: 0.5, onReport: (report) => words.push(report.stopped_by) }),
);
const { bytes }: { bytes: Uint8Array } = await simplifyGlb(new Uint8Array(), { error: '0.1%' });
const geometry: BufferGeometry = simplifyGeometry(new BufferGeometry(), { ratio: 0.5 });
const worker = createWorker();
await worker.simplifyMesh(mesh, { ratio: 0.1 }, { signal: AbortSignal.timeout(1000), onProgress: (done) => void done });
// Takes the place of the other in a program with types.
const simplifier: typeof MeshoptSimplifier = LodsmithSimplifier;
void [bytes, geometry, simplifier, small.warnings.length];
