"""Many assets with lodsmith.batch and with the command: throughput, a killed worker, identical bytes.

Usage: python bench_batch.py make FOLDER [--count N] [--seed N]     assets made from the models in testdata
       python bench_batch.py plain FOLDER OUT --program LODSMITH    one command per asset, in parallel on all cores
       python bench_batch.py batch FOLDER OUT [--kill]              Ray Data; with --kill a worker is killed in the middle
       python bench_batch.py same OUT OTHER                         compares the files and bytes of two outputs
"""

import argparse
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor

import lodsmith
import numpy as np

TESTDATA = pathlib.Path(__file__).resolve().parents[2] / "testdata"
LEVELS = [0.5, 0.25, 0.1]


def make(folder, count, seed=1, bad=0):
    """Write assets: randomly bent models of testdata, in three formats and folders; the last ``bad`` are truncated."""
    finial = lodsmith.load(TESTDATA / "finial.ply")
    bases = [finial, lodsmith.simplify(finial, faces=6000), lodsmith.simplify(finial, faces=3000)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lodsmith.LodsmithWarning)
        bases.append(lodsmith.load(TESTDATA / "arm.glb"))
    names = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        base = bases[random.integers(len(bases))]
        size = np.ptp(base.vertices, axis=0).max()
        waves = np.sin(base.vertices @ random.normal(0, 4 / size, (3, 3)) + random.uniform(0, 6, 3))
        vertices = (base.vertices + 0.05 * size * waves) @ (np.eye(3) + random.normal(0, 0.2, (3, 3)))
        kind = ("ply", "obj", "glb")[i % 3]
        name = f"{i % 7}/asset{i:05}.{kind}"
        path = pathlib.Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", lodsmith.LodsmithWarning)
            lodsmith.Mesh(vertices.astype(np.float32), base.faces).save(path)
        if i >= count - bad:
            path.write_bytes(path.read_bytes()[:-200] if kind != "obj" else b"f 1 2 3\n")
        names.append(name)
    return names


def plain(folder, out, program, words, cores):
    """Run one command for each asset; return the names of failed assets."""
    names = sorted(str(path.relative_to(folder)) for path in pathlib.Path(folder).rglob("*.*") if path.is_file())

    def one(name):
        path = pathlib.Path(folder, name)
        command = [program, "lod", *words, "--threads=1", "--quiet", "-O", os.path.abspath(os.path.join(out, name)), "--"]
        return subprocess.run(command + [path.name], cwd=path.parent, stderr=subprocess.DEVNULL).returncode

    with ThreadPoolExecutor(cores) as pool:
        return [name for name, code in zip(names, pool.map(one, names)) if code != 0]


def workers():
    """Return the worker processes of Ray that this process started, directly or indirectly."""
    parents, found = {}, []
    for entry in pathlib.Path("/proc").iterdir():
        try:
            if entry.name.isdigit():
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                if (entry / "cmdline").read_bytes().startswith(b"ray::MapWorker"):
                    found.append(int(entry.name))
        except OSError:
            pass  # It has ended.

    def is_own(process):
        while process in parents and process != os.getpid():
            process = parents[process]
        return process == os.getpid()

    return [process for process in found if is_own(process)]


class Killer(threading.Thread):
    """Kills a worker when ``after`` assets are complete; ``at`` is the number of complete assets then."""

    def __init__(self, out, after):
        super().__init__(daemon=True)
        self.done, self.after, self.at, self.ended = pathlib.Path(out, ".lodsmith", "done"), after, None, False

    def run(self):
        while not self.ended:
            complete = sum(1 for _ in self.done.rglob("*.json"))
            if complete >= self.after and workers():
                os.kill(workers()[0], signal.SIGKILL)
                self.at = complete
                return
            time.sleep(0.005)


def files(folder):
    """Return the contents of all files in a folder, without the records and the report of a batch."""
    folder = pathlib.Path(folder)
    paths = [path for path in folder.rglob("*") if path.is_file() and ".lodsmith" not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths if path.name != "report.parquet"}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=["make", "plain", "batch", "same"])
    parser.add_argument("folder")
    parser.add_argument("out", nargs="?")
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bad", type=int, default=0)
    parser.add_argument("--program", default="lodsmith")
    parser.add_argument("--cores", type=int, default=os.cpu_count())
    parser.add_argument("--kill", action="store_true")
    args = parser.parse_args()
    begin = time.perf_counter()
    if args.task == "make":
        make(args.folder, args.count, args.seed, args.bad)
    elif args.task == "plain":
        words = ["--levels", ",".join(map(str, LEVELS))]
        print("failed:", plain(args.folder, args.out, args.program, words, args.cores))
    elif args.task == "same":
        one, other = files(args.folder), files(args.out)
        print(f"{len(one)} and {len(other)} files, {'the same' if one == other else 'not the same'}")
        return int(one != other)
    else:
        import ray
        from lodsmith import batch

        ray.init(num_cpus=args.cores, log_to_driver=False)
        print(f"cluster: {time.perf_counter() - begin:.1f} s")
        killer = Killer(args.out, args.count // 2)
        if args.kill:
            killer.start()
        table = batch.run(args.folder, args.out, levels=LEVELS)
        killer.ended = True
        states = {row["input"]: row for row in table.to_pylist()}
        failed = sorted(name for name, row in states.items() if row["failure"])
        again = sum(row["attempt"] > 1 for row in states.values())
        print(f"{len(states)} assets, {table.num_rows} rows, failed: {failed}; begun again: {again}; killed at {killer.at}")
    print(f"{args.task}: {time.perf_counter() - begin:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
