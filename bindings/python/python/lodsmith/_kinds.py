"""Meshes of other packages: trimesh, PyVista and Open3D. A package is imported only when one of its meshes is passed."""

from __future__ import annotations

from typing import Any, Callable, Dict, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from ._arrays import MeshArrays
from ._faults import warn


class Kind(NamedTuple):
    """A kind of mesh: a function that takes its arrays, and one that makes a mesh of the kind (like a given one, or None)."""

    take: Callable[[Any], MeshArrays]
    give: Callable[[MeshArrays, Any], Any]


def kind_of(mesh: Any) -> Optional[Kind]:
    """Return the kind of a mesh, found by the package of its class."""
    for cls in type(mesh).__mro__:
        package = cls.__module__.partition(".")[0]
        if package == "trimesh" and cls.__name__ == "Trimesh":
            return KINDS["trimesh"]
        if package == "pyvista" and cls.__name__ == "PolyData":
            return KINDS["pyvista"]
        if package == "open3d" and cls.__name__ == "TriangleMesh":
            return KINDS["open3d_tensor" if ".t." in f".{cls.__module__}." else "open3d"]
    return None


def arguments(mesh: Any, faces: Any, attributes: Optional[Mapping[str, Any]]) -> Tuple[MeshArrays, Any, Any]:
    """Return the mesh in the arguments of a function, its kind, and the object of that kind."""
    if faces is not None:
        return MeshArrays(mesh, faces, attributes), None, None
    if attributes is not None:
        raise TypeError("attributes= is only for arrays of vertices and faces; a mesh has its own attributes")
    if isinstance(mesh, MeshArrays):
        return mesh, None, None
    kind = kind_of(mesh)
    if kind is None:
        if isinstance(mesh, (np.ndarray, list, tuple)):
            raise TypeError("the faces are missing: pass arrays of vertices and faces")
        raise TypeError(
            f"unknown type of mesh: {type(mesh).__name__}; pass arrays of vertices and faces, or a lodsmith.Mesh, "
            "trimesh.Trimesh, pyvista.PolyData or open3d TriangleMesh"
        )
    return kind.take(mesh), kind, mesh


def _lost(what: str) -> None:
    warn(f"the result does not have {what}")


# trimesh


#: Smallest cosine between normals that count as equal: an angle of 0.08 degrees, larger than rounding errors.
_SAME_NORMAL = 1 - 1e-6


def _has_shape_normals(mesh: Any) -> bool:
    """Whether trimesh computed the normals of a mesh from its faces: reading them stores them like other normals."""
    import trimesh

    bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
    given, own = np.asarray(mesh.vertex_normals), np.asarray(bare.vertex_normals)
    if given.shape != own.shape:
        return False
    alike = (given * own).sum(axis=1) >= _SAME_NORMAL
    # A vertex without faces has no normal.
    unused = np.ones(len(given), bool)
    unused[np.asarray(mesh.faces).reshape(-1)] = False
    return bool((alike | unused | ~own.any(axis=1)).all())


def _take_trimesh(mesh: Any) -> MeshArrays:
    taken = MeshArrays(mesh.vertices.view(np.ndarray), mesh.faces.view(np.ndarray))
    # Normals that trimesh computed from the faces are computed again for the result.
    if "vertex_normals" in mesh._cache.cache and not _has_shape_normals(mesh):
        taken.normals = np.asarray(mesh.vertex_normals)
    visual = mesh.visual
    if getattr(visual, "uv", None) is not None and len(visual.uv) == len(mesh.vertices):
        taken.uvs = np.asarray(visual.uv)
        parts = getattr(visual, "face_materials", None)
        if parts is not None and len(parts) == len(mesh.faces):
            taken.regions = np.asarray(parts)
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        taken.colors = np.asarray(visual.vertex_colors)
    elif kind == "face":
        # One region for each colour: borders between colours are preserved.
        _, taken.regions = np.unique(np.asarray(visual.face_colors), axis=0, return_inverse=True)
        taken.regions = taken.regions.reshape(-1)
    for name, values in mesh.vertex_attributes.items():
        if name not in ("normals", "uvs", "colors", "regions", "vertex_map") and np.asarray(values).dtype.kind in "fiub":
            taken.attributes[name] = np.asarray(values)
    if len(mesh.face_attributes):
        _lost("face attributes: " + ", ".join(mesh.face_attributes))
    return taken


