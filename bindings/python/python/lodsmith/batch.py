"""Levels of detail of many files, on the machines of a Ray cluster.

``python -m lodsmith.batch IN OUT --levels 0.5,0.25`` or :func:`run`; both need ``pip install lodsmith[batch]``.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import posixpath
import sys
import tempfile
import warnings
from collections import Counter
from types import MappingProxyType
from typing import Any, Dict, Iterable, List, Mapping, NoReturn, Optional, Sequence, Tuple, Union

try:
    import pyarrow as pa
    import pyarrow.parquet as parquet
    from pyarrow import fs
except ImportError as e:
    raise ImportError("lodsmith.batch needs Ray Data and PyArrow: pip install 'lodsmith[batch]'") from e

from . import _lodsmith as _native
from ._asset import OWN, SCHEMA, Place, Plan, Worker
from ._faults import CommandError
from ._files import job
from ._lodsmith import FORMATS, __version__
from ._run import icosphere

__all__ = ["SCHEMA", "Place", "Plan", "Worker", "listed", "place", "plan", "run"]

#: Extensions of the files to find in a folder.
ENDINGS = tuple("." + name for name in FORMATS)

#: Assets of one task: few, so that little is repeated after a lost worker. Guessed.
TASK = 8

#: Share of the memory of a worker for its process; the rest is for the worker itself. Guessed.
MEMORY_SHARE = 0.9


def place(where: Any, filesystem: Optional[fs.FileSystem] = None) -> Place:
    """Return a folder as a place: a path, a URI (``s3://bucket/folder``), or a path of a given file system."""
    if isinstance(where, Place):
        return where
    text = str(where)
    if filesystem is not None:
        return Place(filesystem, text.rstrip("/") or "/")
    if "://" in text:
        found, root = fs.FileSystem.from_uri(text)
        return Place(found, root.rstrip("/") or "/")
    return Place(fs.LocalFileSystem(), os.path.abspath(text).replace(os.sep, "/"))


def listed(source: Place, without: Optional[Place] = None) -> List[str]:
    """Return the models in a folder and its subfolders, as paths relative to it, in alphabetical order."""
    found = source.filesystem.get_file_info(fs.FileSelector(source.root, recursive=True))
    # (In some file systems, paths start with a slash.)
    start = len(source.root.strip("/"))
    outputs = without.root + "/" if without is not None and without.filesystem.equals(source.filesystem) else None
    names = []
    for info in found:
        plain = info.path[:-3] if info.path.lower().endswith(".gz") else info.path
        is_model = info.type == fs.FileType.File and plain.lower().endswith(ENDINGS)
        if is_model and not (outputs and info.path.startswith(outputs)):
            names.append(info.path.lstrip("/")[start:].lstrip("/"))
    return sorted(names)


class _Parser(argparse.ArgumentParser):
    """A parser for the options of ``lodsmith lod`` and others, in any order, that raises its errors."""

    def add_options(self, own: Sequence[str] = ()) -> None:
        """Add the options of ``lodsmith lod``, except those with these names."""
        group = self.add_argument_group("options of lodsmith lod")
        for row in _native.job_options("lod"):
            how: Dict[str, Any] = {"action": "append"}
            if row["kind"] == "flag":
                how = {"action": "store_const", "const": True}
            if row["name"] not in own:
                group.add_argument("--" + row["name"], help=row["help"].replace("%", "%%"), **how)

    def error(self, message: str) -> NoReturn:
        raise CommandError(message, 2, None)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        given, unknown = self.parse_known_args(args, namespace)
        if unknown:
            name = unknown[0].partition("=")[0].lstrip("-")
            near = _native.nearest(name, [row["name"] for row in _native.job_options("lod")])
            hint = f"; a similar option is --{near}" if near and unknown[0].startswith("-") else ""
            self.error(f"{unknown[0]} is not expected{hint}")
        return given


def _options_in(given: argparse.Namespace) -> Dict[str, Any]:
    """Return the options of ``lodsmith lod`` that were given; one that was repeated is a list."""
    names = [row["name"].replace("-", "_") for row in _native.job_options("lod")]
    found = {name: value for name, value in vars(given).items() if name in names and value is not None}
    return {name: value[0] if isinstance(value, list) and len(value) == 1 else value for name, value in found.items()}


def options_of_words(words: Sequence[str]) -> Dict[str, Any]:
    """Return the options of ``lodsmith lod`` as typed in a shell: ``--name value``, ``--name=value``, ``--flag``."""
    parser = _Parser(add_help=False, allow_abbrev=False)
    parser.add_options()
    return _options_in(parser.parse_args(list(words)))


def _json(options: Mapping[str, Any]) -> str:
    def plain(value: Any) -> Any:
        # A NumPy value, or a path.
        return value.tolist() if hasattr(value, "tolist") else os.fspath(value)

    return json.dumps(dict(options), default=plain)


def plan(
    source: Place,
    target: Place,
    options: Mapping[str, Any],
    *,
    limits: Mapping[str, Any] = MappingProxyType({}),
    retries: int = 2,
    timeout: Optional[float] = None,
) -> Plan:
    """Return the plan of a batch; unknown options of ``lodsmith lod`` are an error before any work."""
    check({**options, **limits})
    return Plan(source, target, _json(options), _json(limits), retries, timeout)


def check(options: Mapping[str, Any]) -> None:
    """Raise an error for options that ``lodsmith lod`` does not take."""
    with tempfile.TemporaryDirectory() as folder:
        icosphere(2).save(f"{folder}/try.ply")
        tried = {**options, "dry_run": True, "strict": False}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                job("lod", [f"{folder}/try.ply"], tried, out_dir=folder)
        except TypeError as e:
            raise CommandError(str(e), 2, None) from e
        except CommandError as e:
            if e.status == 2:
                raise


def run(
    source: Any,
    output: Any,
    *,
    names: Optional[Iterable[str]] = None,
    filesystem: Optional[fs.FileSystem] = None,
    output_filesystem: Optional[fs.FileSystem] = None,
    report: Optional[str] = "report.parquet",
    workers: Union[int, Tuple[int, int], None] = None,
    retries: int = 2,
    timeout: Optional[float] = None,
    words: Sequence[str] = (),
    **options: Any,
) -> "pa.Table":
    """Make levels of detail of all models of a folder through Ray Data, and a table of the results.

    Outputs are the files of ``lodsmith lod IN -O OUTPUT/IN``. Results that an earlier run completed from the same input
    with the same options and version are kept. Uses the cluster of ``ray.init``; without one, starts a local cluster.

    Parameters
    ----------
    source, output : path or URI
        Folders: local paths that all machines can access, or URIs of :mod:`pyarrow.fs` such as ``s3://bucket/folder``.
    names : iterable of str, optional
        Assets as paths relative to ``source``, instead of all models in it.
    filesystem, output_filesystem : pyarrow.fs.FileSystem, optional
        File systems of source and output, if no URI describes them; the second defaults to the first.
    report : str, optional
        Name of the report in ``output``; None writes no report.
    workers : int or (int, int), optional
        Number of workers, or the smallest and the largest number; each takes one core. By default all cores of the cluster.
    retries : int
        Number of further attempts for an asset whose process or worker ended, or whose file could not be read or written.
    timeout : float, optional
        Seconds after which an asset fails and its process is ended.
    words : sequence of str
        Arguments of ``lodsmith lod`` as in a shell.
    **options
        Options of ``lodsmith lod``, as for :func:`lodsmith.lod_file`: ``levels=[0.5, 0.25]``, ``border="lock"`` ...

    Returns
    -------
    pyarrow.Table
        One row for each asset and level (``SCHEMA``); an asset that failed is one row with ``failure``.
    """
    import ray
    import ray.data

    given = place(source, filesystem)
    target = place(output, output_filesystem or (filesystem if not isinstance(output, Place) else None))
    options = {**options_of_words(words), **options}
    # Before Ray starts, which takes seconds.
    check(options)
    assets = list(dict.fromkeys(names)) if names is not None else listed(given, target)
    if not ray.is_initialized():
        ray.init(log_to_driver=False)
    resources = ray.cluster_resources()
    cores = max(int(resources.get("CPU", 1)), 1)
    memory = options.pop("max_memory", None) or f"{max(int(resources.get('memory', 0) * MEMORY_SHARE / cores) >> 20, 64)}M"
    limits = {"max_memory": memory, "threads": 1}
    made = plan(given, target, options, limits=limits, retries=retries, timeout=timeout)

    for folder in ("parts", "begun"):
        target.filesystem.create_dir(target.at(OWN, folder), recursive=True)
        target.filesystem.delete_dir_contents(target.at(OWN, folder))
    table = _treated(ray, made, assets, workers or cores)
    seen = Counter(zip(table["input"].to_pylist(), table["level"].to_pylist()))
    if max(seen.values(), default=1) > 1 or {name for name, _ in seen} != set(assets):
        raise RuntimeError("rows of the report were lost or duplicated")
    table = table.sort_by([("input", "ascending"), ("level", "ascending")])
    table = table.replace_schema_metadata({"lodsmith": __version__, "options": made.options})
    if report is not None:
        sink = pa.BufferOutputStream()
        parquet.write_table(table, sink)
        target.write(sink.getvalue().to_pybytes(), report)
    return table


def _treated(ray: Any, plan: Plan, assets: List[str], workers: Union[int, Tuple[int, int]]) -> "pa.Table":
    """Return the rows of all assets; Ray repeats the task of a lost worker."""
    if not assets:
        return SCHEMA.empty_table()
    most = workers if isinstance(workers, int) else workers[1]
    tasks = max(len(assets) // TASK, min(most, len(assets)))
    data = ray.data.from_arrow([pa.table({"input": assets[i::tasks]}) for i in range(tasks)])
    least = workers if isinstance(workers, int) else workers[0]
    pool = ray.data.ActorPoolStrategy(min_size=least, max_size=most)
    treated = data.map_batches(
        Worker, fn_constructor_args=(plan,), batch_format="pyarrow", batch_size=None, compute=pool, num_cpus=1
    )
    return pa.concat_tables(
        [batch.cast(SCHEMA) for batch in treated.iter_batches(batch_size=None, batch_format="pyarrow")]
    )


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m lodsmith.batch",
        usage="%(prog)s IN OUT [options]",
        description="Make levels of detail of all models of a folder on a Ray cluster.",
        allow_abbrev=False,
    )
    parser.add_argument("source", metavar="IN", help="folder: a path, or a URI such as s3://bucket/folder")
    parser.add_argument("output", metavar="OUT", help="folder for the levels and the report")
    parser.add_argument("--names", metavar="FILE", help="file with assets as paths relative to IN, one per line [default: all models in IN]")
    parser.add_argument("--report", default="report.parquet", metavar="NAME", help="name of the report in OUT")
    parser.add_argument("--workers", type=int, metavar="N", help="number of workers, one core each [default: all cores]")
    parser.add_argument("--retries", type=int, default=2, metavar="N", help="further attempts after a lost process or file [default: 2]")
    parser.add_argument("--timeout", type=float, metavar="S", help="seconds after which an asset fails")
    parser.add_argument("--max-memory", metavar="SIZE", help="memory of the process of each worker [default: its share of the memory of the cluster]")
    parser.add_argument("--address", metavar="ADDRESS", help="address of a Ray cluster [default: start a local one]")
    parser.add_options(own=["max-memory"])
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the command line; returns 1 if an asset failed."""
    parser = _parser()
    try:
        args = parser.parse_args(arguments)
        options = _options_in(args)
        # Before Ray starts, which takes seconds.
        check(options)
        if args.names is None:
            names = listed(place(args.source), place(args.output))
        else:
            with open(args.names, encoding="utf-8") as file:
                names = [line.strip() for line in file if line.strip()]
        return _run_of_shell(args, names, options)
    except (CommandError, OSError) as e:
        print(f"{parser.prog}: {e}", file=sys.stderr)
        return 2 if isinstance(e, CommandError) else 1


def _run_of_shell(args: argparse.Namespace, names: List[str], options: Dict[str, Any]) -> int:
    """Start Ray, run, and print the failures and the counts."""
    import ray
    import ray.data

    ray.init(address=args.address, log_to_driver=False, logging_level="error")
    logging.getLogger("ray.data").setLevel(logging.ERROR)
    ray.data.DataContext.get_current().enable_progress_bars = sys.stderr.isatty()
    keywords = dict(names=names, report=args.report, workers=args.workers, retries=args.retries, timeout=args.timeout)
    try:
        table = run(args.source, args.output, **keywords, **options)
    finally:
        ray.shutdown()
    states = {row["input"]: row for row in table.to_pylist()}
    for name, row in states.items():
        if row["failure"]:
            print(f"{name}: {row['failure']}", file=sys.stderr)
    counts = Counter(row["state"] for row in states.values())
    print(
        f"{len(states)} assets: {counts['made']} made, {counts['kept']} kept, {counts['failed']} failed; "
        f"{posixpath.join(args.output, args.report)}"
    )
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
