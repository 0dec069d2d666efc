"""Functions on meshes: simplify, levels of detail, progressive meshes, comparison, repair."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence

import numpy as np

from . import _lodsmith as _native
from ._arrays import MeshArrays, check_names, from_native, keywords_of, to_native, warn_of_lost_integers
from ._faults import warn
from ._kinds import arguments
from ._mesh import Mesh, load
from ._progress import Reporting

_RUN = ("attributes", "locked", "importance", "progress", "error_map", "time_limit")


class SourceMap:
    """The source of each vertex of a result on the original.

    Attributes
    ----------
    vertices : array of int64, shape (k,)
        The row of the original that was kept, or -1 for a vertex at a new position.
    faces : array of int64, shape (k,)
        The nearest face of the original; -1 if there is none.
    weights : array of float32, shape (k, 3)
        Barycentric weights of the corners of that face: none negative, sum 1.
    """

    def __init__(self, original: MeshArrays, made: Dict[str, Any]) -> None:
        self.vertices: np.ndarray = made["vertices"]
        self.faces: np.ndarray = made["faces"]
        self.weights: np.ndarray = made["weights"]
        self._corners = original.faces

    def transfer(self, values: Any) -> np.ndarray:
        """Interpolate values at the vertices of the original, ``(n,)`` or ``(n, ...)``, for the vertices of the result.

        Integers are taken from the corner with the largest weight. If that corner is NaN, the result is NaN; other NaN
        are ignored. Rows without a source become NaN, or 0.
        """
        values = np.asarray(values)
        corners = self._corners[np.maximum(self.faces, 0)]
        nearest = np.take_along_axis(corners, self.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        carried = values[nearest]
        nowhere: Any = 0
        if values.dtype.kind not in "iub":
            # Differences from the nearest corner are weighted, so that rounded weights do not scale large numbers; NaN
            # are ignored.
            wide = np.result_type(values.dtype, np.float64)
            blended, shape = carried.astype(wide), (-1,) + (1,) * (values.ndim - 1)
            for k in range(3):
                weight, others = self.weights[:, k].reshape(shape), values[corners[:, k]].astype(wide)
                with np.errstate(invalid="ignore"):
                    change = weight.astype(wide) * (others - carried)
                blended += np.where((weight > 0) & ~np.isnan(others), change, 0)
            carried, nowhere = blended.astype(values.dtype), np.nan
        kept = self.vertices >= 0
        carried[kept] = values[self.vertices[kept]]
        carried[(self.faces < 0) & ~kept] = nowhere
        return carried


class Result(Mesh):
    """A mesh that the engine made, with the report of the run.

    Attributes
    ----------
    report : dict
        Counts, what ended the run, and the error, with the keys of ``lodsmith simplify --json``. Lengths are in the
        units of the mesh.
    """

    report: Dict[str, Any]
    _original: Optional[MeshArrays]

    @property
    def source(self) -> SourceMap:
        """The source of each vertex on the original (:class:`SourceMap`); computed at the first access."""
        if getattr(self, "_source", None) is None:
            if self._original is None:
                raise ValueError("the original of this mesh is not known")
            made = _native.source_map(to_native(self._original), to_native(self))
            self._source = SourceMap(self._original, made)
        return self._source


class Level(Result):
    """A level of detail.

    Attributes
    ----------
    distance : float or None
        Distance from the camera from which on the level is accurate enough, in the units of the mesh; None if
        ``time_limit`` left no time to measure the level.
    geomorph : array, shape (n, 3), or None
        The position of each vertex on the next coarser level, if requested.
    """

    distance: Optional[float]
    geomorph: Optional[np.ndarray]


def _back(result: Mesh, kind: Any, given: Any) -> Any:
    return result if kind is None else kind.give(result, given)


def _warn(made: Iterable[Dict[str, Any]]) -> None:
    """Issue the warnings of results, each once."""
    for text in dict.fromkeys(text for one in made for text in one["warnings"]):
        warn(text)


def _result(made: Dict[str, Any], original: MeshArrays, sent: SimpleNamespace, kind: type = Result) -> Any:
    result = from_native(kind, made, original, sent)
    result.report = made["report"]
    result._original = original
    result._source = None
    _make_exact(result, original, sent)
    return result


def _make_exact(result: Result, original: MeshArrays, sent: SimpleNamespace) -> None:
    """Copy from the original the values that the engine rounded."""
    rounded = [name for name, carried in sent.carried.items() if not carried.is_exact]
    own = [name for name in ("normals", "uvs", "colors") if _is_wide(getattr(original, name))]
    if not rounded and not own:
        return
    kept = result.source.vertices >= 0
    rows = result.source.vertices[kept]
    for name in rounded:
        values = original.attributes[name]
        if name in result.attributes:
            result.attributes[name][kept] = values[rows]
        else:
            result.attributes[name] = result.source.transfer(values)
    result.attributes = {
        name: result.attributes[name] for name in {**original.attributes, **result.attributes} if name in result.attributes
    }
    for name in own:
        # A run may have changed values of kept vertices: for example, normals get length 1.
        got, given = getattr(result, name), getattr(original, name)[rows]
        if got is not None and got.shape[1:] == given.shape[1:]:
            same = (got[kept].astype(np.float32) == given.astype(np.float32)).all(axis=1)
            got[np.flatnonzero(kept)[same]] = given[same]


def _is_wide(values: Optional[np.ndarray]) -> bool:
    return values is not None and values.dtype.kind == "f" and values.dtype.itemsize > 4 and values.ndim == 2


def _check_target(options: Mapping[str, Any]) -> None:
    if isinstance(options.get("faces"), (np.ndarray, list, tuple)):
        raise TypeError("faces= is the number of triangles to keep; the triangles are the second argument")
    if isinstance(options.get("vertices"), (np.ndarray, list, tuple)):
        raise TypeError("vertices= is the number of vertices to keep; the positions are the first argument")


def simplify(
    mesh: Any,
    triangles: Any = None,
    /,
    *,
    attributes: Optional[Mapping[str, Any]] = None,
    locked: Any = None,
    importance: Any = None,
    error_map: Any = None,
    progress: Any = None,
    time_limit: Optional[float] = None,
    **options: Any,
) -> Any:
    """Reduce the number of triangles of a mesh.

    Parameters
    ----------
    mesh : array of shape (n, 3), or a mesh
        Positions in any unit, or a :class:`Mesh`, ``trimesh.Trimesh``, ``pyvista.PolyData`` or ``open3d`` mesh.
    triangles : array of integers, shape (m, 3)
        With positions: three rows of them for each triangle, counter-clockwise seen from outside.
    attributes : mapping, optional
        With positions: values of the vertices by name; see :class:`Mesh`.
    locked : array of bool, shape (n,), optional
        Vertices that keep their position and attributes, bit for bit.
    importance : array, shape (n,), optional
        Density of triangles around each vertex, relative to other places of the same shape; 1 is neutral.
    error_map : array, shape (n,), optional
        Share of the limit ``error`` at each vertex, from 0 (keep the vertex) to 1.
    progress : function, ``tqdm`` bar or True, optional
        Called as ``progress(done, stage)`` a few times a second, ``done`` from 0 to 1; True shows a bar of tqdm.
    time_limit : float, optional
        Seconds after which the best result so far is returned.
    **options
        The options of ``lodsmith simplify``, with underscores: one or more targets (``faces=`` triangles, ``vertices=``,
        ``ratio=``, ``error=``) and any option that :func:`options` lists. Lengths are in the units of the mesh, or a
        text such as ``"0.1%"`` for a share of the diagonal of its bounding box; angles are in degrees.

    Returns
    -------
    Result, or a mesh of the kind that was passed

    Raises
    ------
    TypeError
        For a keyword that does not exist, and without a target.
    ValueError
        For a value that an option does not take.
    InvalidMesh
        For faces with vertices that do not exist, and for a mesh without faces.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second; the interpreter lock is released during the run.

    Examples
    --------
    >>> import lodsmith
    >>> ball = lodsmith.icosphere(4)
    >>> small = lodsmith.simplify(ball.vertices, ball.faces, ratio=0.1)
    >>> small
    <lodsmith.Result: 512 faces, 258 vertices>
    >>> small.report["stopped_by"]
    'ratio'
    """
    _check_target(options)
    check_names(options, "simplify", _RUN)
    given, kind, own = arguments(mesh, triangles, attributes)
    with Reporting(progress) as reporting:
        keywords = keywords_of(options, locked, importance, error_map, reporting.callback, time_limit, given)
        sent = to_native(given, scaled=True)
        made = _native.simplify(sent, keywords)
    result = _result(made, given, sent)
    _warn([made])
    return _back(result, kind, own)


def lod(
    mesh: Any,
    triangles: Any = None,
    /,
    *,
    levels: Optional[Sequence[float]] = None,
    faces: Optional[Sequence[int]] = None,
    count: Optional[int] = None,
    factor: Optional[float] = None,
    errors: Optional[Sequence[Any]] = None,
    geomorph: bool = False,
    pixels: Optional[float] = None,
    fov: Optional[float] = None,
    height: Optional[float] = None,
    attributes: Optional[Mapping[str, Any]] = None,
    locked: Any = None,
    importance: Any = None,
    error_map: Any = None,
    progress: Any = None,
    time_limit: Optional[float] = None,
    **options: Any,
) -> List[Any]:
    """Make levels of detail, the finest first, without the original.

    Parameters
    ----------
    levels : sequence of float
        Fractions of the triangles, in falling order. (Exactly one of ``levels``, ``faces``, ``count`` and ``errors``.)
    faces : sequence of int
        Numbers of triangles, in falling order.
    count, factor : int, float
        Number of levels, and the fraction of the triangles of the previous level that each level keeps (0.5).
    errors : sequence of float or str
        Largest deviations, in rising order, in units of the mesh or as shares of the diagonal (``"0.1%"``).
    geomorph : bool
        Also compute the position of each vertex on the next coarser level.
    pixels, fov, height : float
        Largest permitted deviation on the screen in pixels (1), vertical field of view in degrees (60), and height of
        the screen in pixels (1080), for :attr:`Level.distance`.

    Other parameters are those of :func:`simplify`.

    Returns
    -------
    list of Level, or of meshes of the kind that was passed

    Examples
    --------
    >>> import lodsmith
    >>> [len(level.faces) for level in lodsmith.lod(lodsmith.icosphere(4), levels=[0.5, 0.1])]
    [2560, 512]
    """
    check_names(options, "lod", _RUN + ("levels", "count", "factor", "errors", "geomorph", "pixels", "fov", "height"))
    for name in ("ratio", "error", "vertices"):
        if options.get(name) is not None:
            raise TypeError(f"lod() takes levels=, faces=, count= or errors= instead of {name}=")
    given, kind, own = arguments(mesh, triangles, attributes)
    requested = dict(
        levels=levels, faces=faces, count=count, factor=factor, errors=errors, geomorph=bool(geomorph),
        pixels=pixels, fov=fov, height=height,
    )
    with Reporting(progress) as reporting:
        keywords = keywords_of(options, locked, importance, error_map, reporting.callback, time_limit, given)
        sent = to_native(given, scaled=True)
        made, geomorphs = _native.lod(sent, requested, keywords)
    _warn(made)
    results = []
    for i, one in enumerate(made):
        level = _result(one, given, sent, Level)
        level.distance = one["distance"]
        # The first geomorph is of the original.
        level.geomorph = _by_row(geomorphs[i + 1], level) if i + 1 < len(geomorphs) else None
        results.append(_back(level, kind, own))
    return results


def _by_row(positions: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Return values of vertices as values of rows."""
    return positions if mesh.vertex_map is None else positions[mesh.vertex_map]


