"""Conversion of Blender meshes to arrays for the engine, and back.

A row of the arrays is a vertex with one set of corner values: texture coordinates, normals, colours. Vertices whose
corners differ have several rows with the same vertex in ``vertex_map``, which the engine treats as seams.
"""

import warnings

import bmesh
import bpy
import lodsmith
import numpy as np

#: Types of attributes that are interpolated: width, and the property with the values.
FLOATS = {
    "FLOAT": (1, "value"),
    "FLOAT2": (2, "vector"),
    "FLOAT_VECTOR": (3, "vector"),
    "FLOAT_COLOR": (4, "color"),
    "BYTE_COLOR": (4, "color"),
}
#: Types of labels, which are not interpolated.
LABELS = {"INT": "value", "INT8": "value", "BOOLEAN": "value"}
#: Attributes that Blender makes itself, or that are converted in another way.
OWN = ("position", "material_index", "sharp_face", "sharp_edge", "custom_normal", "uv_seam")


def simplify(objects, options):
    """Simplify the mesh that objects share, and assign the result; return the numbers of triangles before and after."""
    given = objects[0].data
    source = Arrays(given, objects[0])
    if len(source.triangles) == 0:
        raise ValueError("the mesh has no faces")
    made = lodsmith.simplify(source.mesh(), **options)
    result = source.build(made)
    keys = source.keys
    name = given.name
    for o in objects:
        o.data = result
    source.restore_groups(objects[0], made)
    if keys:
        source.restore_keys(objects[0], made)
    if given.users == 0:
        bpy.data.meshes.remove(given)
    result.name = name
    return len(source.triangles), len(made.faces)


def _column(collection, name, count, width, kind):
    values = np.empty(count * width, kind)
    collection.foreach_get(name, values)
    return values.reshape(count, width)


