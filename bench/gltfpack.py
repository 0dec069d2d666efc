#!/usr/bin/env python3
"""Compares the bytes and the errors of `lodsmith convert --compress --quantize` with those of `gltfpack -cc`.

    bench/gltfpack.py --gltfpack node_modules/.bin/gltfpack [--lodsmith target/release/lodsmith] FILE...

gltfpack keeps names, materials, extras and all attributes (-kn -km -ke -kv) and all animation tracks (-ac), and does
not resample them (-af 0), as lodsmith does. Bytes are the file size without images, which neither program changes.
`lodsmith compare` measures the errors of both decoded files: the RMS distance in percent of the diagonal, and the RMS
angle of normals. The last columns are transformed vertices per triangle (ACMR) and bytes fetched per byte of vertices,
from `lodsmith info`.
"""

import argparse
import json
import pathlib
import struct
import subprocess
import tempfile


def image_bytes(path):
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20 : 20 + length])
    views = gltf.get("bufferViews", [])
    used = {i["bufferView"] for i in gltf.get("images", []) if "bufferView" in i}
    return sum(views[v]["byteLength"] for v in used)


def run(command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def last_line(error):
    lines = (error.stderr or error.stdout or "").strip().splitlines()
    return lines[-1] if lines else f"status {error.returncode}"


def figures(lodsmith, source, path):
    compared = json.loads(run([lodsmith, "compare", "-q", source, path, "--json"]))
    info = json.loads(run([lodsmith, "info", "-q", path, "--json"]))
    rms = 100 * compared["rms"]["symmetric"] / compared["diagonal"]
    normals = compared.get("attributes", {}).get("normal") or compared.get("normals") or {}
    return rms, normals, info["cache"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gltfpack", required=True)
    parser.add_argument("--lodsmith", default="target/release/lodsmith")
    parser.add_argument("--extension", choices=["ext", "khr"], default="ext")
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    args = parser.parse_args()
    compress = {"ext": "meshopt", "khr": "meshopt-khr"}[args.extension]
    print("| file | gltfpack | lodsmith | ratio | RMS % g / l | ACMR g / l | overfetch g / l |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for source in args.files:
            plain, theirs, ours = folder / "plain.glb", folder / "theirs.glb", folder / "ours.glb"
            keep = ["-cc", "-kn", "-km", "-ke", "-kv", "-af", "0", "-ac", "-ce", args.extension]
            try:
                run([args.lodsmith, "convert", "-q", source, plain, "--force"])
                run([args.lodsmith, "convert", "-q", plain, ours, "--compress", compress, "--quantize", "--force"])
                run([args.gltfpack, "-i", plain, "-o", theirs, *keep])
            except subprocess.CalledProcessError as error:
                program = pathlib.Path(error.cmd[0]).name
                print(f"| {source.name} | {program} failed: {last_line(error)} | | | | | |", flush=True)
                continue
            sizes = [p.stat().st_size - image_bytes(p) for p in (theirs, ours)]
            rows = [figures(args.lodsmith, plain, p) for p in (theirs, ours)]
            cells = [source.name, *(f"{s:,}" for s in sizes), f"{sizes[1] / sizes[0]:.3f}"]
            cells.append(" / ".join(f"{r[0]:.2g}" for r in rows))
            cells.append(" / ".join(f"{r[2]['acmr']:.3f}" for r in rows))
            cells.append(" / ".join(f"{r[2]['overfetch']:.2f}" for r in rows))
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