class Progressive:
    """A progressive mesh: every level between the coarsest mesh and the input.

    Parameters are those of :func:`simplify`; without a target, the mesh is simplified as far as possible.

    Examples
    --------
    >>> import lodsmith
    >>> mesh = lodsmith.Progressive(lodsmith.icosphere(3))
    >>> len(mesh.level(faces=100).faces)
    100
    """

    def __init__(
        self,
        mesh: Any,
        triangles: Any = None,
        /,
        *,
        attributes: Optional[Mapping[str, Any]] = None,
        locked: Any = None,
        importance: Any = None,
        progress: Any = None,
        **options: Any,
    ) -> None:
        _check_target(options)
        check_names(options, "Progressive", _RUN[:-2])
        given, self._kind, self._own = arguments(mesh, triangles, attributes)
        with Reporting(progress) as reporting:
            keywords = keywords_of(options, locked, importance, None, reporting.callback, None, given)
            # (Not scaled: a file has the original values.)
            self._sent = to_native(given)
            self._mesh = _native.ProgressiveMesh.build(self._sent, keywords)
        self._original: Optional[MeshArrays] = given

    @classmethod
    def load(cls, path: Any) -> "Progressive":
        """Read a progressive mesh from a ``.lpm`` file."""
        made = cls.__new__(cls)
        made._mesh = _native.ProgressiveMesh.read(os.fspath(path))
        made._kind = made._own = made._original = made._sent = None
        return made

    def save(self, path: Any, *, bits: Optional[int] = None) -> None:
        """Write a ``.lpm`` file; ``bits`` rounds coordinates and makes the file smaller."""
        if self._sent is not None:
            warn_of_lost_integers(path, self._sent)
        self._mesh.write(os.fspath(path), bits)

    @property
    def top(self) -> int:
        """Number of the finest level; level 0 is the coarsest."""
        return self._mesh.top

    def level(
        self,
        level: Optional[int] = None,
        *,
        faces: Optional[int] = None,
        vertices: Optional[int] = None,
        error: Optional[float] = None,
        fit: bool = True,
    ) -> Any:
        """Return one level: by number, by a largest number of ``faces`` or ``vertices``, or by an estimated ``error`` in
        units of the mesh; without any of these, the finest. ``fit=False`` leaves out the fit to the original.

        ``report["error"]["estimate"]`` of the result is its estimated distance from the input.
        """
        for name, value in (("faces", faces), ("vertices", vertices), ("error", error)):
            if value is not None and not value >= 0:
                raise ValueError(f"{name}: a number of 0 or more is expected, not {value}")
        if level is None:
            level = self._mesh.level_of(faces, vertices, error)
        elif faces is not None or vertices is not None or error is not None:
            raise TypeError("level() takes the number of a level, or faces=, vertices= and error=")
        level = min(max(int(level), 0), self.top)
        made = self._mesh.mesh(level, bool(fit))
        result = from_native(Result, made, self._original, self._sent)
        result.report = {
            "level": level,
            "output": {"faces": len(result.faces), "vertices": len(result.vertices)},
            "error": {"estimate": made["error"], "unit": "model"},
        }
        result._original, result._source = self._original, None
        if self._original is not None:
            _make_exact(result, self._original, self._sent)
        return _back(result, self._kind, self._own)

    def __len__(self) -> int:
        return self.top + 1

    def __getitem__(self, level: int) -> Any:
        if not -len(self) <= level < len(self):
            raise IndexError(f"level {level} of {len(self)}")
        return self.level(level % len(self))

    def __repr__(self) -> str:
        return f"<lodsmith.Progressive: {len(self)} levels>"


