"""Functions return the kind of mesh that they are given: trimesh, PyVista or Open3D."""

import importlib

import lodsmith
import numpy as np
import pytest


def optional(name):
    """Return the package, or None if it is not installed or needs a missing system library."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


trimesh, pyvista, o3d = map(optional, ("trimesh", "pyvista", "open3d"))


def close(vertices, values, limit):
    return np.abs(np.asarray(values) - np.asarray(vertices)).max() < limit


@pytest.mark.skipif(trimesh is None, reason="trimesh cannot be imported")
class TestTrimesh:
    def test_colors(self, wave):
        given = trimesh.Trimesh(wave.vertices, wave.faces, vertex_colors=wave.colors, process=False)
        given.metadata["name"] = "wave"
        made = lodsmith.simplify(given, ratio=0.2)
        assert isinstance(made, trimesh.Trimesh) and made.metadata["name"] == "wave"
        assert len(made.faces) <= 0.2 * len(given.faces)
        assert made.visual.kind == "vertex"
        assert close(255 * made.vertices[:, 0], made.visual.vertex_colors[:, 0].astype(float), 4)
        assert close(lodsmith.simplify(lodsmith.Mesh.of(given), ratio=0.2).vertices, made.vertices, 1e-12)

    def test_uvs_material_and_normals(self, wave):
        material = trimesh.visual.material.SimpleMaterial(diffuse=[10, 20, 30, 255])
        visual = trimesh.visual.TextureVisuals(uv=wave.uvs, material=material)
        given = trimesh.Trimesh(
            wave.vertices, wave.faces, vertex_normals=wave.normals, visual=visual, process=False
        )
        made = lodsmith.simplify(given, ratio=0.2)
        assert close(made.vertices[:, :2], made.visual.uv, 0.01)
        assert made.visual.material.main_color.tolist() == [10, 20, 30, 255]
        assert "vertex_normals" in made._cache.cache and len(made.vertex_normals) == len(made.vertices)

    def test_normals_that_were_only_read_change_nothing(self, wave):
        made = []
        for reads in (False, True):
            given = trimesh.Trimesh(wave.vertices, wave.faces, process=False)
            if reads:
                given.vertex_normals
            made.append(lodsmith.simplify(given, ratio=0.1))
        assert (made[0].vertices == made[1].vertices).all() and (made[0].faces == made[1].faces).all()
        assert (made[0].vertex_normals == made[1].vertex_normals).all()
        # Normals that differ from the shape were set by the user, and count; requested normals count too.
        turned = trimesh.Trimesh(wave.vertices, wave.faces, vertex_normals=-wave.normals, process=False)
        assert lodsmith.simplify(turned, ratio=0.1).vertex_normals[:, 2].max() < 0
        asked = lodsmith.Mesh.of(given)
        assert asked.normals is None
        asked.normals = given.vertex_normals
        assert lodsmith.simplify(asked, ratio=0.1).normals is not None

    def test_face_colors_keep_their_border(self, wave):
        colors = np.where((wave.vertices[wave.faces].mean(axis=1)[:, 0] > 0.5)[:, None], [255, 0, 0, 255], [0, 0, 255, 255])
        given = trimesh.Trimesh(wave.vertices, wave.faces, face_colors=colors, process=False)
        made = lodsmith.simplify(given, ratio=0.1)
        is_red = made.visual.face_colors[:, 0] == 255
        middle = made.triangles_center[:, 0]
        assert 0 < is_red.sum() < len(is_red)
        assert middle[is_red].min() > 0.48 and middle[~is_red].max() < 0.52

    def test_attributes(self, wave):
        given = trimesh.Trimesh(wave.vertices, wave.faces, process=False)
        given.vertex_attributes["heat"] = wave.vertices[:, 0].astype(np.float32)
        made = lodsmith.simplify(given, ratio=0.2)
        assert close(made.vertices[:, 0], made.vertex_attributes["heat"], 0.01)

    def test_levels(self, ball):
        given = ball.to_trimesh()
        levels = lodsmith.lod(given, levels=[0.5, 0.1])
        assert [len(level.faces) for level in levels] == [2560, 512]
        assert lodsmith.info(given)["closed"] and lodsmith.clean(given).is_watertight
        assert isinstance(lodsmith.Progressive(given).level(faces=100), trimesh.Trimesh)


@pytest.mark.skipif(pyvista is None, reason="pyvista cannot be imported")
class TestPyVista:
    def test_point_data(self, wave):
        given = pyvista.PolyData.from_regular_faces(wave.vertices.astype(np.float32), wave.faces)
        given.point_data["Normals"] = wave.normals.astype(np.float32)
        given.point_data.active_normals_name = "Normals"
        given.active_texture_coordinates = wave.uvs.astype(np.float32)
        given.point_data["RGB"] = wave.colors
        given.point_data["heat"] = wave.vertices[:, 0]
        given.cell_data["part"] = (wave.vertices[wave.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
        given.field_data["note"] = np.array([1, 2, 3])
        made = lodsmith.simplify(given, ratio=0.2)
        assert isinstance(made, pyvista.PolyData) and made.is_all_triangles
        assert made.n_cells <= 0.2 * given.n_cells and made.points.dtype == np.float32
        x = made.points[:, 0]
        assert close(x, made.active_texture_coordinates[:, 0], 0.01)
        assert close(255 * x, made.point_data["RGB"][:, 0].astype(float), 4)
        assert made.point_data["heat"].dtype == np.float64 and close(x, made.point_data["heat"], 0.01)
        assert made.point_data.active_normals_name == "Normals"
        assert set(made.cell_data["part"]) == {0, 1} and made.field_data["note"].tolist() == [1, 2, 3]

    def test_polygons_are_triangulated_and_losses_are_warnings(self):
        given = pyvista.Plane(i_resolution=20, j_resolution=20)
        given.cell_data["quality"] = np.zeros(given.n_cells)
        with pytest.warns(lodsmith.LodsmithWarning, match="cell data 'quality'"):
            made = lodsmith.simplify(given, faces=10)
        assert made.is_all_triangles and made.n_cells <= 10


    def test_identifiers_of_cells_are_no_regions(self, wave):
        def mesh():
            return pyvista.PolyData.from_regular_faces(wave.vertices.astype(np.float32), wave.faces)

        plain = lodsmith.simplify(mesh(), ratio=0.1)
        n = len(wave.faces)
        # Of the cells of a volume, some have several faces on its surface.
        for name, values in [("id", np.arange(n)), ("id", 7 * np.arange(n)[::-1]), ("vtkOriginalCellIds", np.arange(n) // 2)]:
            given = mesh()
            given.cell_data[name] = values
            with pytest.warns(lodsmith.LodsmithWarning, match=f"does not have the cell data '{name}'"):
                made = lodsmith.simplify(given, ratio=0.1)
            assert (made.points == plain.points).all() and not made.cell_data.keys()
        # They do not take the place of regions.
        given.cell_data["part"] = (wave.vertices[wave.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
        with pytest.warns(lodsmith.LodsmithWarning, match="vtkOriginalCellIds"):
            assert set(lodsmith.simplify(given, ratio=0.1).cell_data["part"]) == {0, 1}

    def test_identifiers_of_polygons_are_no_regions(self):
        given = pyvista.Plane(i_resolution=20, j_resolution=20)
        given.cell_data["id"] = np.arange(given.n_cells)
        with pytest.warns(lodsmith.LodsmithWarning, match="cell data 'id'"):
            assert lodsmith.simplify(given, faces=10).n_cells <= 10


@pytest.mark.skipif(o3d is None, reason="open3d cannot be imported")
class TestOpen3D:
    def legacy(self, wave):
        g, u = o3d.geometry, o3d.utility
        given = g.TriangleMesh(u.Vector3dVector(wave.vertices), u.Vector3iVector(wave.faces.astype(np.int32)))
        given.vertex_colors = u.Vector3dVector(wave.colors / 255)
        given.vertex_normals = u.Vector3dVector(wave.normals)
        given.triangle_uvs = u.Vector2dVector(wave.uvs[wave.faces].reshape(-1, 2))
        return given

    def test_legacy(self, wave):
        given = self.legacy(wave)
        made = lodsmith.simplify(given, ratio=0.2)
        assert isinstance(made, o3d.geometry.TriangleMesh)
        vertices, faces = np.asarray(made.vertices), np.asarray(made.triangles)
        assert len(faces) <= 0.2 * len(wave.faces)
        assert close(vertices[:, :2][faces.reshape(-1)], made.triangle_uvs, 0.01)
        assert close(vertices[:, 0], np.asarray(made.vertex_colors)[:, 0], 0.02)
        assert made.has_vertex_normals()

    def test_seams_stay_seams(self, wave):
        given = self.legacy(wave)
        uvs = np.asarray(given.triangle_uvs).reshape(-1, 3, 2).copy()
        right = wave.vertices[wave.faces].mean(axis=1)[:, 0] > 0.5
        uvs[right] += 5
        given.triangle_uvs = o3d.utility.Vector2dVector(uvs.reshape(-1, 2))
        made = lodsmith.simplify(given, ratio=0.1)
        got = np.asarray(made.triangle_uvs).reshape(-1, 3, 2)
        middle = np.asarray(made.vertices)[np.asarray(made.triangles)].mean(axis=1)[:, 0]
        # No face has corners on both sides, and vertices along the seam are joined.
        assert ((got > 2).all(axis=(1, 2)) | (got < 2).all(axis=(1, 2))).all()
        assert ((got > 2).all(axis=(1, 2)) == (middle > 0.5)).mean() > 0.97
        assert len(made.get_non_manifold_edges(allow_boundary_edges=True)) == 0
        assert lodsmith.info(made)["components"] == 1

    def test_tensor(self, wave):
        given = o3d.t.geometry.TriangleMesh.from_legacy(self.legacy(wave))
        made = lodsmith.simplify(given, ratio=0.2)
        assert isinstance(made, o3d.t.geometry.TriangleMesh)
        positions = made.vertex.positions.numpy()
        faces = made.triangle.indices.numpy()
        assert positions.dtype == np.float32 and len(faces) <= 0.2 * len(wave.faces)
        assert close(positions[:, :2][faces], made.triangle.texture_uvs.numpy(), 0.01)
        assert close(positions[:, 0], made.vertex.colors.numpy()[:, 0], 0.02)


@pytest.mark.skipif(pyvista is None, reason="pyvista cannot be imported")
def test_data_of_other_packages_keep_their_names(wave):
    given = pyvista.PolyData.from_regular_faces(wave.vertices, wave.faces)
    given.point_data["uv"] = wave.vertices[:, 0]
    assert list(lodsmith.Mesh.of(given).attributes) == ["uv"]
    assert lodsmith.simplify(given, ratio=0.2).point_data["uv"].shape[0] > 0


def test_no_package_is_imported_for_arrays():
    import subprocess
    import sys

    code = "import lodsmith, sys; lodsmith.simplify(lodsmith.icosphere(2), ratio=0.5).render(size=(8, 8)); "
    code += "print(sorted({m.partition('.')[0] for m in sys.modules} & {'trimesh', 'pyvista', 'open3d', 'tqdm', 'PIL'}))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
