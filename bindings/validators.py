#!/usr/bin/env python3
"""Outputs of the command under the validators of others: that of Khronos for glTF, and lib3mf, strictly, for 3MF.

An output has no error of the glTF validator that its input does not have, and lib3mf reads it in strict mode without a
warning, or for one of the reasons in STRICT_EXCEPTIONS. Inputs are the models of `testdata`, and of a folder: scenes
(glTF, GLB, VRM, 3MF, DAE, FBX, and OBJ with materials), the smallest ones first.

usage: validators.py --command PROGRAM [--models FOLDER]     (default: ../shared/models)

The validators are installed into a temporary folder, with npm and pip. What cannot be checked is a line that begins with
SKIPPED. A failure is printed with the command that repeats it.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

#: Packages with the versions whose verdicts are known.
GLTF_VALIDATOR, MESHOPTIMIZER, LIB3MF = "gltf-validator@2.0.0-dev.3.10", "meshoptimizer@1", "lib3mf==2.5.0"

#: Jobs: name, extension of the output, arguments in which IN and OUT stand for files.
JOBS = [
    ("simplify to GLB", "glb", "simplify IN -o OUT --ratio 0.5"),
    ("simplify to glTF", "gltf", "simplify IN -o OUT --ratio 0.5"),
    ("simplify, meshopt", "glb", "simplify IN -o OUT --ratio 0.5 --compress meshopt"),
    ("simplify, quantized", "glb", "simplify IN -o OUT --ratio 0.5 --quantize"),
    ("simplify, all packing", "glb", "simplify IN -o OUT --ratio 0.5 --quantize --compress meshopt-khr"),
    ("simplify to 3MF", "3mf", "simplify IN -o OUT --ratio 0.5"),
    ("levels in one GLB", "glb", "lod IN -o OUT --levels 0.5,0.25"),
    ("convert to GLB", "glb", "convert IN OUT"),
    ("convert to 3MF", "3mf", "convert IN OUT"),
]

#: Inputs of a folder of models: what may have a scene.
SCENES = {".glb", ".gltf", ".vrm", ".3mf", ".dae", ".fbx", ".obj"}
GLTF = {".glb", ".gltf", ".vrm"}
#: Folders with files that are damaged on purpose; `cargo xtask corpus` runs them.
DAMAGED = {"broken", "dirty"}
#: Most models of a folder, and largest size of one: with these the run takes minutes on two cores.
MOST_MODELS, MOST_BYTES = 60, 4 << 20
#: Longest time of one process, in seconds: far more than any needs.
TIME_LIMIT = 300

#: What lib3mf does not know: text in the model part of a file, the warnings that it may then give, and the reason.
#: Such a file is read without strict mode, and may have no other warning.
STRICT_EXCEPTIONS = [
    (
        "pbmetallicdisplayproperties",
        {"Invalid Element in namespace."},
        "lib3mf 2.5 does not know this element of the materials extension (docs/formats.md)",
    ),
    (
        'printable="0"',
        {"Invalid Attribute in namespace."},
        "an attribute of slicers, which lib3mf refuses in their files too (docs/formats.md)",
    ),
    (
        " paint_",
        {"Invalid Attribute in namespace."},
        "attributes of slicers, which lib3mf refuses in their files too (docs/formats.md)",
    ),
]

#: Reads 3MF files with lib3mf; for each a line of JSON: an error or null, the warnings, and the number of items.
READ_3MF = """
import json, sys
import lib3mf
wrapper = lib3mf.get_wrapper()
for argument in sys.argv[1:]:
    mode, _, path = argument.partition(":")
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(mode == "strict")
    error = None
    try:
        reader.ReadFromFile(path)
    except lib3mf.ELib3MFException as refused:
        error = str(refused)
    warnings = [reader.GetWarning(i)[1] for i in range(reader.GetWarningCount())]
    print(json.dumps([error, warnings, model.GetBuildItems().Count()]), flush=True)
"""


def skipped(text):
    print(f"SKIPPED validators: {text}", flush=True)


def call(words):
    """Run a program; return its status, standard output and standard error."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired:
        return None, "", f"no end after {TIME_LIMIT} s"
    return done.returncode, done.stdout, done.stderr


def results(words, count):
    """Run a validator of several files; yield for each its line of JSON, or None and how the program ended."""
    status, output, errors = call(words)
    lines = output.splitlines()
    for i in range(count):
        if i < len(lines):
            yield json.loads(lines[i]), None
        else:
            yield None, f"ended with {status}: {errors.strip() or 'no message'}"


def last_line(text):
    return (text.strip().splitlines() or ["no message"])[-1]


def first_line(text):
    return (text.strip().splitlines() or ["no message"])[0]


