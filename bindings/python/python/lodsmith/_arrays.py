"""Meshes as arrays, and their conversion for the engine and back."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Dict, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from . import _lodsmith as _native
from ._faults import warn

#: The engine stores rows of other types as 32-bit floats, which represent these integers exactly.
_EXACT = 1 << 24
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32")
OWN = ("normals", "uvs", "colors", "regions", "vertex_map")
#: Other spellings, those of ``weight``.
_ALSO = {"normal": "normals", "uv": "uvs", "color": "colors"}


class MeshArrays:
    """The arrays of a :class:`lodsmith.Mesh`, which adds its methods."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: Optional[np.ndarray]
    uvs: Optional[np.ndarray]
    colors: Optional[np.ndarray]
    regions: Optional[np.ndarray]
    vertex_map: Optional[np.ndarray]
    attributes: Dict[str, np.ndarray]

    def __init__(self, vertices: Any, faces: Any, attributes: Optional[Mapping[str, Any]] = None) -> None:
        self.vertices = _vertices(vertices)
        self.faces = _faces(faces)
        self.attributes = {}
        for name in OWN:
            setattr(self, name, None)
        self._materials: Any = None
        self.format: Optional[str] = None
        for given, values in (attributes or {}).items():
            if values is None:
                continue
            name = _ALSO.get(given, given)
            if name != given and (attributes or {}).get(name) is not None:
                raise ValueError(f"attributes: {given!r} and {name!r} are the same")
            array = np.asarray(values)
            expected = len(self.faces) if name == "regions" else len(self.vertices)
            if array.ndim not in (1, 2) or len(array) != expected:
                what = "faces" if name == "regions" else "vertices"
                raise ValueError(f"attributes: {name!r} has the shape {array.shape} for {expected} {what}")
            if name in OWN:
                setattr(self, name, array)
            else:
                self.attributes[name] = array

    def __repr__(self) -> str:
        also = [name for name in OWN if getattr(self, name) is not None and name != "vertex_map"]
        also += list(self.attributes)
        with_ = f", {', '.join(also)}" if also else ""
        return f"<lodsmith.{type(self).__name__}: {len(self.faces)} faces, {len(self.vertices)} vertices{with_}>"

    def _named(self) -> Dict[str, np.ndarray]:
        named = {name: getattr(self, name) for name in OWN if getattr(self, name) is not None}
        named.update(self.attributes)
        return named


