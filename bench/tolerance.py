#!/usr/bin/env python3
"""The fewest triangles with which each tool stays within a distance of the input, for the tables of docs/tolerance.md.

    bench/tolerance.py --quick                                   # one model of testdata
    bench/tolerance.py --models FOLDER [--page]                  # the tables; --page writes them into the page
    bench/tolerance.py FILE... [--tools lodsmith,meshlab] [--shares 0.1,1]
    bench/tolerance.py --picture docs/pictures/tolerance.png     # the picture of the README, by `lodsmith render`

Needs Python with numpy, trimesh and libigl; peers that cannot be imported or built are left out and named: pymeshlab,
bpy (Blender), fast-simplification, manifold3d; a C++ compiler with CGAL for tolerance_cgal.cpp, and for meshoptimizer
its sources (--meshoptimizer FOLDER; by default those that Cargo fetched for this repository).

Each case is a model and a limit E, a share of the diagonal of its bounding box. Every tool gets the same welded mesh.
Lodsmith runs once with `--error E`. For the others the setting is bisected: the number of triangles, each level 2 %
below the one before, or the tool's own error, each level 2 % above the one before; since distances do not rise
monotonically, two coarser levels (3 and 5 beyond) are tried too. Only the result is judged by all points, the levels on the
way by each 16th; if it fails, finer levels are judged by all. (The envelope of CGAL is slow: its width is one of
eleven, from E / 4 to 1.4 E.) A result counts if one judge, the same for all tools, finds no point of either surface
farther than E from the other: 20,000 random points uniform in area, all vertices, and the centres of all edges and
faces, by libigl. Single precision (1e-7 of the diagonal) is allowed for.

Processor times: `run` is one run at the found setting, `search` all runs that the bisection of this case needs, without the
judge. Lodsmith is timed as a whole process, with reading, writing and
measuring; the others without, except that CGAL reads and writes too.
Results are added to --results (JSON lines) case by case; cases that are in it are not run again.
"""

import argparse
import collections
import concurrent.futures
import ctypes
import importlib.metadata
import json
import math
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILT = ROOT / "target" / "tolerance"
PAGE = ROOT / "docs" / "tolerance.md"
SAMPLE = ROOT / "testdata" / "finial.ply"
SHARES = [0.05, 0.1, 0.3, 1.0]
POINTS = 20_000
# The search looks at each of so many points first; its result is judged by all.
SPOT = 16
ROUNDING = 1e-7
# Models of the folder: CAD parts, game assets, a statue, characters, terrain and a scan.
MODELS = [
    "cad/plate_holes.stl",
    "gltf/cakeBirthday.glb",
    "cad/featuretype.stl",
    "cad/fandisk.off",
    "found/fertility.off",
    "gltf/CesiumMan.glb",
    "obj/homer.obj",
    "gltf/chest_gold.glb",
    "cad/wingnut.obj",
    "terrain/mountains.off",
    "off/bunny.off",
]