class GltfValidator:
    """The validator of Khronos, in a folder of npm."""

    def __init__(self, folder):
        self.folder = folder

    @staticmethod
    def install(folder):
        if shutil.which("npm") is None or shutil.which("node") is None:
            skipped("glTF: no npm")
            return None
        folder.mkdir()
        words = ["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", str(folder), GLTF_VALIDATOR, MESHOPTIMIZER]
        status, _, errors = call(words)
        if status != 0:
            skipped(f"glTF: {GLTF_VALIDATOR} and {MESHOPTIMIZER} could not be installed: {last_line(errors)}")
            return None
        return GltfValidator(folder)

    def errors(self, paths):
        """Return for each file its errors: a dictionary from what they are, without numbers, to the first message."""
        words = ["node", str(ROOT / "bindings/validators.mjs"), str(self.folder), *map(str, paths)]
        found = []
        for errors, ended in results(words, len(paths)):
            kinds = {("ENDED", ""): f"the glTF validator {ended}"} if ended else {}
            for error in errors or []:
                # Numbers of elements change, and levels repeat what the original has.
                key = error["code"], re.sub(r"\d+", "*", error["pointer"])
                kinds.setdefault(key, f"{error['code']} at {error['pointer']}: {error['message']}")
            found.append(kinds)
        return found


class Lib3mf:
    """The library of the 3MF consortium, in an environment of Python."""

    def __init__(self, python):
        self.python = python

    @staticmethod
    def install(folder):
        python = folder / "bin/python"
        for words in ([sys.executable, "-m", "venv", folder], [python, "-m", "pip", "install", "--quiet", LIB3MF]):
            status, _, errors = call(list(map(str, words)))
            if status != 0:
                skipped(f"3MF: {LIB3MF} could not be installed: {last_line(errors)}")
                return None
        status, _, errors = call([str(python), "-c", "import lib3mf; lib3mf.get_wrapper()"])
        if status != 0:
            skipped(f"3MF: {last_line(errors)}")
            return None
        return Lib3mf(python)

    def check(self, paths):
        """Return for each file a problem or None, and whether it was read without strict mode."""
        excepted = [[e for e in STRICT_EXCEPTIONS if e[0] in model_text(path)] for path in paths]
        words = [f"{'lax' if known else 'strict'}:{path}" for known, path in zip(excepted, paths)]
        found = []
        for (result, ended), known in zip(results([str(self.python), "-c", READ_3MF, *words], len(paths)), excepted):
            error, warnings, items = result or [ended, [], 0]
            allowed = set().union(*(e[1] for e in known))
            others = [warning for warning in warnings if warning not in allowed]
            problem = error or (others[0] if others else "nothing to build" if items == 0 else None)
            found.append((problem and f"lib3mf: {problem}", bool(known)))
        return found


def model_text(path):
    with zipfile.ZipFile(path) as archive:
        parts = [archive.read(name) for name in archive.namelist() if name.lower().endswith(".model")]
    return b"\n".join(parts).decode(errors="replace")