def _vertices(values: Any) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype not in (np.float32, np.float64):
        if array.dtype.kind not in "fiub":
            raise TypeError(f"vertices: numbers are expected, not {array.dtype}")
        array = array.astype(np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        if array.size:
            raise ValueError(f"vertices: a shape of (n, 3) is expected, not {array.shape}")
        array = array.reshape(0, 3)
    return array


def _faces(values: Any) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        if array.size:
            raise TypeError(f"faces: integers are expected, not {array.dtype}")
        array = array.astype(np.int64)
    if array.ndim != 2 or array.shape[1] != 3:
        if array.size:
            raise ValueError(f"faces: a shape of (m, 3) is expected, not {array.shape}")
        array = array.reshape(0, 3)
    return array


def _contiguous(array: np.ndarray) -> np.ndarray:
    """Return an array in native byte order and contiguous; without a copy if it is so already."""
    if not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="))
    return np.require(array, requirements=["C", "A"])


def _rows(name: str, array: np.ndarray, widths: Tuple[int, ...]) -> np.ndarray:
    if array.ndim != 2 or array.shape[1] not in widths:
        expected = " or ".join(f"(n, {k})" for k in widths)
        raise ValueError(f"attributes: {name!r} has the shape {array.shape}, not {expected}")
    return np.require(array, np.float32, ["C", "A"])


def _colors(array: np.ndarray) -> np.ndarray:
    rows = _rows("colors", array, (3, 4))
    if array.dtype.kind in "iu":
        rows = rows / np.float32(255)
    if rows.shape[1] == 3:
        rows = np.concatenate([rows, np.ones((len(rows), 1), np.float32)], axis=1)
    return np.ascontiguousarray(rows)


def _ids(name: str, array: np.ndarray) -> np.ndarray:
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise ValueError(f"attributes: {name!r} needs one integer each, not {array.dtype} of shape {array.shape}")
    if len(array) and (int(array.min()) < 0 or int(array.max()) >= 1 << 32):
        raise ValueError(f"attributes: {name!r} has numbers below 0 or above 32 bits")
    return np.require(array, np.uint32, ["C", "A"])


#: Numbers between these, and 0, are passed unchanged: 32-bit floats represent their products too.
_LEAST, _MOST = 1e-30, 1e30


class _Scale(NamedTuple):
    """A mapping of 64-bit numbers to 32-bit floats with less rounding: (x - shift) / unit."""

    shift: float
    unit: float

    def carried(self, rows: np.ndarray) -> np.ndarray:
        return (rows - self.shift) / self.unit

    def given(self, rows: np.ndarray) -> np.ndarray:
        return rows.astype(np.float64) * self.unit + self.shift


_PLAIN = _Scale(0.0, 1.0)


def _scale(rows: np.ndarray) -> _Scale:
    """Return the mapping with the least rounding."""
    finite = rows[np.isfinite(rows)]
    if finite.size == 0:
        return _PLAIN
    low, high = float(finite.min()), float(finite.max())
    most = max(abs(low), abs(high))
    # If numbers lie around 0, small ones would lose digits by a shift; if they are all far from 0, all gain digits.
    shift = low / 2 + high / 2 if high / 2 - low / 2 < most / 4 else 0.0
    largest = max(abs(low - shift), abs(high - shift))
    in_range = largest == 0 or _LEAST < largest < _MOST
    return _Scale(shift, 1.0 if in_range else float(2.0 ** np.frexp(largest)[1]))


class _Carried(NamedTuple):
    """Values for the engine."""

    #: None for integers that 32-bit floats do not represent: these are copied from the original afterwards.
    rows: Optional[np.ndarray]
    #: The type of labels.
    label: Optional[str]
    scale: _Scale
    #: Whether the rows are exactly the values.
    is_exact: bool


def _values(name: str, array: np.ndarray, scaled: bool) -> _Carried:
    rows = array.reshape(len(array), -1)
    if rows.dtype.kind in "iub":
        low, high = (int(rows.min()), int(rows.max())) if rows.size else (0, 0)
        if low < -_EXACT or high > _EXACT:
            return _Carried(None, None, _PLAIN, False)
        label = rows.dtype.name if rows.dtype.name in _INTEGERS else ("int32" if low < 0 else "uint32")
        return _Carried(np.require(rows, np.float32, ["C", "A"]), label, _PLAIN, True)
    if rows.dtype.kind != "f":
        raise TypeError(f"attributes: {name!r} has values of type {rows.dtype}, not numbers")
    with np.errstate(over="ignore"):
        carried = np.require(rows, np.float32, ["C", "A"])
    if rows.dtype.itemsize <= 4 or np.array_equal(carried, rows, equal_nan=True):
        return _Carried(carried, None, _PLAIN, True)
    scale = _scale(rows) if scaled else _PLAIN
    if scale != _PLAIN:
        carried = np.require(scale.carried(rows), np.float32, ["C", "A"])
    return _Carried(carried, None, scale, False)


def to_native(mesh: MeshArrays, scaled: bool = False) -> SimpleNamespace:
    """Return the arrays of a mesh as the engine takes them.

    ``scaled`` maps 64-bit numbers to 32-bit floats with less rounding; :func:`from_native` maps them back.
    """
    carried = {name: _values(name, array, scaled) for name, array in mesh.attributes.items()}
    faces = mesh.faces
    if faces.dtype not in (np.int32, np.uint32, np.int64):
        if faces.dtype == np.uint64 and faces.size and int(faces.max()) >= 1 << 63:
            raise ValueError("faces: numbers above 63 bits")
        faces = faces.astype(np.int64)
    return SimpleNamespace(
        vertices=_contiguous(mesh.vertices),
        faces=_contiguous(faces),
        normals=None if mesh.normals is None else _rows("normals", mesh.normals, (3,)),
        uvs=None if mesh.uvs is None else _rows("uvs", mesh.uvs, (2,)),
        colors=None if mesh.colors is None else _colors(mesh.colors),
        regions=None if mesh.regions is None else _ids("regions", mesh.regions),
        vertex_map=None if mesh.vertex_map is None else _ids("vertex_map", mesh.vertex_map),
        attributes={name: (c.rows, c.label) for name, c in carried.items() if c.rows is not None},
        carried=carried,
    )


def warn_of_lost_integers(path: Any, sent: SimpleNamespace) -> None:
    """Warn about attributes that no file format can store."""
    lost = [name for name, carried in sent.carried.items() if carried.rows is None]
    if lost:
        text = f"{path}: the file does not have {', '.join(lost)}: integers above 16,777,216"
        warn(text)


def _like(values: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Return values in the type and shape that the caller gave."""
    if model.ndim == 1:
        values = values.reshape(-1)
    if values.dtype == model.dtype:
        return values
    if model.dtype.kind in "iub" and values.dtype.kind == "f":
        values = np.rint(values)
    return values.astype(model.dtype)


def from_native(kind: type, made: Dict[str, Any], like: Optional[MeshArrays], sent: Optional[SimpleNamespace] = None) -> Any:
    """Return a mesh from arrays of the engine, in the types of the input (``like``, passed to the engine as ``sent``)."""
    mesh = kind.__new__(kind)
    mesh.vertices = made["vertices"]
    faces = made["faces"]
    expected = np.dtype(np.int32) if like is None else like.faces.dtype
    if expected.itemsize < 4:
        expected = np.dtype(np.int32)
    if expected == np.int32 and len(mesh.vertices) <= np.iinfo(np.int32).max:
        faces = faces.view(np.int32)
    elif expected != np.uint32:
        faces = faces.astype(expected if expected.itemsize == 8 else np.int64)
    mesh.faces = faces
    mesh.normals, mesh.uvs, mesh.regions, mesh.vertex_map = (
        made[name] for name in ("normals", "uvs", "regions", "vertex_map")
    )
    colors = made["colors"]
    if colors is not None and like is not None and like.colors is not None:
        given = like.colors
        colors = colors[:, : given.shape[1]]
        if given.dtype.kind in "iu":
            colors = np.rint(colors * 255)
        colors = np.ascontiguousarray(colors, dtype=given.dtype)
    mesh.colors = colors
    if like is not None:
        for name in ("normals", "uvs", "regions"):
            given, got = getattr(like, name), getattr(mesh, name)
            if given is not None and got is not None:
                setattr(mesh, name, _like(got, given))
    mesh.attributes = {}
    for name, (values, label) in made["attributes"].items():
        if like is not None and name in like.attributes:
            if sent is not None and sent.carried[name].scale != _PLAIN:
                values = sent.carried[name].scale.given(values)
            values = _like(values, like.attributes[name])
        else:
            values = values.astype(label) if label else values
            values = values.reshape(-1) if values.shape[1] == 1 else values
        mesh.attributes[name] = values
    mesh._materials = None if like is None else like._materials
    mesh.format = None if like is None else like.format
    return mesh


def keywords_of(options: Dict[str, Any], locked: Any, importance: Any, error_map: Any, progress: Any, time_limit: Any, mesh: MeshArrays) -> Any:
    """Return the keywords of a run as the engine takes them."""
    if locked is not None:
        locked = np.asarray(locked)
        if locked.dtype.kind in "iu" and locked.dtype != np.bool_:
            raise TypeError("locked: an array of bool is expected, one for each vertex")
        locked = _list("locked", locked, np.bool_, mesh)
    if importance is not None:
        importance = _list("importance", np.asarray(importance), np.float32, mesh)
    if error_map is not None:
        error_map = _list("error_map", np.asarray(error_map), np.float32, mesh, np.minimum)
    if time_limit is not None and not (np.isfinite(time_limit) and time_limit > 0):
        raise ValueError(f"time_limit: a number of seconds above 0 is expected, not {time_limit}")
    return SimpleNamespace(
        options=options,
        locked=locked,
        importance=importance,
        error_map=error_map,
        progress=progress,
        time_limit=time_limit,
    )


def _list(name: str, array: np.ndarray, kind: Any, mesh: MeshArrays, combine: Any = np.maximum) -> np.ndarray:
    count = len(mesh.vertices)
    if array.shape != (count,):
        raise ValueError(f"{name}: the shape {array.shape} is not ({count},), one value for each vertex")
    values = np.require(array, kind, ["C", "A"])
    if mesh.vertex_map is None:
        return values
    # The engine takes one value for each vertex, which may have several rows.
    of_place = np.zeros(int(mesh.vertex_map.max()) + 1 if count else 0, kind)
    of_place[mesh.vertex_map] = values
    combine.at(of_place, mesh.vertex_map, values)
    return of_place


#: Names of other packages for a target, and what to use.
_TARGETS = {
    "target_reduction": "ratio=1 - target_reduction, the share of triangles to keep",
    "reduction": "ratio=1 - reduction, the share of triangles to keep",
    "percent": "ratio=1 - percent, the share of triangles to keep",
    "targetperc": "ratio=",
    "face_count": "faces=",
    "target_count": "faces=",
    "targetfacenum": "faces=",
    "target_number_of_triangles": "faces=",
    "n_faces": "faces=",
    "n_points": "vertices=",
}


def check_other_names(options: Mapping[str, Any], function: str) -> None:
    """Raise TypeError for a keyword of another package that has a name of its own here."""
    for name in options:
        if name in _TARGETS:
            raise TypeError(f"{function}() has no keyword {name!r}; use {_TARGETS[name]}")


def check_names(options: Mapping[str, Any], function: str, known: Tuple[str, ...], engine: bool = True) -> None:
    """Raise TypeError for a keyword that does not exist."""
    table = {o["name"]: o for o in _native.options()} if engine else {}
    names = [*known, *table]
    check_other_names(options, function)
    for name, value in options.items():
        words = table[name]["words"] if name in table else []
        if isinstance(value, str) and value not in words and value.replace("_", "-") in words:
            raise ValueError(f"{name}: {value!r} is spelled {value.replace('_', '-')!r}")
        if name not in names:
            near = _native.nearest(name, names)
            hint = f"; a similar one is {near!r}" if near else ""
            raise TypeError(f"{function}() has no keyword {name!r}{hint}")
