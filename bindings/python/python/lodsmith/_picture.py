"""Pictures of meshes, drawn on the CPU: no window, no driver, no display."""

from __future__ import annotations

import os
import tempfile
import warnings
from types import SimpleNamespace
from typing import Any, List, Mapping, Optional, Tuple

import numpy as np

from . import _lodsmith as _native
from ._arrays import MeshArrays, to_native
from ._faults import CommandError, LodsmithWarning
from ._kinds import arguments


class Picture(np.ndarray):
    """An image: an array of ``uint8``, shape (height, width, 4), red, green, blue and alpha, rows from the top.

    A notebook shows it.
    """

    def to_png(self) -> bytes:
        """Return the bytes of a PNG file."""
        pixels = np.ascontiguousarray(self)
        if pixels.ndim != 3 or pixels.shape[2] != 4 or pixels.dtype != np.uint8:
            raise ValueError(f"a picture is uint8 of shape (height, width, 4), not {pixels.dtype} of {pixels.shape}")
        return _native.png(pixels.tobytes(), pixels.shape[1], pixels.shape[0])

    def save(self, path: Any) -> None:
        """Write a PNG file."""
        png = self.to_png()
        with open(path, "wb") as file:
            file.write(png)

    def _repr_png_(self) -> Optional[bytes]:
        is_whole = self.ndim == 3 and self.shape[2] == 4 and self.dtype == np.uint8
        return self.to_png() if is_whole else None


def render(
    mesh: Any,
    triangles: Any = None,
    /,
    *,
    size: Tuple[int, int] = (800, 600),
    view: str = "iso",
    azimuth: Optional[float] = None,
    elevation: Optional[float] = None,
    up: str = "y",
    shading: Optional[str] = None,
    color: Optional[Tuple[float, float, float]] = None,
    wireframe: bool = False,
    borders: bool = False,
    heat: Any = None,
    range: Optional[Tuple[float, float]] = None,
    colors: str = "turbo",
    transparent: bool = False,
    fine: bool = False,
    **options: Any,
) -> Picture:
    """Draw a mesh.

    Parameters
    ----------
    mesh : array of shape (n, 3) and one of triangles, a mesh, or a path
        A file is drawn with its materials and images, as ``lodsmith render`` does, with its options.
    size : (int, int)
        Width and height in pixels.
    view : str
        ``"iso"``, ``"front"``, ``"back"``, ``"left"``, ``"right"``, ``"top"`` or ``"bottom"``.
    azimuth, elevation : float, optional
        Angles of the camera in degrees, from the front to the right and above the horizon, instead of ``view``.
    up : str
        The axis that points up: ``"y"`` or ``"z"``.
    shading : str, optional
        ``"smooth"``, ``"flat"``, ``"vertex-colors"``, ``"normals"``, ``"matcap"`` or ``"heat"``.
    heat : array, shape (n,), optional
        A value for each vertex, shown as colours.
    range : (float, float), optional
        Values at the ends of the colours; by default 0 to the largest.
    colors : str
        Colours of ``heat``: ``"turbo"``, ``"viridis"`` or ``"diverging"``.
    fine : bool
        Sixteen samples for each pixel instead of four.

    Returns
    -------
    Picture
        An array of uint8, shape (height, width, 4).

    Examples
    --------
    >>> import lodsmith
    >>> lodsmith.render(lodsmith.icosphere(2), size=(64, 48)).shape
    (48, 64, 4)
    """
    width, height = (int(side) for side in size)
    if isinstance(mesh, (str, os.PathLike)):
        if heat is not None or fine is None:
            raise TypeError("heat= is for arrays and meshes; for files see compare= and shading='heat'")
        words = dict(
            size=(width, height), shading=shading, wireframe=wireframe, borders=borders, up=up, fine=fine, range=range, colors=colors
        )
        if azimuth is None and elevation is None:
            words["view"] = view
        else:
            words.update(azimuth=azimuth, elevation=elevation)
        if transparent:
            words["background"] = "transparent"
        if color is not None:
            words["color"] = "#" + "".join(f"{round(255 * x):02x}" for x in color)
        return _of_file(mesh, {**words, **options})
    if options:
        raise TypeError(f"render() of a mesh has no keyword {next(iter(options))!r}")
    given = arguments(mesh, triangles, None)[0]
    values = None
    if heat is not None:
        values = _by_place(np.asarray(heat, np.float32), given)
    keywords = SimpleNamespace(
        size=(width, height), view=view, azimuth=azimuth, elevation=elevation, up=up, shading=shading, color=color,
        wireframe=bool(wireframe), borders=bool(borders), transparent=bool(transparent), fine=bool(fine), heat=values,
        range=range, colors=colors,
    )
    return _native.render(to_native(given), keywords).view(Picture)


def _by_place(values: np.ndarray, mesh: MeshArrays) -> Any:
    if values.shape != (len(mesh.vertices),):
        raise ValueError(f"heat: the shape {values.shape} is not ({len(mesh.vertices)},), one value for each vertex")
    if mesh.vertex_map is not None:
        by_place = np.zeros(int(mesh.vertex_map.max()) + 1, np.float32)
        by_place[mesh.vertex_map] = values
        values = by_place
    return values.tolist()


def _of_file(path: Any, options: Mapping[str, Any]) -> Picture:
    text = os.fspath(path)
    # `-` is a stream of the command, and what begins with it an option.
    source = os.path.join(os.curdir, text) if text.startswith("-") else text
    with tempfile.TemporaryDirectory() as folder:
        made = os.path.join(folder, "picture.png")
        done = _native.call(["render", *_arguments(options), f"--output={made}", "--", source])
        if done["is_unknown_argument"]:
            raise TypeError(done["errors"][0].partition(" Usage:")[0].replace("error: ", "", 1))
        if done["status"] != 0:
            raise CommandError("; ".join(text.partition(" Usage:")[0] for text in done["errors"]), done["status"], None)
        for text in done["warnings"]:
            warnings.warn(text, LodsmithWarning, stacklevel=3)
        with open(made, "rb") as file:
            return _native.decode(file.read()).view(Picture)


def _arguments(options: Mapping[str, Any]) -> List[str]:
    def word(value: Any) -> str:
        # Shortest texts of numbers are read back as the same numbers.
        return repr(float(value)) if isinstance(value, float) else os.fspath(value) if hasattr(value, "__fspath__") else str(value)

    words: List[str] = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif name == "size":
            words.append(f"{flag}={value[0]}x{value[1]}")
        elif isinstance(value, (list, tuple)):
            words.append(f"{flag}={','.join(map(word, value))}")
        else:
            words.append(f"{flag}={word(value)}")
    return words
