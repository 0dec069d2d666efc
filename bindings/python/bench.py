"""Times and errors of this package and of others, and the overhead of Python over the engine.

Usage: python bench.py overhead [--rust PROGRAM]     one million triangles, arrays of several types
       python bench.py rivals [--ratio R] FILE...    time, error (measured by lodsmith.compare), kept attributes
"""

import argparse
import importlib
import subprocess
import sys
import time

import lodsmith
import numpy as np


def timed(work, repeats, clock=time.perf_counter):
    """Return the shortest time of several runs, and the last result."""
    times = []
    for _ in range(repeats):
        begin = clock()
        made = work()
        times.append(clock() - begin)
    return min(times), made


def overhead(args):
    ball = lodsmith.icosphere(8)
    print(f"{len(ball.faces)} triangles to a tenth, shortest of {args.repeats} runs")
    # The kinds take turns, so that other load on the machine affects all of them.
    times = {}
    for _ in range(args.repeats):
        if args.rust:
            # The example prints the seconds of a run of the library without Python, on the same mesh.
            out = subprocess.run([args.rust, "1"], capture_output=True, text=True, check=True).stdout
            times.setdefault("Rust", []).append(float(out))
        for vertices in (np.float64, np.float32):
            for kind in (np.int32, np.int64):
                v, f = ball.vertices.astype(vertices), ball.faces.astype(kind)
                name = f"{np.dtype(vertices).name}, {np.dtype(kind).name}"
                times.setdefault(name, []).append(timed(lambda: lodsmith.simplify(v, f, ratio=0.1), 1)[0])
    for name, all_times in times.items():
        more = f"{100 * (min(all_times) / min(times['Rust']) - 1):+6.1f} %" if args.rust else ""
        print(f"  {name:<22}{min(all_times):7.3f} s {more}")


def of_lodsmith(mesh, count):
    return lodsmith.simplify(mesh, faces=count)


def of_fast_simplification(mesh, count):
    module = importlib.import_module("fast_simplification")
    return module.simplify(mesh.vertices, mesh.faces, target_count=count)


def of_pyvista(mesh, count):
    given = mesh.to_pyvista()
    return given, lambda: given.decimate(1 - count / len(mesh.faces))


def of_pyvista_pro(mesh, count):
    given = mesh.to_pyvista()
    return given, lambda: given.decimate_pro(1 - count / len(mesh.faces))


def of_open3d(mesh, count):
    given = mesh.to_open3d()
    return given, lambda: given.simplify_quadric_decimation(count)


def of_pymeshlab(mesh, count):
    module = importlib.import_module("pymeshlab")
    every = module.MeshSet()
    every.add_mesh(module.Mesh(mesh.vertices, mesh.faces.astype(np.int32)))

    def work():
        every.set_current_mesh(0)
        every.generate_copy_of_current_mesh()
        every.meshing_decimation_quadric_edge_collapse(targetfacenum=count)
        made = every.current_mesh()
        return made.vertex_matrix(), made.face_matrix()

    return None, work


def of_trimesh(mesh, count):
    given = mesh.to_trimesh()
    return given, lambda: given.simplify_quadric_decimation(face_count=count)


RIVALS = {
    "lodsmith": (None, of_lodsmith),
    "lodsmith, cluster": (None, lambda mesh, count: lodsmith.simplify(mesh, faces=count, method="cluster")),
    "fast-simplification": ("fast_simplification", of_fast_simplification),
    "pyvista decimate": ("pyvista", of_pyvista),
    "pyvista decimate_pro": ("pyvista", of_pyvista_pro),
    "open3d quadric": ("open3d", of_open3d),
    "pymeshlab quadric": ("pymeshlab", of_pymeshlab),
    "trimesh": ("trimesh", of_trimesh),
}
ATTRIBUTES = ("uvs", "normals", "colors")


def as_mesh(made):
    return lodsmith.Mesh(*made[:2]) if isinstance(made, tuple) else lodsmith.Mesh.of(made) if not isinstance(made, lodsmith.Mesh) else made


def rivals(args):
    import warnings

    warnings.simplefilter("ignore")
    for path in args.files:
        mesh = lodsmith.load(path)
        count = max(4, int(args.ratio * len(mesh.faces)))
        given = [name for name in ATTRIBUTES if getattr(mesh, name) is not None]
        print(f"{path}: {len(mesh.faces)} to {count} triangles, with {', '.join(given) or 'no attributes'}")
        print(f"  {'':<22}{'CPU s':>9}{'triangles':>11}{'rms %':>10}{'max %':>9}  kept")
        for name, (package, method) in RIVALS.items():
            try:
                if package:
                    importlib.import_module(package)
                prepared = method(mesh, count) if package not in (None, "fast_simplification") else None
                work = prepared[1] if prepared else lambda: method(mesh, count)
                # Seconds of all cores together: other programs on the machine do not count.
                seconds, made = timed(work, args.repeats, time.process_time)
                made = as_mesh(made)
                found = lodsmith.compare(mesh, made)
            except Exception as e:
                print(f"  {name:<22}{type(e).__name__}: {str(e).splitlines()[0][:60]}")
                continue
            share = [100 * found[key]["symmetric"] / found["diagonal"] for key in ("rms", "hausdorff")]
            kept = [a for a in given if getattr(made, a) is not None and np.ptp(getattr(made, a)) >= np.ptp(getattr(mesh, a)) / 2]
            kept = ", ".join(kept) or "-"
            print(f"  {name:<22}{seconds:9.3f}{len(made.faces):11d}{share[0]:10.4f}{share[1]:9.3f}  {kept}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("overhead")
    one.add_argument("--rust", help="the program of crates/lodsmith/examples/time_ball.rs")
    one.add_argument("--repeats", type=int, default=5)
    one.set_defaults(run=overhead)
    two = commands.add_parser("rivals")
    two.add_argument("files", nargs="+")
    two.add_argument("--ratio", type=float, default=0.1)
    two.add_argument("--repeats", type=int, default=3)
    two.set_defaults(run=rivals)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    sys.exit(main())
