"""Simplification of triangle meshes: the closest mesh for the count, at the speed of the fastest tool.

The functions take NumPy arrays, or meshes of trimesh, PyVista and Open3D, and return the same kind:

>>> import lodsmith
>>> ball = lodsmith.icosphere(4)
>>> small = lodsmith.simplify(ball.vertices, ball.faces, ratio=0.1)
>>> small.vertices.shape, small.faces.shape
((258, 3), (512, 3))

Options have the names, defaults and values of the command ``lodsmith``; :func:`options` lists them.
"""

from ._faults import CommandError, LodsmithWarning
from ._files import clean_file, convert, info, lod_file, save, simplify_file
from ._lodsmith import FORMATS, InvalidMesh, __version__
from ._mesh import Mesh, load
from ._picture import Picture, render
from ._run import (
    Level,
    Progressive,
    Result,
    SourceMap,
    clean,
    compare,
    icosphere,
    lod,
    options,
    simplify,
)

__all__ = [
    "CommandError",
    "FORMATS",
    "InvalidMesh",
    "Level",
    "LodsmithWarning",
    "Mesh",
    "Picture",
    "Progressive",
    "Result",
    "SourceMap",
    "__version__",
    "clean",
    "clean_file",
    "compare",
    "convert",
    "icosphere",
    "info",
    "load",
    "lod",
    "lod_file",
    "options",
    "render",
    "save",
    "simplify",
    "simplify_file",
]
