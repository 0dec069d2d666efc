"""Writes the stub file of the package, whose keywords are those of the tables of options.

Usage: python stubs.py [--check]
"""

import pathlib
import sys

import lodsmith
from lodsmith import _lodsmith as native

PATH = pathlib.Path(__file__).parent / "python" / "lodsmith" / "__init__.pyi"
TYPES = {"count": "int", "ratio": "float | str", "length": "float | str", "degrees": "float", "number": "float"}
TYPES.update(flag="bool", seed="int", weights="Mapping[str, float]")
TYPES.update(text="str", path="_Path")
PROGRESS = "Callable[[float, str], Any] | bool | Any"

HEAD = '''# Made by stubs.py; the keywords are those of the tables of options.
import os
from typing import Any, Callable, Dict, List, Literal, Mapping, Optional, Sequence, Tuple, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from ._faults import CommandError as CommandError
from ._faults import LodsmithWarning as LodsmithWarning
from ._files import info as info
from ._files import save as save
from ._mesh import Mesh as Mesh
from ._mesh import load as load
from ._picture import Picture as Picture
from ._picture import render as render
from ._run import Level as Level
from ._run import Result as Result
from ._run import SourceMap as SourceMap
from ._run import clean as clean
from ._run import compare as compare
from ._run import icosphere as icosphere
from ._run import options as options

_Path = str | os.PathLike[str]
_M = TypeVar("_M")

FORMATS: Tuple[str, ...]
__version__: str

class InvalidMesh(ValueError):
    face: Optional[int]
    index: Optional[int]
'''


def type_of(option):
    return TYPES.get(option["kind"]) or "Literal[%s]" % ", ".join(f'"{word}"' for word in option["words"])


def keyword(option):
    kind, default = type_of(option), option["default"]
    value = "..." if default is None else default if option["kind"] == "seed" else f'"{default}"'
    # A preset sets these two where they are not given.
    if option["name"] in ("border", "topology") or default is None:
        return f"{option['name']}: Optional[{kind}] = ..."
    return f"{option['name']}: {kind} = {value}"


def keywords(without=()):
    run = ["locked: Optional[ArrayLike] = ...", "importance: Optional[ArrayLike] = ...", f"progress: {PROGRESS} = ..."]
    run.append("time_limit: Optional[float] = ...")
    return [k for k in run if k.partition(":")[0] not in without] + [
        keyword(option) for option in lodsmith.options() if option["name"] not in without
    ]


def keyword_of_job(option):
    name, kind = option["name"].replace("-", "_"), type_of(option)
    return f"{name}: Optional[{f'Sequence[{kind}] | str' if option['list'] else kind}] = ..."


def job(name, verb, places, returns):
    """The lines of a function that does a job on files."""
    progress = [] if verb == "convert" else [f"progress: {PROGRESS} = ..."]
    # `from` is a word of Python, so it can only be given as `**{"from": "ply"}`.
    options = [keyword_of_job(option) for option in native.job_options(verb) if option["name"] != "from"]
    lines = ["", f"def {name}("]
    lines += [f"    {line}," for line in ["input: _Path"] + places + progress + options + ["**options: Any"]]
    return lines + [f") -> {returns}: ..."]


def function(name, first, more, returns, method=False):
    indent = "    " * method
    lines = [f"{indent}@overload", f"{indent}def {name}("]
    lines += [f"{indent}    {line}," for line in (["self"] * method + first + ["/", "*"] + more)]
    return lines + [f"{indent}) -> {returns}: ...", ""]


def overloads(name, more, result, foreign, method=False):
    arrays = ["mesh: ArrayLike", "triangles: ArrayLike"]
    attributes = ["attributes: Optional[Mapping[str, ArrayLike]] = ..."]
    lines = function(name, arrays, attributes + more, result, method)
    lines += function(name, ["mesh: Mesh"], more, result, method)
    return lines + function(name, ["mesh: _M"], more, foreign, method)


def text():
    lines = HEAD.splitlines() + [""]
    lines += overloads("simplify", keywords(), "Result", "_M")
    levels = ["levels: Optional[Sequence[float]] = ...", "faces: Optional[Sequence[int]] = ..."]
    levels += ["count: Optional[int] = ...", "factor: float = 0.5", "errors: Optional[Sequence[float | str]] = ..."]
    levels += ["geomorph: bool = False", "pixels: float = 1.0", "fov: float = 60.0", "height: float = 1080.0"]
    of_level = keywords(("faces", "vertices", "ratio", "error", "measure", "bound"))
    lines += overloads("lod", levels + of_level, "List[Level]", "List[_M]")
    lines += ["class Progressive:"]
    lines += overloads("__init__", keywords(("time_limit",)), "None", "None", method=True)
    lines += '''    @classmethod
    def load(cls, path: _Path) -> "Progressive": ...
    def save(self, path: _Path, *, bits: Optional[int] = ...) -> None: ...
    @property
    def top(self) -> int: ...
    def level(
        self,
        level: Optional[int] = ...,
        *,
        faces: Optional[int] = ...,
        vertices: Optional[int] = ...,
        error: Optional[float] = ...,
        fit: bool = True,
    ) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, level: int) -> Any: ...
'''.splitlines()
    output, report = ["output: _Path", "*"], "Dict[str, Any]"
    lines += job("simplify_file", "simplify", output, report)
    lines += job("lod_file", "lod", ["output: Optional[_Path] = ...", "*", "out_dir: Optional[_Path] = ..."], report)
    lines += job("clean_file", "clean", output, report)
    lines += job("convert", "convert", output, "None")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(PATH.read_text() != text() and f"{PATH.name} differs from the engine: run stubs.py")
    PATH.write_text(text())