class Arrays:
    """The arrays of a mesh, with all data that are needed to build a similar mesh."""

    def __init__(self, mesh, of):
        self.given = mesh
        self.count = len(mesh.vertices)
        self.positions = _column(mesh.vertices, "co", self.count, 3, np.float32)
        mesh.calc_loop_triangles()
        n = len(mesh.loop_triangles)
        self.triangles = _column(mesh.loop_triangles, "loops", n, 3, np.int32)
        self.polygons = _column(mesh.loop_triangles, "polygon_index", n, 1, np.int32)[:, 0]
        self.vertex_of_corner = _column(mesh.loops, "vertex_index", len(mesh.loops), 1, np.int32)[:, 0]
        self.has_normals = self._has_hard_normals()
        #: Values by corner, each with its kind and name: ("uv", "UVMap") and so on.
        self.corners = {}
        self.points = {}
        self._take_attributes()
        self.groups, self.weights = self._vertex_groups(of)
        key = mesh.shape_keys
        self.keys = list(key.key_blocks) if key else []

    def _has_hard_normals(self):
        mesh = self.given
        if mesh.has_custom_normals:
            return True
        # Marked edges, and edges of flat faces next to smooth faces, are creases.
        return mesh.normals_domain == "CORNER"

    def _take_attributes(self):
        mesh, lost = self.given, []
        for a in mesh.attributes:
            if a.name in OWN or a.name.startswith(".") or a.is_internal:
                continue
            store = {"CORNER": self.corners, "POINT": self.points}.get(a.domain)
            if store is None or a.data_type not in FLOATS and a.data_type not in LABELS:
                lost.append(a.name)
            elif a.data_type in FLOATS:
                width, prop = FLOATS[a.data_type]
                store[a.name] = (a.data_type, _column(a.data, prop, len(a.data), width, np.float32))
            else:
                store[a.name] = (a.data_type, _column(a.data, "value", len(a.data), 1, np.int32))
        if self.has_normals:
            normals = _column(mesh.corner_normals, "vector", len(mesh.loops), 3, np.float32)
            # Equal normals may differ by rounding.
            self.corners["normals"] = ("NORMAL", np.round(normals, 4) + np.float32(0))
        if lost:
            warnings.warn(f"attributes of edges and faces are not kept: {', '.join(lost)}", stacklevel=3)

    def _vertex_groups(self, of):
        # (For each group, its name and whether its weights are locked.)
        groups = [(g.name, g.lock_weight) for g in of.vertex_groups]
        self.active_group = of.vertex_groups.active_index
        weights = np.zeros((self.count, len(groups)), np.float32)
        if groups:
            for v in self.given.vertices:
                for g in v.groups:
                    if g.group < len(groups):
                        weights[v.index, g.group] = g.weight
        return groups, weights

    def mesh(self):
        """Return the mesh for the engine."""
        # One row for each vertex and set of corner values.
        columns = [self.vertex_of_corner[:, None]]
        columns += [values.view(np.int32) for _, values in self.corners.values()]
        table = np.ascontiguousarray(np.concatenate(columns, axis=1))
        used = np.unique(self.triangles)
        _, first, row = np.unique(table[used], axis=0, return_index=True, return_inverse=True)
        row_of_corner = np.full(len(self.vertex_of_corner), -1, np.int64)
        row_of_corner[used] = row.reshape(-1)
        corner_of_row = used[first]
        vertex_of_row = self.vertex_of_corner[corner_of_row]
        # Vertices without faces have no rows.
        _, place = np.unique(vertex_of_row, return_inverse=True)

        attributes = {"vertex_map": place.reshape(-1)}
        layers = [name for name, (kind, _) in self.corners.items() if kind == "FLOAT2"]
        for i, name in enumerate(layers):
            attributes["uvs" if i == 0 else f"uvs{i}"] = self.corners[name][1][corner_of_row]
        for name, (kind, values) in self.corners.items():
            if kind == "NORMAL":
                attributes["normals"] = values[corner_of_row]
            elif name not in layers:
                attributes[f"corner {name}"] = values[corner_of_row]
        for name, (_, values) in self.points.items():
            attributes[f"point {name}"] = values[vertex_of_row]
        if self.groups:
            attributes["groups"] = self.weights[vertex_of_row]
        for i, key in enumerate(self.keys):
            offsets = _column(key.data, "co", self.count, 3, np.float32) - self.positions
            attributes[f"morph{i}_positions"] = offsets[vertex_of_row]
        attributes["regions"] = self._regions()
        self.layers = layers
        return lodsmith.Mesh(self.positions[vertex_of_row], row_of_corner[self.triangles], attributes)

    def _regions(self):
        """Return a number for each triangle, from its material and whether it is flat."""
        mesh = self.given
        material = _column(mesh.polygons, "material_index", len(mesh.polygons), 1, np.int32)[:, 0]
        smooth = _column(mesh.polygons, "use_smooth", len(mesh.polygons), 1, np.bool_)[:, 0]
        looks, region = np.unique(np.stack([material, smooth], axis=1), axis=0, return_inverse=True)
        self.looks = looks
        return region.reshape(-1)[self.polygons]

    def build(self, made):
        """Return a Blender mesh like the given one, with the triangles of a result."""
        given = self.given
        mesh = bpy.data.meshes.new(given.name)
        place = np.arange(len(made.vertices)) if made.vertex_map is None else np.asarray(made.vertex_map)
        self.row_of_vertex = np.unique(place, return_index=True)[1]
        _, place = np.unique(place, return_inverse=True)
        place = place.reshape(-1)
        positions = np.asarray(made.vertices, np.float32)[self.row_of_vertex]
        faces = np.asarray(made.faces)
        mesh.vertices.add(len(positions))
        mesh.vertices.foreach_set("co", positions.ravel())
        mesh.loops.add(faces.size)
        mesh.loops.foreach_set("vertex_index", place[faces].astype(np.int32).ravel())
        mesh.polygons.add(len(faces))
        mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
        looks = self.looks[np.asarray(made.regions)] if made.regions is not None else np.tile(self.looks[0], (len(faces), 1))
        mesh.polygons.foreach_set("material_index", looks[:, 0].astype(np.int32))
        mesh.polygons.foreach_set("use_smooth", looks[:, 1].astype(np.bool_))
        mesh.update(calc_edges=True)
        for material in given.materials:
            mesh.materials.append(material)
        for name, value in given.items():
            mesh[name] = value
        self._give_attributes(mesh, made, faces)
        mesh.validate()
        return mesh

    def _give_attributes(self, mesh, made, faces):
        rows = faces.ravel()
        for i, name in enumerate(self.layers):
            values = made.uvs if i == 0 else made.attributes[f"uvs{i}"]
            self._give(mesh, name, "FLOAT2", "CORNER", np.asarray(values, np.float32)[rows])
        for name, (kind, _) in self.corners.items():
            if kind != "NORMAL" and name not in self.layers:
                self._give(mesh, name, kind, "CORNER", made.attributes[f"corner {name}"][rows])
        for name, (kind, _) in self.points.items():
            self._give(mesh, name, kind, "POINT", made.attributes[f"point {name}"][self.row_of_vertex])
        self._give_active(mesh)
        edges = _column(mesh.edges, "vertices", len(mesh.edges), 2, np.int32)
        if any(e.use_seam for e in self.given.edges):
            mesh.edges.foreach_set("use_seam", self._differs(mesh, edges, np.asarray(made.uvs)[rows], 1e-4) if self.layers else np.zeros(len(edges), bool))
        if self.has_normals:
            normals = np.asarray(made.normals, np.float32)[rows]
            if self.given.has_custom_normals:
                mesh.normals_split_custom_set(normals)
            else:
                mesh.edges.foreach_set("use_edge_sharp", self._differs(mesh, edges, normals, 0.02))

    @staticmethod
    def _give(mesh, name, kind, domain, values):
        a = mesh.attributes.new(name, kind, domain)
        if kind in FLOATS:
            a.data.foreach_set(FLOATS[kind][1], np.asarray(values, np.float32).ravel())
        else:
            whole = np.asarray(values).ravel()
            a.data.foreach_set("value", whole.astype(np.bool_ if kind == "BOOLEAN" else np.int32))

    def _give_active(self, mesh):
        given = self.given
        for name in ("active_color_name", "default_color_name"):
            value = getattr(given.attributes, name)
            if value:
                setattr(mesh.attributes, name, value)
        for layer in given.uv_layers:
            if layer.name in mesh.uv_layers:
                mesh.uv_layers[layer.name].active_render = layer.active_render
        if given.uv_layers.active and given.uv_layers.active.name in mesh.uv_layers:
            mesh.uv_layers.active = mesh.uv_layers[given.uv_layers.active.name]

    @staticmethod
    def _differs(mesh, edges, values, by):
        """Return for each edge whether values at an end differ between its faces by more than rounding or blending."""
        ends = _column(mesh.loops, "vertex_index", len(mesh.loops), 1, np.int32)[:, 0].reshape(-1, 3)
        edge_of_corner = _column(mesh.loops, "edge_index", len(mesh.loops), 1, np.int32)[:, 0].reshape(-1, 3)
        corner = np.arange(ends.size).reshape(-1, 3)
        found = np.zeros(len(edges), bool)
        first = {}
        for face in range(len(ends)):
            for k in range(3):
                edge = edge_of_corner[face, k]
                sides = {int(ends[face, k]): corner[face, k], int(ends[face, (k + 1) % 3]): corner[face, (k + 1) % 3]}
                other = first.setdefault(edge, sides)
                if other is not sides:
                    found[edge] |= any(not np.allclose(values[sides[v]], values[other[v]], atol=by) for v in sides)
        return found

    def restore_groups(self, of, made):
        """Restore the vertex groups of the new mesh of an object, with their weights.

        The mesh stores their names, so all objects that share it have them.
        """
        if not self.groups:
            return
        for name, is_locked in self.groups:
            of.vertex_groups.new(name=name).lock_weight = is_locked
        of.vertex_groups.active_index = self.active_group
        weights = np.asarray(made.attributes["groups"]).reshape(len(made.vertices), -1)[self.row_of_vertex]
        edit = bmesh.new()
        edit.from_mesh(of.data)
        layer = edit.verts.layers.deform.verify()
        for v, row in zip(edit.verts, weights):
            for group in np.nonzero(row > 1e-6)[0]:
                v[layer][int(group)] = float(row[group])
        edit.to_mesh(of.data)
        edit.free()

    def restore_keys(self, of, made):
        """Restore the shape keys of the new mesh of an object, with their values and their animation."""
        positions = np.asarray(made.vertices, np.float32)[self.row_of_vertex]
        old = self.given.shape_keys
        for i, key in enumerate(self.keys):
            new = of.shape_key_add(name=key.name, from_mix=False)
            offsets = np.asarray(made.attributes[f"morph{i}_positions"], np.float32)[self.row_of_vertex]
            new.data.foreach_set("co", (positions + offsets).ravel())
            new.slider_min, new.slider_max = key.slider_min, key.slider_max
            new.value, new.mute, new.vertex_group = key.value, key.mute, key.vertex_group
            new.interpolation = key.interpolation
        made_keys = of.data.shape_keys
        for key in self.keys:
            made_keys.key_blocks[key.name].relative_key = made_keys.key_blocks[key.relative_key.name]
        made_keys.use_relative = old.use_relative
        if old.animation_data and old.animation_data.action:
            motion = made_keys.animation_data_create()
            motion.action = old.animation_data.action
            if hasattr(motion, "action_slot"):
                motion.action_slot = old.animation_data.action_slot
