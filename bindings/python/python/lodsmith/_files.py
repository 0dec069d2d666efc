"""Files: writing of meshes, and jobs on whole files like those of the command."""

from __future__ import annotations

import os
from typing import Any, Dict, Optional, Sequence, Union

from . import _lodsmith as _native
from ._arrays import MeshArrays, check_other_names, to_native, warn_of_lost_integers
from ._faults import CommandError, warn
from ._kinds import arguments
from ._progress import Reporting

Path = Union[str, "os.PathLike[str]"]


def save(
    mesh: Any,
    path: Path,
    *,
    format: Optional[str] = None,
    ascii: bool = False,
    textures: Optional[str] = None,
    force: bool = False,
    compress: Optional[str] = None,
    quantize: bool = False,
) -> None:
    """Write a mesh to a file; the extension determines the format.

    A file is written completely or not at all. Warnings name the data that the format cannot store.

    Parameters
    ----------
    mesh : Mesh, trimesh.Trimesh, pyvista.PolyData or open3d mesh, or a pair of arrays ``(vertices, faces)``
    ascii : bool
        Write text instead of binary (PLY, STL).
    textures : str
        ``"copy"`` (the default) material and image files beside the output (OBJ, .gltf), ``"link"`` to them, or ``"none"``.
    force : bool
        Also replace a write-protected file.
    compress : str
        ``"meshopt"`` or ``"meshopt-khr"`` compresses glTF and GLB without loss; most programs read the first.
    quantize : bool
        Round the attributes of glTF and GLB to fewer bits, like ``--quantize`` of the command.
    """
    given = MeshArrays(*mesh) if isinstance(mesh, tuple) else arguments(mesh, None, None)[0]
    options = dict(ascii=bool(ascii), textures=textures, force=bool(force), compress=compress, quantize=bool(quantize))
    sent = to_native(given)
    warn_of_lost_integers(path, sent)
    for text in _native.save(sent, os.fspath(path), format, given._materials, options):
        warn(f"{path}: {text}")


def job(
    verb: str,
    inputs: Sequence[Path],
    options: Dict[str, Any],
    output: Optional[Path] = None,
    out_dir: Optional[Path] = None,
    progress: Any = None,
) -> Any:
    """Do a job on files; return the object that the command prints with ``--json``, or the pixels of an image."""
    check_other_names(options, verb)
    places = [None if path is None else os.fspath(path) for path in (output, out_dir)]
    # A dry run needs no output.
    if verb not in ("info", "render") and places.count(None) != 1 and not (places == [None, None] and options.get("dry_run")):
        raise CommandError("give one output: a file, or for levels out_dir=, a folder", 2, None)
    with Reporting(progress) as reporting:
        done = _native.run_job(verb, [os.fspath(path) for path in inputs], *places, options, reporting.callback)
        if done["status"] != 0:
            raise CommandError("; ".join(done["errors"]), done["status"], done["report"])
    for text in done["warnings"]:
        warn(text)
    return done["report"] if done["picture"] is None else done["picture"]


def simplify_file(input: Path, output: Path, *, progress: Any = None, **options: Any) -> Dict[str, Any]:
    """Simplify a whole file; scenes keep their nodes, materials and animations.

    The output has the bytes of ``lodsmith simplify INPUT -o OUTPUT`` with the same options.

    Parameters
    ----------
    input, output : paths
        The format is detected from the content of the input, and given by the extension of the output.
    progress : function, ``tqdm`` bar or True, optional
        As for :func:`lodsmith.simplify`.
    **options
        The options of ``lodsmith simplify`` with underscores: flags are True, ``weight={"uv": 2}``,
        ``lock=["material"]``, ``normals="recompute"``, ``textures="link"``, ``threads=4`` ...

    Returns
    -------
    dict
        The object that ``--json`` prints; warnings are issued as :class:`LodsmithWarning`.

    Raises
    ------
    TypeError
        For an option that does not exist.
    CommandError
        A ValueError with the message, the ``status`` and the report of the command.
    KeyboardInterrupt
        After Ctrl-C; no partial file is left behind.
    """
    return job("simplify", [input], options, output, progress=progress)


def lod_file(
    input: Path,
    output: Optional[Path] = None,
    *,
    out_dir: Optional[Path] = None,
    progress: Any = None,
    **options: Any,
) -> Dict[str, Any]:
    """Make levels of detail of a whole file: one GLB with ``MSFT_lod`` (``output``), or a folder of files (``out_dir``).

    Options are those of ``lodsmith lod``: ``levels=[0.5, 0.25]``, ``faces=[...]``, ``count=`` and ``factor=``, or
    ``errors=["0.1%"]``, ``geomorph=True``, ``naming="unity"`` ... Returns the object that ``--json`` prints.
    """
    return job("lod", [input], options, output, out_dir, progress)


def convert(input: Path, output: Path, **options: Any) -> None:
    """Convert a file to another format, like ``lodsmith convert``."""
    job("convert", [input], options, output)


def clean_file(input: Path, output: Path, *, progress: Any = None, **options: Any) -> Dict[str, Any]:
    """Repair a whole file, like ``lodsmith clean``. Returns the object that ``--json`` prints."""
    return job("clean", [input], options, output, progress=progress)


def info(mesh: Any, triangles: Any = None, /, **options: Any) -> Dict[str, Any]:
    """Return counts and defects of a file or a mesh: elements, borders, non-manifold elements, genus, bounds, area, volume.

    The keys are those of ``lodsmith info --json``; for a mesh, without the keys that need a file.

    Examples
    --------
    >>> import lodsmith
    >>> about = lodsmith.info(lodsmith.icosphere(2))
    >>> about["faces"], about["closed"], about["genus"]
    (320, True, 0)
    """
    if isinstance(mesh, (str, os.PathLike)):
        return job("info", [mesh], options)
    if options:
        raise TypeError(f"info() of a mesh takes no options: {', '.join(options)}")
    return _native.counts(to_native(arguments(mesh, triangles, None)[0]))