def compare(reference: Any, candidate: Any, *, samples: Optional[int] = None, seed: Optional[int] = None) -> Dict[str, Any]:
    """Measure the distance between two meshes in both directions.

    Parameters
    ----------
    reference, candidate : meshes, or paths of files
        The original and the mesh to compare with it. A pair of arrays ``(vertices, faces)`` is a mesh too.
    samples : int
        Samples in each direction (200 000), spread by area; all vertices are measured in addition.
    seed : int
        Equal seeds give equal numbers.

    Raises
    ------
    KeyboardInterrupt
        After Ctrl-C, as for :func:`simplify`.

    Returns
    -------
    dict
        ``hausdorff``, ``mean``, ``rms`` and ``p99``, each ``forward`` (reference to candidate), ``backward`` and
        ``symmetric``, in the units of the meshes; ``farthest``, the place of the largest distance (None if that is
        0); ``diagonal`` of the reference; and the other keys of ``lodsmith
        compare --json`` that do not need files or attributes. ``normal_mean_deg`` and ``normal_p95_deg`` repeat
        ``normal_deviation_deg``.

    Examples
    --------
    >>> import lodsmith
    >>> ball = lodsmith.icosphere(3)
    >>> lodsmith.compare(ball, ball)["hausdorff"]["symmetric"] < 1e-7
    True
    """
    for name, value, least in (("samples", samples, 1), ("seed", seed, 0)):
        if value is not None and value < least:
            raise ValueError(f"{name}: a whole number of at least {least} is expected, not {value}")
    meshes = [to_native(_any_mesh(mesh)) for mesh in (reference, candidate)]
    return _native.compare(*meshes, *(None if x is None else int(x) for x in (samples, seed)))


