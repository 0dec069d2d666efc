"""Images of meshes, rendered on the CPU: no window, driver or display is needed."""

from __future__ import annotations

import os
from typing import Any, Dict, Optional, Tuple

import numpy as np

from . import _lodsmith as _native
from ._arrays import MeshArrays, to_native
from ._files import job
from ._kinds import arguments


class Picture(np.ndarray):
    """An image: an array of ``uint8``, shape (height, width, 4), red, green, blue and alpha, rows from the top.

    A notebook displays it.
    """

    def to_png(self) -> bytes:
        """Return the bytes of a PNG file."""
        pixels = np.ascontiguousarray(self)
        if pixels.ndim != 3 or pixels.shape[2] != 4 or pixels.dtype != np.uint8:
            raise ValueError(f"an image is uint8 of shape (height, width, 4), not {pixels.dtype} of {pixels.shape}")
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
    view: Optional[str] = None,
    azimuth: Optional[float] = None,
    elevation: Optional[float] = None,
    up: Optional[str] = None,
    shading: Optional[str] = None,
    color: Optional[Tuple[float, float, float]] = None,
    wireframe: bool = False,
    borders: bool = False,
    heat: Any = None,
    range: Optional[Tuple[float, float]] = None,
    colors: Optional[str] = None,
    transparent: bool = False,
    fine: bool = False,
    **options: Any,
) -> Picture:
    """Render a mesh.

    Parameters
    ----------
    mesh : array of shape (n, 3) and an array of triangles, a mesh, or a path
        A file is rendered with its materials and images, like ``lodsmith render`` and with its options. The picture is
        returned; :meth:`Picture.save` writes it.
    size : (int, int)
        Width and height in pixels.
    view : str
        ``"iso"`` (the default), ``"front"``, ``"back"``, ``"left"``, ``"right"``, ``"top"`` or ``"bottom"``.
    azimuth, elevation : float, optional
        Angles of the camera in degrees, from the front to the right and above the horizon, instead of ``view``.
    up : str
        The axis that points up: ``"y"`` (the default) or ``"z"``.
    shading : str, optional
        ``"smooth"``, ``"flat"``, ``"vertex-colors"``, ``"normals"``, ``"matcap"`` or ``"heat"``.
    heat : array, shape (n,), optional
        A value for each vertex, shown as colours.
    range : (float, float), optional
        Values at the ends of the colour scale; by default 0 and the largest.
    colors : str
        Colour scale of ``heat``: ``"turbo"`` (the default), ``"viridis"`` or ``"diverging"``.
    fine : bool
        Use 16 samples for each pixel instead of 4.

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
    words: Dict[str, Any] = dict(
        size=f"{width}x{height}", azimuth=azimuth, elevation=elevation, up=up, shading=shading, colors=colors,
        wireframe=bool(wireframe), borders=bool(borders), fine=bool(fine),
    )
    if azimuth is None and elevation is None:
        words["view"] = view
    if range is not None:
        words["range"] = ",".join(str(float(x)) for x in range)
    if transparent:
        words["background"] = "transparent"
    if color is not None:
        words["color"] = "#" + "".join(f"{round(255 * x):02x}" for x in color)
    if isinstance(mesh, (str, os.PathLike)):
        if triangles is not None:
            raise TypeError("render() of a file takes one path; save the image with .save(path)")
        if heat is not None:
            raise TypeError("heat= is for arrays and meshes; for files, use compare= and shading='heat'")
        return job("render", [mesh], {**words, **options}).view(Picture)
    if options:
        raise TypeError(f"render() of a mesh has no keyword {next(iter(options))!r}")
    given = arguments(mesh, triangles, None)[0]
    values = None
    if heat is not None:
        values = _by_place(np.asarray(heat, np.float32), given)
    return _native.render(to_native(given), words, values).view(Picture)


def _by_place(values: np.ndarray, mesh: MeshArrays) -> Any:
    if values.shape != (len(mesh.vertices),):
        raise ValueError(f"heat: the shape {values.shape} is not ({len(mesh.vertices)},), one value for each vertex")
    if mesh.vertex_map is not None:
        by_place = np.zeros(int(mesh.vertex_map.max()) + 1, np.float32)
        by_place[mesh.vertex_map] = values
        values = by_place
    return values.tolist()
