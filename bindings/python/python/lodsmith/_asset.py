"""The work of :mod:`lodsmith.batch` on one asset: read, make levels in a separate process, publish, record."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
import posixpath
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
import uuid
from dataclasses import dataclass
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple

import pyarrow as pa
from pyarrow import fs

from ._lodsmith import __version__

#: The columns of the report: one row for each asset and level, or one row for an asset that failed.
SCHEMA = pa.schema(
    [
        pa.field("input", pa.string(), nullable=False),
        pa.field("bytes", pa.int64()),
        pa.field("digest", pa.string()),
        pa.field("level", pa.int32()),
        pa.field("output", pa.string()),
        pa.field("faces_before", pa.int64()),
        pa.field("faces_after", pa.int64()),
        pa.field("error", pa.float64()),
        pa.field("distance", pa.float64()),
        pa.field("reached", pa.bool_()),
        pa.field("seconds", pa.float64()),
        pa.field("warnings", pa.list_(pa.string())),
        pa.field("failure", pa.string()),
        pa.field("attempt", pa.int32()),
        pa.field("state", pa.string(), nullable=False),
    ]
)

#: The folder in the output for records of runs.
OWN = ".lodsmith"


@dataclass(frozen=True)
class Place:
    """A folder of a file system."""

    filesystem: fs.FileSystem
    root: str

    def at(self, *parts: str) -> str:
        return "/".join(part.rstrip("/") for part in (self.root, *parts))

    def read(self, *parts: str) -> bytes:
        with self.filesystem.open_input_stream(self.at(*parts)) as stream:
            return stream.read()

    def read_if_there(self, *parts: str) -> Optional[bytes]:
        try:
            return self.read(*parts)
        except FileNotFoundError:
            return None

    def remove(self, *parts: str) -> None:
        try:
            self.filesystem.delete_file(self.at(*parts))
        except FileNotFoundError:
            pass

    def write(self, content: bytes, *parts: str) -> None:
        """Write a file under a temporary name and rename it: readers see the complete file or none."""
        target = self.at(*parts)
        part = self.at(OWN, "parts", uuid.uuid4().hex)
        # Object stores have no folders.
        for folder in (posixpath.dirname(part), posixpath.dirname(target)):
            self.filesystem.create_dir(folder, recursive=True)
        with self.filesystem.open_output_stream(part) as stream:
            stream.write(content)
        self.filesystem.move(part, target)


@dataclass(frozen=True)
class Plan:
    """What a batch does with each asset."""

    source: Place
    target: Place
    #: Options of ``lodsmith lod`` that the outputs depend on, as JSON.
    options: str
    #: Further options, such as limits, as JSON.
    limits: str = "{}"
    retries: int = 2
    timeout: Optional[float] = None

    @property
    def key(self) -> str:
        return hashlib.sha256(json.dumps([__version__, self.options]).encode()).hexdigest()


class Failure(Exception):
    """A failure of an asset that would occur again in another attempt."""


class Ended(Exception):
    """The process of an asset ended, perhaps for an external reason."""


class _Input(NamedTuple):
    path: str
    bytes: int
    digest: str


class _Process:
    """The process that makes levels; started when needed, and again after it has ended."""

    def __init__(self) -> None:
        self.running: Optional["subprocess.Popen[str]"] = None

    def start(self) -> "subprocess.Popen[str]":
        package = str(pathlib.Path(__file__).resolve().parents[1])
        paths = [package, os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in paths if path)}
        words = [sys.executable, "-m", "lodsmith._child"]
        pipe = subprocess.PIPE
        return subprocess.Popen(words, stdin=pipe, stdout=pipe, encoding="utf-8", env=environment)

    def call(self, request: Dict[str, Any], timeout: Optional[float]) -> Dict[str, Any]:
        process = self.running = self.running or self.start()
        assert process.stdin is not None and process.stdout is not None
        late = threading.Event()

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(timeout, end) if timeout is not None else None
        if timer is not None:
            timer.start()
        try:
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            if timer is not None:
                timer.cancel()
        if line and not late.is_set():
            return json.loads(line)
        self.close()
        if late.is_set():
            raise Failure(f"took longer than {timeout:g} s")
        code = process.returncode
        raise Ended(f"the process ended with signal {-code}" if code < 0 else f"the process ended with status {code}")

    def close(self) -> None:
        process, self.running = self.running, None
        if process is not None:
            for stream in (process.stdin, process.stdout):
                try:
                    stream.close()  # type: ignore[union-attr]
                except OSError:
                    pass
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def references(name: str, content: bytes) -> List[str]:
    """Return the files that a glTF, OBJ or MTL file refers to, except files outside its folder."""
    kind = posixpath.splitext(name)[1].lower()
    found: List[str] = []
    if kind == ".gltf":
        try:
            document = json.loads(content)
            found = [item["uri"] for key in ("buffers", "images") for item in document.get(key, []) if "uri" in item]
        except (ValueError, AttributeError, TypeError):
            return []
        found = [urllib.parse.unquote(uri) for uri in found if not uri.startswith("data:")]
    elif kind in (".obj", ".mtl"):
        for line in content.splitlines():
            word, _, rest = line.strip().partition(b" ")
            key, text = word.lower(), rest.strip().decode("utf-8", "replace")
            if kind == ".obj" and key == b"mtllib":
                # One name with spaces, or several names.
                found += [text, *text.split()]
            elif kind == ".mtl" and key.startswith((b"map_", b"bump", b"disp", b"norm", b"refl")) and text:
                found += [text, text.split()[-1]]
    folder = posixpath.dirname(name)
    clean = [posixpath.normpath(posixpath.join(folder, text.replace("\\", "/"))) for text in found]
    inside = [path for path in clean if not path.startswith(("..", "/")) and path.startswith(folder) and path != name]
    return list(dict.fromkeys(inside))


class Worker:
    """Makes the levels of assets, one after another. Each object belongs to one process."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.process = _Process()

    def __call__(self, batch: "pa.Table") -> "pa.Table":
        rows = [row for name in batch["input"].to_pylist() for row in self.asset(name)]
        return pa.Table.from_pylist(rows, schema=SCHEMA)

    def __del__(self) -> None:
        self.process.close()

    def asset(self, name: str) -> List[Dict[str, Any]]:
        """Return the rows of an asset; for an asset that fails, one row with the failure."""
        begin = time.perf_counter()
        about: Dict[str, Any] = {"attempt": 0}
        rows: List[Dict[str, Any]] = []
        with tempfile.TemporaryDirectory(prefix="lodsmith-") as folder:
            for again in range(self.plan.retries + 1):
                try:
                    rows = self._attempt(name, folder, about)
                    failure = ""
                    break
                except (Ended, OSError, pa.ArrowInvalid) as e:
                    failure = str(e)
                    if isinstance(e, FileNotFoundError):
                        break
                except Failure as e:
                    failure = str(e)
                    break
        if failure:
            rows = [{"input": name, **about, "failure": failure, "state": "failed"}]
        seconds = round(time.perf_counter() - begin, 6)
        return [dict(row, seconds=row.get("seconds", seconds)) for row in rows]

    def _attempt(self, name: str, folder: str, about: Dict[str, Any]) -> List[Dict[str, Any]]:
        begin = time.perf_counter()
        about["attempt"] += 1
        given = self._read(name, folder)
        about.update(bytes=given.bytes, digest=given.digest)
        kept = self._kept(name, given)
        if kept is not None:
            return kept
        about["attempt"] = self._begin(name)
        rows = self._make(name, given, folder)
        seconds = round(time.perf_counter() - begin, 6)
        rows = [dict(row, attempt=about["attempt"], seconds=seconds) for row in rows]
        self._publish(name, given, os.path.join(folder, "out"), rows)
        return rows

    def _read(self, name: str, folder: str) -> _Input:
        """Read an asset and the files that it refers to; copy them into the folder unless they are local."""
        source = self.plan.source
        is_local = isinstance(source.filesystem, fs.LocalFileSystem)
        digest, size, waiting, seen = hashlib.sha256(), 0, [name], {name}
        while waiting:
            path = waiting.pop(0)
            content = source.read(path) if path == name else source.read_if_there(path)
            if content is None:
                continue
            for part in (path.encode(), content):
                digest.update(len(part).to_bytes(8, "little"))
                digest.update(part)
            size += len(content) if path == name else 0
            more = [other for other in references(path, content) if other not in seen]
            seen.update(more)
            waiting += more
            if not is_local:
                local = os.path.join(folder, "in", *path.split("/"))
                os.makedirs(os.path.dirname(local), exist_ok=True)
                with open(local, "wb") as file:
                    file.write(content)
        path = source.at(name) if is_local else os.path.join(folder, "in", *name.split("/"))
        return _Input(path, size, digest.hexdigest())

    def _kept(self, name: str, given: _Input) -> Optional[List[Dict[str, Any]]]:
        """Return the rows of an earlier run with the same input and options, if all of its outputs exist."""
        record = self._record(name)
        if record is None or record["key"] != self.plan.key or record["digest"] != given.digest:
            return None
        target = self.plan.target
        found = target.filesystem.get_file_info([target.at(path) for path in record["files"]])
        if [info.size for info in found] != list(record["files"].values()):
            return None
        return [dict(row, state="kept") for row in record["rows"]]

    def _record(self, name: str) -> Optional[Dict[str, Any]]:
        text = self.plan.target.read_if_there(OWN, "done", name + ".json")
        return None if text is None else json.loads(text)

    def _begin(self, name: str) -> int:
        """Count an attempt, so that the number of attempts is limited however a process ends."""
        before = int(self.plan.target.read_if_there(OWN, "begun", name) or 0)
        if before > self.plan.retries:
            raise Failure(f"the worker ended in {before} attempts")
        self.plan.target.write(str(before + 1).encode(), OWN, "begun", name)
        return before + 1

    def _make(self, name: str, given: _Input, folder: str) -> List[Dict[str, Any]]:
        out = os.path.join(folder, "out")
        os.makedirs(out, exist_ok=True)
        for path in _files(out):
            os.remove(os.path.join(out, path))
        options = {**json.loads(self.plan.options), **json.loads(self.plan.limits)}
        # The name without its folder: lods.json repeats it, and must not depend on the machine.
        request = {"input": os.path.basename(given.path), "folder": os.path.dirname(given.path), "out_dir": out}
        done = self.process.call({**request, "options": options}, self.plan.timeout)
        if done["status"] != 0:
            raise Failure("; ".join(done["errors"]))
        report = done["report"]
        return [self._row(name, given, report, level) for level in report["levels"]]

    def _row(self, name: str, given: _Input, report: Any, level: Any) -> Dict[str, Any]:
        measured = level["error"]["measured"]
        return {
            "input": name,
            "bytes": given.bytes,
            "digest": given.digest,
            "level": level["level"],
            "output": f"{name}/{os.path.basename(level['path'])}",
            "faces_before": report["input"]["faces"],
            "faces_after": level["faces"],
            "error": measured["hausdorff"]["symmetric"] if measured else None,
            "distance": level["distance"],
            "reached": level["reached"],
            "warnings": report["warnings"] + level["warnings"],
            "state": "made",
        }

    def _publish(self, name: str, given: _Input, out: str, rows: List[Dict[str, Any]]) -> None:
        target = self.plan.target
        before = self._record(name)
        # From here to the new record, outputs of both runs may be present.
        target.remove(OWN, "done", name + ".json")
        files = {}
        for path in sorted(_files(out)):
            content = pathlib.Path(out, path).read_bytes()
            target.write(content, name, path)
            files[f"{name}/{path}"] = len(content)
        for path in before["files"] if before else ():
            if path not in files:
                target.remove(path)
        record = {"key": self.plan.key, "digest": given.digest, "files": files, "rows": rows}
        target.write(json.dumps(record).encode(), OWN, "done", name + ".json")
        target.remove(OWN, "begun", name)


def _files(folder: str) -> Iterator[str]:
    for parent, _, names in os.walk(folder):
        for name in names:
            yield os.path.relpath(os.path.join(parent, name), folder).replace(os.sep, "/")