def broken_glb(path):
    """Write a triangle whose primitive names an accessor that does not exist."""
    text = json.dumps({"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"attributes": {"POSITION": 7}}]}]})
    text = text.encode() + b" " * (-len(text) % 4)
    head = b"glTF" + b"".join(n.to_bytes(4, "little") for n in (2, 20 + len(text), len(text)))
    path.write_bytes(head + b"JSON" + text)


def broken_3mf(path):
    """Write a triangle that names a vertex that does not exist."""
    relation = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    parts = {
        "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
        "_rels/.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        f'<Relationship Id="r" Type="{relation}" Target="/3D/3dmodel.model"/></Relationships>',
        "3D/3dmodel.model": '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        '<resources><object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
        '<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="9"/></triangles></mesh></object>'
        '</resources><build><item objectid="1"/></build></model>',
    }
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, '<?xml version="1.0" encoding="UTF-8"?>' + text)


def chosen_models(folder):
    """Return the models of a folder that are inputs, and how many others there are."""
    all_models = []
    for path in folder.rglob("*"):
        where = path.relative_to(folder)
        if path.suffix.lower() not in SCENES or not path.is_file() or DAMAGED.intersection(where.parts):
            continue
        if path.suffix.lower() == ".obj" and b"mtllib" not in path.read_bytes():
            continue
        all_models.append((path.stat().st_size, where.as_posix(), path))
    all_models.sort()
    chosen = [path for size, _, path in all_models if size <= MOST_BYTES][:MOST_MODELS]
    return chosen, len(all_models) - len(chosen)


class Check:
    """All jobs on all inputs."""

    def __init__(self, command, folder, gltf, lib3mf):
        self.command, self.folder, self.gltf, self.lib3mf = command, folder, gltf, lib3mf

    def run(self, number, source):
        """Run all jobs on an input; return for each its name, what became of it, and a message."""
        folder = self.folder / str(number)
        folder.mkdir()
        try:
            return self.rows(source, folder)
        finally:
            shutil.rmtree(folder)

    def rows(self, source, folder):
        rows, written = [], {".gltf": [], ".3mf": []}
        for job, (name, extension, arguments) in enumerate(JOBS):
            kind = ".3mf" if extension == "3mf" else ".gltf"
            if (self.lib3mf if kind == ".3mf" else self.gltf) is None:
                continue
            # A folder for each, since images are copied beside a .gltf.
            out = folder / str(job) / f"out.{extension}"
            out.parent.mkdir()
            words = [{"IN": str(source), "OUT": str(out)}.get(word, word) for word in arguments.split()]
            status, _, errors = call([self.command, *words, "--quiet", "--threads", "1"])
            # As someone would type it, in any folder.
            shown = shlex.join(["lodsmith", *(f"out.{extension}" if word == str(out) else word for word in words)])
            if status == 0 and out.is_file():
                written[kind].append((name, shown, out))
                continue
            rows.append((name, "failed", f"{shown}: status {status}: {first_line(errors)}"))
        rows += self.check_gltf(source, written[".gltf"])
        rows += self.check_3mf(written[".3mf"])
        return rows

    def check_gltf(self, source, written):
        inputs = [source] if source.suffix.lower() in GLTF else []
        if not written:
            return
        found = self.gltf.errors([*inputs, *(out for _, _, out in written)])
        known = found[0] if inputs else {}
        for (name, shown, _), errors in zip(written, found[len(inputs) :]):
            new = [message for kind, message in errors.items() if kind not in known]
            yield name, "failed" if new else "excepted" if errors else "good", f"{shown}: {new[0]}" if new else None

    def check_3mf(self, written):
        if not written:
            return
        for (name, shown, _), (problem, is_excepted) in zip(written, self.lib3mf.check([out for _, _, out in written])):
            yield name, "failed" if problem else "excepted" if is_excepted else "good", f"{shown}: {problem}"

    def controls(self):
        """Return the validators that find nothing wrong in a file that is broken."""
        glb, three_mf = self.folder / "broken.glb", self.folder / "broken.3mf"
        broken_glb(glb)
        broken_3mf(three_mf)
        if self.gltf is not None and not self.gltf.errors([glb])[0]:
            yield "the glTF validator accepts a dangling accessor"
        if self.lib3mf is not None and self.lib3mf.check([three_mf])[0][0] is None:
            yield "lib3mf accepts a dangling vertex"


def read_by_command(command, models):
    """Return the models without those of FBX if the command is built without its reader."""
    fbx = [path for path in models if path.suffix.lower() == ".fbx"]
    if not fbx:
        return models
    _, _, errors = call([command, "info", str(fbx[0])])
    if "does not support" not in errors:
        return models
    skipped(f"{len(fbx)} inputs: the command is built without the reader of FBX")
    return [path for path in models if path not in fbx]


def print_table(rows):
    columns = ["good", "excepted", "failed"]
    print(f"\n{'outputs':22}" + "".join(f"{column:>10}" for column in columns))
    for name, _, _ in JOBS:
        print(f"{name:22}" + "".join(f"{sum(row[:2] == (name, column) for row in rows):10}" for column in columns))
    print(f"{'all':22}" + "".join(f"{sum(row[1] == column for row in rows):10}" for column in columns))
    print("(excepted: its input has the same errors, or lib3mf reads it without strict mode: see STRICT_EXCEPTIONS)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--command", required=True, type=pathlib.Path)
    parser.add_argument("--models", type=pathlib.Path, default=ROOT / "../shared/models")
    args = parser.parse_args()
    command = str(args.command.resolve())

    models = sorted(path for path in (ROOT / "testdata").iterdir() if path.suffix != ".md")
    print(f"{len(models)} models of testdata")
    if args.models.is_dir():
        chosen, others = chosen_models(args.models.resolve())
        models += chosen
        print(
            f"{len(chosen)} models of {args.models}: the smallest {MOST_MODELS} scenes of at most {MOST_BYTES >> 20} MiB, "
            f"without {' and '.join(sorted(DAMAGED))}; {others} scenes are left out"
        )
    else:
        skipped(f"the models of {args.models}: no such folder")
    models = read_by_command(command, models)

    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        gltf, lib3mf = GltfValidator.install(folder / "npm"), Lib3mf.install(folder / "venv")
        check = Check(command, folder, gltf, lib3mf)
        failures = list(check.controls())
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            rows = [row for rows in pool.map(check.run, range(len(models)), models) for row in rows]
    print_table(rows)
    failures += [message for _, outcome, message in rows if outcome == "failed"]
    if failures:
        print(f"\n{len(failures)} failures")
        for failure in failures:
            print(f"  {failure}")
        sys.exit(1)


if __name__ == "__main__":
    main()