def _give_trimesh(mesh: MeshArrays, given: Any) -> Any:
    import trimesh

    made = trimesh.Trimesh(
        mesh.vertices,
        mesh.faces,
        vertex_normals=mesh.normals,
        process=False,
        metadata=dict(given.metadata) if given is not None else None,
    )
    if mesh.uvs is not None:
        material = given.visual.material if given is not None else None
        made.visual = trimesh.visual.TextureVisuals(uv=mesh.uvs, material=material)
        if mesh.regions is not None:
            made.visual.face_materials = mesh.regions
    elif mesh.colors is not None:
        colors = mesh.colors if mesh.colors.dtype == np.uint8 else np.rint(mesh.colors * 255).astype(np.uint8)
        made.visual = trimesh.visual.ColorVisuals(made, vertex_colors=colors)
    elif given is not None and mesh.regions is not None and getattr(given.visual, "kind", None) == "face":
        colors = np.unique(np.asarray(given.visual.face_colors), axis=0)
        made.visual = trimesh.visual.ColorVisuals(made, face_colors=colors[mesh.regions])
    for name, values in mesh.attributes.items():
        made.vertex_attributes[name] = values
    if given is not None and getattr(given, "units", None) is not None:
        made.units = given.units
    return made


# PyVista

_VTK_COLORS = ("RGB", "RGBA", "rgb", "rgba", "colors", "Colors", "COLOR_0")


#: The cell of the original, as ``extract_surface`` and others of VTK number it.
_VTK_CELL_IDS = "vtkOriginalCellIds"


def _are_regions(values: np.ndarray, cells: int) -> bool:
    """Whether values of cells are numbers of regions, and not an identifier for each of the cells."""
    if values.ndim != 1 or values.dtype.kind not in "iu" or not values.size or values.min() < 0:
        return False
    return cells == 1 or len(np.unique(values)) < cells


def _is_color(values: np.ndarray) -> bool:
    return values.dtype == np.uint8 and values.ndim == 2 and values.shape[1] in (3, 4)


def _take_pyvista(mesh: Any) -> MeshArrays:
    if mesh.n_lines or mesh.n_verts:
        _lost("lines and single points")
    cells = mesh.n_cells
    if not mesh.is_all_triangles:
        mesh = mesh.triangulate()
    faces = mesh.faces.reshape(-1, 4)[:, 1:]
    taken = MeshArrays(np.asarray(mesh.points), faces)
    data = mesh.point_data
    normals, uvs = data.active_normals_name, data.active_texture_coordinates_name
    colors = [name for name in data.keys() if _is_color(np.asarray(data[name]))]
    first = next((name for name in _VTK_COLORS if name in colors), colors[0] if colors else None)
    names = {}
    for name in data.keys():
        values = np.asarray(data[name])
        if name == normals:
            taken.normals = values
            names["normals"] = name
        elif name == uvs and values.ndim == 2 and values.shape[1] == 2:
            taken.uvs = values
            names["uvs"] = name
        elif name == first:
            taken.colors = values
            names["colors"] = name
        elif values.dtype.kind in "fiub":
            # Additional colours are interpolated like the first.
            taken.attributes[name] = values.astype(np.float32) if _is_color(values) else values
        else:
            _lost(f"the point data {name!r}")
    taken._names = names
    for name in mesh.cell_data.keys():
        values = np.asarray(mesh.cell_data[name])
        if taken.regions is None and name != _VTK_CELL_IDS and _are_regions(values, cells):
            # Borders between values are preserved, like borders between materials.
            taken.regions = values
            names["regions"] = name
        else:
            _lost(f"the cell data {name!r}")
    return taken


def _give_pyvista(mesh: MeshArrays, given: Any) -> Any:
    import pyvista

    made = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    names = getattr(mesh, "_names", None) or getattr(getattr(mesh, "_original", None), "_names", None) or {}
    data = made.point_data
    if mesh.normals is not None:
        data[names.get("normals", "Normals")] = mesh.normals
        data.active_normals_name = names.get("normals", "Normals")
    if mesh.uvs is not None:
        name = names.get("uvs", "Texture Coordinates")
        data[name] = mesh.uvs
        data.active_texture_coordinates_name = name
    if mesh.colors is not None:
        colors = mesh.colors if mesh.colors.dtype == np.uint8 else np.rint(mesh.colors * 255).astype(np.uint8)
        data[names.get("colors", "RGBA" if colors.shape[1] == 4 else "RGB")] = colors
    for name, values in mesh.attributes.items():
        if given is not None and name in given.point_data and given.point_data[name].dtype != values.dtype:
            values = np.rint(values).astype(given.point_data[name].dtype)
        data[name] = values
    if mesh.regions is not None:
        made.cell_data[names.get("regions", "regions")] = mesh.regions
    if given is not None:
        for name in given.field_data.keys():
            made.field_data[name] = given.field_data[name]
        active = given.point_data.active_scalars_name
        if active is not None and active in data:
            data.active_scalars_name = active
    return made


# Open3D