def processor_seconds():
    """Processor time of this process and of those that it ran."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


class NotTaken(Exception):
    """The tool does not accept the mesh."""


# Meshes


def cleaned(vertices, faces):
    """Merges equal positions; drops faces without area, doubled faces and unused vertices. Keeps the order."""
    vertices = vertices.astype(np.float32)
    _, first, index = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    faces = first[index.reshape(-1)][faces]
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    faces = faces[area > 0]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return compact(vertices, faces[np.sort(first)])


def compact(vertices, faces):
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used].astype(np.float64), index.reshape(-1, 3).astype(np.int64)


def load(path):
    import trimesh

    mesh = trimesh.load(path, force="mesh", process=False)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)


def write_ply(path, vertices, faces):
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("i", "<i4", (3,))])
    rows["n"], rows["i"] = 3, faces
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def edges_of(faces):
    return np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def points_of(vertices, faces):
    """Points at which the judge measures, in an order without pattern."""
    random = np.random.default_rng(1)
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    drawn = corners[random.choice(len(faces), POINTS, p=area / area.sum())]
    u, v = np.sqrt(random.random((POINTS, 1))), random.random((POINTS, 1))
    drawn = (1 - u) * drawn[:, 0] + u * (1 - v) * drawn[:, 1] + u * v * drawn[:, 2]
    middles = vertices[edges_of(faces)].mean(axis=1)
    points = np.concatenate([drawn, vertices[np.unique(faces)], middles, corners.mean(axis=1)])
    return points[random.permutation(len(points))]


class Judge:
    """Measures the largest distance between the input and results, both ways."""

    def __init__(self, vertices, faces):
        import igl

        self.igl, self.vertices, self.faces = igl, vertices, faces
        self.tree = igl.AABB()
        self.tree.init(vertices, faces)
        self.points = points_of(vertices, faces)

    def distance(self, vertices, faces, limit=math.inf, part=1):
        """Returns the largest distance found at each `part`th point; stops early beyond the limit."""
        if not len(faces):
            return math.inf
        tree = self.igl.AABB()
        tree.init(vertices, faces)
        points, largest = points_of(vertices, faces), 0.0
        ways = ((self.tree, self.vertices, self.faces), points), ((tree, vertices, faces), self.points)
        for (to, v, f), all_points in ways:
            squared = to.squared_distance(v, f, np.ascontiguousarray(all_points[::part]))[0]
            largest = max(largest, math.sqrt(squared.max()))
            if largest > limit:
                break
        return largest


# Tools: each is made of (vertices, faces, folder, options) and called with a setting; returns vertices, faces, seconds.


class Lodsmith:
    by = "limit"

    def __init__(self, vertices, faces, folder, options):
        self.command, self.folder = options.lodsmith, folder
        write_ply(folder / "in.ply", vertices, faces)

    def run(self, *target):
        out = self.folder / "out.ply"
        command = [self.command, "simplify", "-q", self.folder / "in.ply", *target, "-o", out, "--force"]
        start = processor_seconds()
        subprocess.run(command, check=True, capture_output=True)
        taken = processor_seconds() - start
        return *load(out), taken

    def __call__(self, setting):
        return self.run("--error", f"{setting:.9g}")


class LodsmithFaces(Lodsmith):
    by = "count"

    def __call__(self, setting):
        return self.run("--faces", str(setting))


def library(sources):
    """Builds the simplifier of meshoptimizer."""
    out = BUILT / "meshoptimizer.so"
    if not out.exists():
        BUILT.mkdir(parents=True, exist_ok=True)
        files = [sources / "simplifier.cpp", sources / "allocator.cpp"]
        subprocess.run(["c++", "-O3", "-DNDEBUG", "-shared", "-fPIC", *files, "-o", out], check=True)
    return ctypes.CDLL(str(out))


class Meshoptimizer:
    by = "error"
    ABSOLUTE = 4

    def __init__(self, vertices, faces, _folder, options):
        self.library = library(options.meshoptimizer)
        self.vertices, self.faces = vertices.astype(np.float32), faces.astype(np.uint32)

    @staticmethod
    def pointer(array):
        return array.ctypes.data_as(ctypes.c_void_p)

    def __call__(self, setting):
        call = self.library.meshopt_simplify
        call.restype = ctypes.c_size_t
        out, size = np.empty_like(self.faces), ctypes.c_size_t
        start = processor_seconds()
        count = call(self.pointer(out), self.pointer(self.faces), size(self.faces.size), self.pointer(self.vertices),
                     size(len(self.vertices)), size(12), size(0), ctypes.c_float(setting), self.ABSOLUTE, None)
        taken = processor_seconds() - start
        return *compact(self.vertices, out.reshape(-1)[:count].reshape(-1, 3).astype(np.int64)), taken


class MeshoptimizerUpdate(Meshoptimizer):
    def __call__(self, setting):
        call = self.library.meshopt_simplifyWithUpdate
        call.restype = ctypes.c_size_t
        faces, vertices, size = self.faces.copy(), self.vertices.copy(), ctypes.c_size_t
        start = processor_seconds()
        count = call(self.pointer(faces), size(faces.size), self.pointer(vertices), size(len(vertices)), size(12), None,
                     size(0), None, size(0), None, size(0), ctypes.c_float(setting), self.ABSOLUTE, None)
        taken = processor_seconds() - start
        return *compact(vertices, faces.reshape(-1)[:count].reshape(-1, 3).astype(np.int64)), taken


class Cgal:
    by, mode = "count", "count"

    def __init__(self, vertices, faces, folder, _options):
        self.program, self.folder = cgal(), folder
        head = np.array([len(vertices), len(faces)], dtype="<i8").tobytes()
        (folder / "in").write_bytes(head + vertices.astype("<f8").tobytes() + faces.astype("<i4").tobytes())

    def __call__(self, setting):
        command = [self.program, self.mode, self.folder / "in", self.folder / "out", f"{setting:.12g}"]
        start = processor_seconds()
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise NotTaken("not a manifold" if done.returncode == 3 else f"ended with status {done.returncode}")
        taken = processor_seconds() - start
        data = (self.folder / "out").read_bytes()
        vertices, faces = np.frombuffer(data, "<i8", 2)
        positions = np.frombuffer(data, "<f8", 3 * vertices, 16).reshape(-1, 3)
        indices = np.frombuffer(data, "<i4", 3 * faces, 16 + 24 * vertices).reshape(-1, 3)
        return positions.copy(), indices.astype(np.int64), taken


class CgalNormal(Cgal):
    mode = "count-normal"


class CgalEnvelope(Cgal):
    by, mode = "width", "envelope"


def cgal():
    out = BUILT / "tolerance_cgal"
    source = pathlib.Path(__file__).with_name("tolerance_cgal.cpp")
    if not out.exists() or out.stat().st_mtime < source.stat().st_mtime:
        BUILT.mkdir(parents=True, exist_ok=True)
        flags = ["-std=c++17", "-O3", "-DNDEBUG", "-I/usr/include/eigen3", source, "-o", out, "-lgmp", "-lmpfr"]
        subprocess.run(["c++", *flags], check=True)
    return out


class MeshLab:
    by = "count"

    def __init__(self, vertices, faces, _folder, _options):
        import pymeshlab

        self.lab, self.vertices, self.faces = pymeshlab, vertices, faces.astype(np.int32)

    def __call__(self, setting):
        meshes = self.lab.MeshSet()
        meshes.add_mesh(self.lab.Mesh(self.vertices, self.faces))
        start = processor_seconds()
        meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=setting)
        taken = processor_seconds() - start
        mesh = meshes.current_mesh()
        return *compact(mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)), taken


class Blender:
    by = "count"

    def __init__(self, vertices, faces, _folder, _options):
        import bpy

        self.bpy, self.count = bpy, len(faces)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        mesh = bpy.data.meshes.new("model")
        mesh.from_pydata(vertices.tolist(), [], faces.tolist())
        self.object = bpy.data.objects.new("model", mesh)
        bpy.context.collection.objects.link(self.object)
        self.decimate = self.object.modifiers.new("decimate", "DECIMATE")
        self.decimate.use_collapse_triangulate = True

    def __call__(self, setting):
        start = processor_seconds()
        self.decimate.ratio = setting / self.count
        graph = self.bpy.context.evaluated_depsgraph_get()
        graph.update()
        mesh = self.object.evaluated_get(graph).data
        taken = processor_seconds() - start
        mesh.calc_loop_triangles()
        vertices = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        faces = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.vertices.foreach_get("co", vertices)
        mesh.loop_triangles.foreach_get("vertices", faces)
        return vertices.reshape(-1, 3).astype(np.float64), faces.reshape(-1, 3).astype(np.int64), taken


class Manifold:
    by = "error"

    def __init__(self, vertices, faces, _folder, _options):
        import manifold3d

        mesh = manifold3d.Mesh(vertices.astype(np.float32), faces.astype(np.uint32))
        self.solid = manifold3d.Manifold(mesh)
        if self.solid.status() != manifold3d.Error.NoError:
            raise NotTaken("not closed or not a manifold")

    def __call__(self, setting):
        start = processor_seconds()
        mesh = self.solid.simplify(setting).to_mesh()
        taken = processor_seconds() - start
        vertices = np.asarray(mesh.vert_properties)[:, :3].astype(np.float64)
        return vertices, np.asarray(mesh.tri_verts).astype(np.int64), taken


class FastSimplification:
    by = "count"

    def __init__(self, vertices, faces, _folder, _options):
        import fast_simplification

        self.simplify, self.vertices, self.faces = fast_simplification.simplify, vertices, faces.astype(np.int32)

    def __call__(self, setting):
        start = processor_seconds()
        vertices, faces = self.simplify(self.vertices, self.faces, target_count=setting)
        taken = processor_seconds() - start
        return vertices.astype(np.float64), faces.astype(np.int64), taken


# Name in results: name in tables, class, package whose version is told.
TOOLS = {
    "lodsmith": ("**Lodsmith**, `--error E`", Lodsmith, None),
    "lodsmith-faces": ("Lodsmith, `--faces` bisected", LodsmithFaces, None),
    "blender": ("Blender, Decimate", Blender, "bpy"),
    "cgal": ("CGAL, Lindstrom-Turk", Cgal, None),
    "cgal-normal": ("CGAL, Lindstrom-Turk, `Bounded_normal_change_filter`", CgalNormal, None),
    "cgal-envelope": ("CGAL, Lindstrom-Turk, `Polyhedral_envelope_filter`", CgalEnvelope, None),
    "meshopt": ("meshoptimizer, `target_error`", Meshoptimizer, None),
    "meshopt-update": ("meshoptimizer with update, `target_error`", MeshoptimizerUpdate, None),
    "meshlab": ("MeshLab, quadric edge collapse", MeshLab, "pymeshlab"),
    "manifold": ("Manifold, `Simplify`", Manifold, "manifold3d"),
    "fast": ("fast-simplification", FastSimplification, "fast-simplification"),
}
OURS = "lodsmith"
# The picture: tools with the captions below them, and the limit in percent of the diagonal.
PICTURED = [("lodsmith", "Lodsmith"), ("cgal", "CGAL"), ("blender", "Blender"), ("meshopt-update", "meshoptimizer")]
PICTURED_SHARE = "0.3"
COLOURS = 128


# The search


class Runs:
    """Results of one tool on one model by setting."""

    def __init__(self, tool, judge):
        self.tool, self.judge, self.known = tool, judge, {}

    def run(self, setting):
        if setting not in self.known:
            *mesh, taken = self.tool(setting)
            self.known[setting] = {"mesh": mesh, "faces": len(mesh[1]), "s": taken, "distance": 0.0, "part": math.inf}
        return self.known[setting]

    def within(self, setting, limit, part=1):
        run = self.run(setting)
        if run["distance"] <= limit and run["part"] > part:
            run["distance"] = max(run["distance"], self.judge.distance(*run["mesh"], limit, part))
            if run["distance"] <= limit:
                # All of these points were measured; beyond the limit, only some.
                run["part"] = part
        return run["distance"] <= limit


def levels_of(tool, limit, faces, diagonal):
    """Settings from the finest to the coarsest."""
    if tool.by == "limit":
        return [limit]
    if tool.by == "width":
        return [limit * 2 ** (step / 4) for step in range(-8, 3)]
    if tool.by == "error":
        return [diagonal * 1e-7 * 1.02**step for step in range(815)]
    counts = [faces]
    while counts[-1] > 4:
        counts.append(max(4, min(counts[-1] - 1, round(counts[-1] * 0.98))))
    return counts[1:]


def search(runs, levels, limit):
    """Returns the coarsest setting found to be within the limit, if any, and the settings that were run."""
    low, high, tried = -1, len(levels), []

    def within(level, part):
        if levels[level] not in tried:
            tried.append(levels[level])
        return runs.within(levels[level], limit, part)

    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if within(middle, SPOT) else (low, middle)
    if len(levels) > 20:
        for further in (low + 3, low + 5):
            if further < len(levels) and within(further, SPOT):
                low = further
    # Back in growing steps, then bisect the last one.
    high, step = low + 1, 1
    while low >= 0 and not within(low, 1):
        low, high, step = max(-1, low - step), low, 2 * step
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if within(middle, 1) else (low, middle)
    return (levels[low] if low >= 0 else None), tried


def cases(options):
    """Runs one tool on one model at each limit; prints a line of JSON for each."""
    vertices, faces = cleaned(*load(options.files[0]))
    diagonal = float(np.linalg.norm(vertices.max(axis=0) - vertices.min(axis=0)))
    judge = Judge(vertices, faces)
    with tempfile.TemporaryDirectory() as folder:
        base = {"model": options.files[0].stem, "input": len(faces), "tool": options.one}
        try:
            tool = TOOLS[options.one][1](vertices, faces, pathlib.Path(folder), options)
            runs = Runs(tool, judge)
            for share in options.shares:
                limit = diagonal * share / 100
                allowed = limit + ROUNDING * diagonal
                setting, tried = search(runs, levels_of(tool, limit, len(faces), diagonal), allowed)
                row = base | {"share": share, "runs": len(tried), "search_s": sum(runs.run(s)["s"] for s in tried)}
                if setting is None:
                    # Nothing that was run is within the limit: the input is.
                    row |= {"faces": len(faces), "distance": 0.0, "run_s": 0.0}
                else:
                    found = runs.run(setting)
                    row |= {"faces": found["faces"], "distance": found["distance"] / limit, "run_s": found["s"]}
                    if options.save:
                        write_ply(options.save, *found["mesh"])
                if tool.by in ("error", "width"):
                    own = runs.run(limit)
                    own["distance"], own["part"] = judge.distance(*own["mesh"]), 1
                    row |= {"own_faces": own["faces"], "own_distance": own["distance"] / limit}
                print(json.dumps(row), flush=True)
        except NotTaken as reason:
            for share in options.shares:
                print(json.dumps(base | {"share": share, "failed": str(reason)}), flush=True)


def run_all(options, files, tools):
    results = options.results
    rows = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    done = {(r["model"], r["tool"], r["share"]) for r in rows}

    def one(job):
        tool, path = job
        missing = [s for s in options.shares if (path.stem, tool, s) not in done]
        if not missing or options.only_tables:
            return []
        command = [sys.executable, __file__, path, "--one", tool, "--lodsmith", options.lodsmith, "--shares",
                   ",".join(map(str, missing)), "--meshoptimizer", options.meshoptimizer or ""]
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
            try:
                code = subprocess.run(command, stdout=out, stderr=errors, timeout=options.limit, env=os.environ | {"IGL_NUM_THREADS": "1"}).returncode
                reason = f"status {code}"
            except subprocess.TimeoutExpired:
                reason = f"more than {options.limit} s"
            out.seek(0), errors.seek(0)
            # Libraries print to the same stream.
            found = [json.loads(line) for line in out if line.startswith('{"model"') and line.endswith("}\n")]
            left = set(missing) - {r["share"] for r in found}
            if left and reason == "status 1":
                print(errors.read(), file=sys.stderr)
        base = {"model": path.stem, "tool": tool}
        return found + [base | {"share": s, "failed": reason} for s in missing if s in left]

    jobs = [(tool, path) for path in files for tool in tools]
    results.parent.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool, results.open("a") as log:
        for future in concurrent.futures.as_completed([pool.submit(one, job) for job in jobs]):
            for row in future.result():
                rows.append(row)
                log.write(json.dumps(row) + "\n")
                log.flush()
                told = row.get("failed") or f"{row['faces']:,} faces, {row['run_s']:.3g} s, search {row['search_s']:.3g} s"
                print(f"{row['model']} {row['share']} % {row['tool']}: {told}", file=sys.stderr, flush=True)
    return rows


# Tables


def mean(values):
    values = [v for v in values if v > 0]
    return math.exp(sum(map(math.log, values)) / len(values)) if values else math.nan


def tables(rows, files, tools, shares):
    by = {(r["model"], r["share"], r["tool"]): r for r in rows}
    names = [p.stem for p in files]
    keys = [(m, s) for m in names for s in shares if "faces" in by.get((m, s, OURS), {})]
    ours = {k: by[*k, OURS] for k in keys}
    rivals = [t for t in tools if not t.startswith(OURS)]
    lines = [f"{len(keys)} cases: {len(names)} models at {', '.join(f'{s:g}' for s in shares)} % of the diagonal. Triangles and times over those of "
             "Lodsmith, geometric means (above 1: more triangles, more time); *fewer*: cases in which the tool needs fewer triangles.", "",
             "| tool | cases | triangles | least – most | fewer | one run | search |", "|---|--:|--:|--:|--:|--:|--:|"]
    for tool in tools:
        found = [(by[*k, tool], ours[k]) for k in keys if "faces" in by.get((*k, tool), {})]
        if not found:
            continue
        ratios = [t["faces"] / o["faces"] for t, o in found]
        fewer = sum(r < 1 for r in ratios)
        one = mean([t["run_s"] / o["run_s"] for t, o in found])
        whole = mean([t["search_s"] / o["search_s"] for t, o in found])
        cells = [TOOLS[tool][0], str(len(found)), f"{mean(ratios):.2f}", f"{min(ratios):.2f} – {max(ratios):.2f}", str(fewer), f"{one:.2f}", f"{whole:.1f}"]
        if tool == OURS:
            cells[3:5] = ["", ""]
        lines.append("| " + " | ".join(cells) + " |")
    best = {}
    for k in keys:
        found = [(by[*k, t]["faces"], t) for t in rivals if "faces" in by.get((*k, t), {})]
        if found:
            best[k] = min(found)
    ratio = {k: best[k][0] / ours[k]["faces"] for k in best}
    lost = sorted((k for k in best if ratio[k] < 1), key=lambda k: ratio[k])
    even = sum(ratio[k] == 1 for k in best)
    lines += ["", f"Against the *best* of the other tools in each case: {mean(list(ratio.values())):.2f} × our triangles (geometric mean); we need fewer in "
              f"{len(best) - len(lost) - even} of {len(best)} cases, as many in {even}, more in {len(lost)}."]
    if lost:
        told = [f"{k[0]} at {k[1]:g} % ({ours[k]['faces']:,}; {TOOLS[best[k][1]][0]}: {best[k][0]:,})" for k in lost]
        lines += ["", "**Cases we lose:** " + ", ".join(told) + "."]
    over = [ours[k]["distance"] for k in keys]
    lines += ["", f"The judge found none of our results beyond its limit; the largest distance was {max(over):.4f} × E." if max(over) <= 1.0001
              else f"The judge found {sum(o > 1.0001 for o in over)} of our results beyond the limit, at most {max(over):.3f} × E."]

    lines += ["", "The error of the tool itself set to E, one run, nothing searched: how far the result really is.", "",
              "| tool | runs | within E | largest distance, median – most | triangles |", "|---|--:|--:|--:|--:|"]
    for tool in rivals:
        found = [(by[*k, tool], ours[k]) for k in keys if "own_faces" in by.get((*k, tool), {})]
        if found:
            far = sorted(t["own_distance"] for t, _ in found)
            within = sum(d <= 1.0001 for d in far)
            size = mean([t["own_faces"] / o["faces"] for t, o in found])
            lines.append(f"| {TOOLS[tool][0]} | {len(far)} | {within} | {far[len(far) // 2]:.2f} – {far[-1]:.1f} × E | {size:.2f} |")

    failed = collections.defaultdict(set)
    for k in keys:
        for tool in tools:
            if "failed" in by.get((*k, tool), {}):
                failed[tool, by[*k, tool]["failed"]].add(f"{k[0]}")
    if failed:
        told = [f"{TOOLS[t][0]}: {', '.join(sorted(m))} ({why})" for (t, why), m in failed.items()]
        lines += ["", "Not in the means: " + "; ".join(told) + "."]

    shown = [t for t in tools if any("faces" in by.get((*k, t), {}) for k in keys)]
    lines += ["", "Triangles in each case (bold: the fewest; a dash: no result):", "", "| model | E | ours, time | " +
              " | ".join(TOOLS[t][0] for t in shown if t != OURS) + " |", "|---|--:|--:|" + "--:|" * (len(shown) - 1)]
    for k in keys:
        values = [by.get((*k, t), {}).get("faces") for t in shown]
        least = min(v for v in values if v is not None)
        cells = ["–" if v is None else f"**{v:,}**" if v == least else f"{v:,}" for v in values]
        at = shown.index(OURS)
        first = f"{cells.pop(at)}, {ours[k]['run_s']:.2f} s"
        lines.append(f"| {k[0]} ({ours[k]['input']:,}) | {k[1]:g} % | {first} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def picture(options):
    """Renders the sample and the results of some tools at one limit side by side."""
    with tempfile.TemporaryDirectory() as folder:
        panels = [pathlib.Path(folder) / "original"]
        panels[0].write_bytes(SAMPLE.read_bytes())
        for tool, name in PICTURED:
            panels.append(pathlib.Path(folder) / name)
            command = [sys.executable, __file__, SAMPLE, "--one", tool, "--lodsmith", options.lodsmith, "--shares", PICTURED_SHARE,
                       "--meshoptimizer", options.meshoptimizer or "", "--save", panels[-1]]
            subprocess.run(command, check=True)
        look = ["--wireframe", "--wire-width", "0.7", "--shading", "flat", "--color", "#d9a45b", "--background", "#2b3038"]
        view = ["--azimuth", "0", "--elevation", "14", "--size", "236x400", "--columns", str(len(panels))]
        subprocess.run([options.lodsmith, "render", *panels, *look, *view, "--fine", "-o", options.picture, "--force"], check=True)
    from PIL import Image

    Image.open(options.picture).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(options.picture, optimize=True)


def versions(tools):
    told = []
    for tool in tools:
        package = TOOLS[tool][2]
        if package:
            told.append(f"{package} {importlib.metadata.version(package)}")
    return "Peers: " + ", ".join(told) + "; CGAL and meshoptimizer as built on this machine.\n" if told else ""


def usable(tool, options):
    """Returns whether the tool can be made, with a message if not."""
    try:
        corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
        tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        with tempfile.TemporaryDirectory() as folder:
            TOOLS[tool][1](corner, tetrahedron, pathlib.Path(folder), options)
    except (ImportError, OSError, TypeError, subprocess.CalledProcessError) as error:
        print(f"left out: {tool} ({error})", file=sys.stderr)
        return False
    return True


def sources():
    """Returns the newest sources of meshoptimizer that Cargo has fetched."""
    home = pathlib.Path(os.environ.get("CARGO_HOME", pathlib.Path.home() / ".cargo"))
    found = sorted(home.glob("registry/src/*/meshopt-*/vendor/src/simplifier.cpp"))
    return found[-1].parent if found else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--models", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--page", action="store_true")
    parser.add_argument("--lodsmith", default=str(ROOT / "target/release/lodsmith"))
    parser.add_argument("--meshoptimizer", type=lambda t: pathlib.Path(t) if t else None, default=sources())
    parser.add_argument("--results", type=pathlib.Path, default=BUILT / "results.jsonl")
    parser.add_argument("--tools", type=lambda t: t.split(","), default=list(TOOLS))
    parser.add_argument("--shares", type=lambda t: [float(s) for s in t.split(",")], default=SHARES)
    parser.add_argument("--limit", type=float, default=600, help="seconds for one tool on one model, all limits together")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only-tables", action="store_true", help="run nothing: tables from what --results has")
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--save", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("--one", choices=list(TOOLS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        return cases(options)
    if options.picture:
        return picture(options)
    files = list(options.files)
    if options.models or options.quick:
        files.append(SAMPLE)
    if options.models:
        files += [options.models / name for name in MODELS]
    if options.quick:
        options.shares = [0.3]
        options.results = pathlib.Path(tempfile.mkdtemp()) / "results.jsonl"
    if not files:
        parser.error("name files, or give --models FOLDER or --quick")
    tools = [t for t in options.tools if usable(t, options)]
    rows = run_all(options, files, tools)
    text = versions(tools) + "\n" + tables(rows, files, tools, options.shares)
    if options.page:
        begin, end = "<!-- tolerance:begin -->\n", "<!-- tolerance:end -->"
        page = PAGE.read_text()
        before, rest = page.split(begin)
        PAGE.write_text(before + begin + text + end + rest.split(end)[1])
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
