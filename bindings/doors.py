#!/usr/bin/env python3
"""The same job through every interface: command, Python, JavaScript, C, viewer. All give the same bytes and report.

The job simplifies a scene with a palette of more than 4 million pixels, instances and a skin, and bakes normals.

usage: doors.py --command PROGRAM [--python INTERPRETER] [--js FOLDER] [--c PROGRAM] [--viewer PROGRAM]

INTERPRETER has the package, FOLDER has `node_modules/lodsmith`; the C program is `examples/file_job`, the program of
the viewer is the example `export` of lodsmith-viewer. Interfaces that are not given are skipped, with a message.
"""

import argparse
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

OPTIONS = {"ratio": 0.4, "bake": ["normal"], "texture_size": 64}

#: Side of the palette in pixels, and number of its colours along a side.
SIDE, CELLS = 2304, 4


def png():
    """Return a palette as PNG: squares of plain colours."""
    rows = []
    for cell in range(CELLS):
        pixels = b"".join(
            bytes([40 + 50 * column, 220 - 40 * cell, 30 + 60 * ((column + cell) % 4)]) * (SIDE // CELLS)
            for column in range(CELLS)
        )
        rows.append((b"\0" + pixels) * (SIDE // CELLS))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", SIDE, SIDE, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"".join(rows), 9)) + chunk(b"IEND", b"")


class Scene:
    """A GLB file under construction."""

    def __init__(self):
        self.bin, self.views, self.accessors = bytearray(), [], []

    def view(self, data):
        self.bin += b"\0" * (-len(self.bin) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.bin), "byteLength": len(data)})
        self.bin += data
        return len(self.views) - 1

    def add(self, rows, kind, code, letter):
        flat = [x for row in rows for x in row]
        accessor = {"bufferView": self.view(struct.pack(f"<{len(flat)}{letter}", *flat)), "componentType": code}
        accessor.update(count=len(rows), type=kind)
        if kind == "VEC3":
            accessor.update(min=[min(c) for c in zip(*rows)], max=[max(c) for c in zip(*rows)])
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def floats(self, rows, kind):
        return self.add(rows, kind, 5126, "f")

    def indices(self, triangles):
        return self.add([[i] for t in triangles for i in t], "SCALAR", 5125, "I")

    def write(self, path, **parts):
        document = {"asset": {"version": "2.0"}, "bufferViews": self.views, "accessors": self.accessors, **parts}
        document["buffers"] = [{"byteLength": len(self.bin)}]
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.bin) + b"\0" * (-len(self.bin) % 4)
        with open(path, "wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data)


def grid(columns, rows, point):
    """Return the points and triangles of a grid."""
    places = [point(i / columns, j / rows) for j in range(rows + 1) for i in range(columns + 1)]
    triangles = []
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            triangles += [[a, a + 1, a + columns + 2], [a, a + columns + 2, a + columns + 1]]
    return places, triangles


def make_scene(path):
    scene = Scene()
    # A wavy sheet of four patches, each of one colour of the palette.
    positions, uvs, triangles = [], [], []
    for patch in range(4):
        left, low = patch % 2, patch // 2

        def wave(u, v, left=left, low=low):
            x, y = left + u, low + v
            return [x, y, 0.1 * math.sin(5 * x) * math.cos(4 * y) + 0.02 * math.sin(31 * x + 17 * y)]

        places, own = grid(24, 24, wave)
        triangles += [[i + len(positions) for i in t] for t in own]
        positions += places
        uvs += [[(patch + 0.5) / CELLS, (patch % 3 + 0.5) / CELLS]] * len(places)
    sheet = {"POSITION": scene.floats(positions, "VEC3"), "TEXCOORD_0": scene.floats(uvs, "VEC2")}
    sheet = {"attributes": sheet, "indices": scene.indices(triangles), "material": 0}

    def tube(u, v):
        radius = 0.3 + 0.02 * math.sin(9 * v) * math.cos(4 * math.pi * u)
        return [radius * math.cos(2 * math.pi * u), 2 * v, radius * math.sin(2 * math.pi * u)]

    positions, triangles = grid(32, 40, tube)
    weights = [[1 - p[1] / 2, p[1] / 2, 0.0, 0.0] for p in positions]
    skinned = {
        "POSITION": scene.floats(positions, "VEC3"),
        "JOINTS_0": scene.add([[0, 1, 0, 0]] * len(positions), "VEC4", 5121, "B"),
        "WEIGHTS_0": scene.floats(weights, "VEC4"),
    }
    skinned = {"attributes": skinned, "indices": scene.indices(triangles), "material": 1}
    unit = [1.0 if i % 5 == 0 else 0.0 for i in range(16)]
    inverse = scene.floats([unit, unit[:13] + [-1.0] + unit[14:]], "MAT4")
    scene.write(
        path,
        images=[{"mimeType": "image/png", "bufferView": scene.view(png())}],
        textures=[{"source": 0}],
        materials=[{"name": "sheet", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, {"name": "tube"}],
        meshes=[{"name": "sheet", "primitives": [sheet]}, {"name": "tube", "primitives": [skinned]}],
        skins=[{"joints": [4, 5], "inverseBindMatrices": inverse}],
        nodes=[
            {"mesh": 0},
            {"mesh": 0, "translation": [3, 0, 0]},
            {"mesh": 0, "translation": [0, 3, 0], "rotation": [0, 0, 0.7071068, 0.7071068]},
            {"mesh": 1, "skin": 0},
            {"children": [5]},
            {"translation": [0, 1, 0]},
        ],
        scenes=[{"nodes": [0, 1, 2, 3, 4]}],
        scene=0,
    )


def run(words, **options):
    done = subprocess.run(words, capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{words[0]}: {done.stderr or done.stdout}")
    return json.loads(done.stdout)


PYTHON = """
import json, sys, lodsmith
print(json.dumps(lodsmith.simplify_file(sys.argv[1], sys.argv[2], **json.loads(sys.argv[3]))))
"""

JAVASCRIPT = """
import { readFileSync, writeFileSync } from 'node:fs';
import { simplifyGlb } from 'lodsmith/glb';
const [input, output, options] = process.argv.slice(1);
const { texture_size: textureSize, ...rest } = JSON.parse(options);
const { bytes, report } = await simplifyGlb(readFileSync(input), { textureSize, ...rest });
writeFileSync(output, bytes);
console.log(JSON.stringify(report));
"""


def of_command(args, scene, out):
    words = [f"--ratio={OPTIONS['ratio']}", f"--bake={','.join(OPTIONS['bake'])}", f"--texture-size={OPTIONS['texture_size']}"]
    return run([args.command, "simplify", scene, "-o", out, "--json", *words])


def of_python(args, scene, out):
    return run([args.python, "-W", "ignore", "-c", PYTHON, scene, out, json.dumps(OPTIONS)])


def of_js(args, scene, out):
    return run(["node", "--input-type=module", "-e", JAVASCRIPT, scene, out, json.dumps(OPTIONS)], cwd=args.js)


def of_c(args, scene, out):
    return run([args.c, "simplify", scene, out, json.dumps(OPTIONS)])["report"]


def of_viewer(args, scene, out):
    return run([args.viewer, scene, out, json.dumps(OPTIONS)])


def comparable(report):
    """Return a report without times, paths, and keys that only reports of files have."""
    for key in ("seconds", "threads"):
        report.pop(key, None)
    for end in ("input", "output"):
        for key in ("path", "format", "sizes"):
            report[end].pop(key, None)
    return report


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("command", "python", "js", "c", "viewer"):
        parser.add_argument(f"--{name}", required=name == "command")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = str(pathlib.Path(folder, "scene.glb"))
        make_scene(scene)
        expected = None
        for name, door in (("command", of_command), ("python", of_python), ("js", of_js), ("c", of_c), ("viewer", of_viewer)):
            if getattr(args, name) is None:
                print(f"SKIPPED doors: {name} is not given")
                continue
            out = pathlib.Path(folder, f"{name}.glb")
            report = comparable(door(args, scene, str(out)))
            got = out.read_bytes()
            if expected is None:
                expected = got, report
                if not report["reached"] or report["output"]["faces"] >= report["input"]["faces"]:
                    sys.exit(f"the job of the command did nothing: {report}")
            if got != expected[0]:
                sys.exit(f"{name}: the bytes differ from the command")
            # The viewer only reports the run.
            differences = [key for key in report if report[key] != expected[1].get(key)]
            if name != "viewer":
                differences += [key for key in expected[1] if key not in report]
            if differences:
                key = differences[0]
                sys.exit(f"{name}: the report differs from the command: {key}: {report.get(key)} is not {expected[1].get(key)}")
            print(f"{name}: same {len(got)} bytes and report")


if __name__ == "__main__":
    main()