def _join_corners(taken: MeshArrays, corner_uvs: np.ndarray) -> None:
    """Make a row for each pair of a vertex and its texture coordinates."""
    uvs = np.ascontiguousarray(corner_uvs.reshape(-1, 2))
    corners = taken.faces.reshape(-1).astype(np.int64)
    bits = uvs.view(np.uint64 if uvs.dtype == np.float64 else np.uint32)
    keys = np.column_stack([corners.astype(np.uint64), bits.astype(np.uint64)])
    _, first, row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    rows = corners[first]
    places, place_of = np.unique(rows, return_inverse=True)
    del places
    taken.faces = row.reshape(-1, 3)
    taken.uvs = uvs[first]
    taken.vertices = taken.vertices[rows]
    taken.vertex_map = place_of.reshape(-1).astype(np.uint32)
    for name in ("normals", "colors"):
        if getattr(taken, name) is not None:
            setattr(taken, name, getattr(taken, name)[rows])
    taken.attributes = {name: values[rows] for name, values in taken.attributes.items()}


def _places(mesh: MeshArrays) -> Any:
    """Return the first row of each vertex, and the vertex of each row."""
    if mesh.vertex_map is None:
        return np.arange(len(mesh.vertices)), np.arange(len(mesh.vertices))
    _, first, place = np.unique(mesh.vertex_map, return_index=True, return_inverse=True)
    return first, place.reshape(-1)


def _take_open3d(mesh: Any) -> MeshArrays:
    taken = MeshArrays(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    if mesh.has_vertex_normals():
        taken.normals = np.asarray(mesh.vertex_normals)
    if mesh.has_vertex_colors():
        taken.colors = np.asarray(mesh.vertex_colors)
    if mesh.has_triangle_uvs():
        _join_corners(taken, np.asarray(mesh.triangle_uvs))
    ids = np.asarray(mesh.triangle_material_ids)
    if len(ids) == len(mesh.triangles):
        taken.regions = ids
    return taken


def _give_open3d(mesh: MeshArrays, given: Any) -> Any:
    import open3d as o3d

    # Different normals at a vertex come from a seam of texture coordinates: they are nearly equal.
    first, place = _places(mesh) if mesh.uvs is not None else (slice(None), np.arange(len(mesh.vertices)))
    made = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.asarray(mesh.vertices[first], np.float64)),
        o3d.utility.Vector3iVector(place[mesh.faces].astype(np.int32)),
    )
    if mesh.normals is not None:
        made.vertex_normals = o3d.utility.Vector3dVector(np.asarray(mesh.normals[first], np.float64))
    if mesh.colors is not None:
        colors = mesh.colors[first][:, :3].astype(np.float64)
        made.vertex_colors = o3d.utility.Vector3dVector(colors / (255 if mesh.colors.dtype == np.uint8 else 1))
    if mesh.uvs is not None:
        made.triangle_uvs = o3d.utility.Vector2dVector(np.asarray(mesh.uvs[mesh.faces].reshape(-1, 2), np.float64))
    if mesh.regions is not None:
        made.triangle_material_ids = o3d.utility.IntVector(mesh.regions.astype(np.int32))
    if given is not None and len(given.textures):
        made.textures = given.textures
    return made


def _take_open3d_tensor(mesh: Any) -> MeshArrays:
    data = mesh.vertex
    taken = MeshArrays(data.positions.numpy(), mesh.triangle.indices.numpy())
    for name in data:
        values = data[name].numpy()
        if name in ("normals", "colors"):
            setattr(taken, name, values)
        elif name != "positions":
            taken.attributes[name] = values
    for name in mesh.triangle:
        if name == "texture_uvs":
            _join_corners(taken, mesh.triangle.texture_uvs.numpy())
        elif name == "material_ids":
            taken.regions = mesh.triangle.material_ids.numpy().reshape(-1)
        elif name not in ("indices", "normals"):
            _lost(f"the triangle attribute {name!r}")
    return taken


def _give_open3d_tensor(mesh: MeshArrays, given: Any) -> Any:
    import open3d as o3d

    first, place = _places(mesh) if mesh.uvs is not None else (slice(None), np.arange(len(mesh.vertices)))
    tensor = lambda values: o3d.core.Tensor(np.ascontiguousarray(values))
    made = o3d.t.geometry.TriangleMesh(tensor(mesh.vertices[first]), tensor(place[mesh.faces].astype(mesh.faces.dtype)))
    for name, values in {"normals": mesh.normals, "colors": mesh.colors, **mesh.attributes}.items():
        if values is not None:
            made.vertex[name] = tensor(values[first])
    if mesh.uvs is not None:
        made.triangle.texture_uvs = tensor(mesh.uvs[mesh.faces])
    if mesh.regions is not None:
        made.triangle.material_ids = tensor(mesh.regions)
    if given is not None:
        made.material = given.material
    return made


KINDS: Dict[str, Kind] = {
    "trimesh": Kind(_take_trimesh, _give_trimesh),
    "pyvista": Kind(_take_pyvista, _give_pyvista),
    "open3d": Kind(_take_open3d, _give_open3d),
    "open3d_tensor": Kind(_take_open3d_tensor, _give_open3d_tensor),
}
