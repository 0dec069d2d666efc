"""The class of meshes, and reading of files."""

from __future__ import annotations

import os
from typing import Any, Dict, Optional

from . import _lodsmith as _native
from ._arrays import OWN, MeshArrays, from_native
from ._faults import warn
from ._files import Path, save
from ._kinds import KINDS, kind_of
from ._picture import render


class Mesh(MeshArrays):
    """A triangle mesh as NumPy arrays.

    Parameters
    ----------
    vertices : array, shape (n, 3)
        Positions, in any unit; ``float32`` and ``float64`` keep their precision, other types become ``float64``.
    faces : array of integers, shape (m, 3)
        Three rows of ``vertices`` for each triangle, counter-clockwise seen from outside.
    attributes : mapping, optional
        Values of the vertices by name, ``(n,)`` or ``(n, k)``. The first three names may be spelled as in ``weight=``:
        ``"normal"``, ``"uv"`` and ``"color"``.

        ``"normals"``
            ``(n, 3)``, of unit length.
        ``"uvs"``
            ``(n, 2)``, texture coordinates; (0, 0) is the lower left corner of the image.
        ``"colors"``
            ``(n, 3)`` or ``(n, 4)``; integers from 0 to 255, or floats from 0 to 1.
        ``"regions"``
            ``(m,)``, the number of a region for each *face*; region borders are preserved.
        ``"vertex_map"``
            ``(n,)``, for each row the number of its vertex, if several rows with different attributes share a vertex.
        any other name
            Floats are interpolated; integers are not (they are labels, such as numbers of materials). NaN is a missing
            value: it stays NaN and does not count in the cost.

    Attributes
    ----------
    vertices, faces : arrays
    normals, uvs, colors, regions, vertex_map : arrays or None
    attributes : dict
        The arrays with other names.
    """

    @classmethod
    def of(cls, mesh: Any) -> "Mesh":
        """Return a mesh of trimesh, PyVista or Open3D as arrays; functions on it then return :class:`Result`."""
        kind = kind_of(mesh)
        if kind is None:
            raise TypeError(f"unknown type of mesh: {type(mesh).__name__}; pass arrays of vertices and faces")
        taken = kind.take(mesh)
        made = Mesh(taken.vertices, taken.faces)
        # (Not by the constructor, which takes names in two spellings.)
        for name in OWN:
            setattr(made, name, getattr(taken, name))
        made.attributes = taken.attributes
        return made

    def to_trimesh(self) -> Any:
        """Return the mesh as a ``trimesh.Trimesh``."""
        return KINDS["trimesh"].give(self, None)

    def to_pyvista(self) -> Any:
        """Return the mesh as a ``pyvista.PolyData``."""
        return KINDS["pyvista"].give(self, None)

    def to_open3d(self) -> Any:
        """Return the mesh as an ``open3d.geometry.TriangleMesh``."""
        return KINDS["open3d"].give(self, None)

    def save(self, path: Any, **keywords: Any) -> None:
        """Write the mesh to a file; see :func:`lodsmith.save`."""
        save(self, path, **keywords)

    def render(self, **keywords: Any) -> Any:
        """Render the mesh; see :func:`lodsmith.render`."""
        return render(self, **keywords)

    def _repr_png_(self) -> Optional[bytes]:
        """Return the image for a notebook."""
        if len(self.faces) == 0:
            return None
        return self.render(size=(480, 360))._repr_png_()

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Dict[str, Any]:
        shown: Dict[str, Any] = {"text/plain": repr(self)}
        try:
            picture = self._repr_png_()
        except ValueError:
            picture = None
        if picture is not None:
            shown["image/png"] = picture
        return shown


def load(
    path: Path, *, format: Optional[str] = None, asset_root: Optional[Path] = None, allow_outside: bool = False
) -> Mesh:
    """Read a file as one mesh: in any of the ``lodsmith.FORMATS``, recognised by its content.

    Parameters
    ----------
    format : str, optional
        Name of the format, such as ``"ply"``.
    asset_root : path, optional
        Folder that must contain all files that the model refers to; by default the folder of the model.
    allow_outside : bool
        Allow the model to refer to any file; only for models that you trust.

    Returns
    -------
    Mesh
        All meshes of a scene joined. Where attributes differ, a vertex has several rows (``vertex_map`` joins them).

    Raises
    ------
    OSError
        If the file cannot be opened.
    InvalidMesh
        If the file cannot be read as a mesh; the message names the position in the file.
    """
    root = None if asset_root is None else os.fspath(asset_root)
    made = _native.load(os.fspath(path), format, root, bool(allow_outside))
    mesh = from_native(Mesh, made, None)
    mesh.format = made["format"]
    mesh._materials = made["materials"]
    for text in made["warnings"]:
        warn(f"{path}: {text}")
    return mesh