def _any_mesh(mesh: Any) -> MeshArrays:
    if isinstance(mesh, (str, os.PathLike)):
        return load(mesh)
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return MeshArrays(*mesh)
    return arguments(mesh, None, None)[0]


def clean(
    mesh: Any,
    triangles: Any = None,
    /,
    *,
    weld: Any = None,
    non_manifold: Optional[str] = None,
    prune: Any = None,
    attributes: Optional[Mapping[str, Any]] = None,
    progress: Any = None,
) -> Any:
    """Repair a mesh: merge vertices, remove invalid faces, orient faces, treat non-manifold edges and vertices.

    Parameters
    ----------
    weld : float or str, optional
        Merge vertices closer than this, in units or as a share of the diagonal (``"0.1%"``); by default only coincident
        vertices are merged.
    non_manifold : str
        ``"keep"`` (the default), ``"cut"`` (cut the surface there) or ``"merge"`` (keep vertices separate, then join borders).
    prune : float or str, optional
        Remove connected parts smaller than this (diagonal of their bounding box).

    Returns
    -------
    Result, or a mesh of the kind that was passed; the report has ``done`` and ``left`` as ``lodsmith clean --json``.
    The counts of ``done`` are in the report itself, too, and ``remaining`` is ``left``.

    Examples
    --------
    >>> import lodsmith
    >>> lodsmith.clean([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 2]]).report["duplicate_faces"]
    1
    """
    given, kind, own = arguments(mesh, triangles, attributes)
    with Reporting(progress) as reporting:
        keywords = keywords_of({"weld": weld, "prune": prune}, None, None, None, reporting.callback, None, given)
        sent = to_native(given)
        made = _native.clean(sent, {"non_manifold": non_manifold}, keywords)
    return _back(_result(made, given, sent), kind, own)


def icosphere(subdivisions: int = 3) -> Mesh:
    """Return a sphere of radius 1: an icosahedron whose faces are split into four this many times (20 x 4^n faces)."""
    t = (1 + 5**0.5) / 2
    v = np.array(
        [[-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t]]
        + [[0, -1, -t], [0, 1, -t], [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1]]
    )
    f = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6]]
        + [[7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10]]
        + [[8, 6, 7], [9, 8, 1]],
        np.int64,
    )
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    for _ in range(subdivisions):
        edges = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        key, index = np.unique(edges[:, 0] * len(v) + edges[:, 1], return_inverse=True)
        middle = v[key // len(v)] + v[key % len(v)]
        a, b, c = (index.reshape(-1, 3) + len(v)).T
        v = np.concatenate([v, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        f = np.stack([f[:, 0], a, c, a, f[:, 1], b, c, b, f[:, 2], a, b, c], axis=1).reshape(-1, 3)
    return Mesh(v, f)


def options() -> List[Dict[str, Any]]:
    """Return the options of simplification: name, kind, words, default (as text; None is off) and a help text.

    Examples
    --------
    >>> import lodsmith
    >>> [o["default"] for o in lodsmith.options() if o["name"] == "border"]
    ['keep']
    """
    return _native.options()
