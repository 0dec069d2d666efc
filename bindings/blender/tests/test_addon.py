"""The add-on in the Blender module bpy: `pip install bpy lodsmith pytest`, then `pytest bindings/blender/tests`."""

import pathlib
import sys

import bpy
import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

import lodsmith_blender


@pytest.fixture(autouse=True)
def scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    lodsmith_blender.register()
    yield bpy.context.scene
    lodsmith_blender.unregister()


def sheet(name="sheet", n=40, size=1.0):
    """A wavy sheet with texture coordinates, two materials, vertex groups, colours and shape keys."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=n, y_subdivisions=n, size=2 * size)
    o = bpy.context.object
    o.name = o.data.name = name
    mesh = o.data
    co = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", co)
    co = co.reshape(-1, 3)
    co[:, 2] = 0.2 * np.sin(3 * co[:, 0]) * np.cos(2 * co[:, 1])
    mesh.vertices.foreach_set("co", co.ravel())
    for material in ("left", "right"):
        mesh.materials.append(bpy.data.materials.new(material))
    for polygon in mesh.polygons:
        polygon.material_index = int(polygon.center.x > 0)
        polygon.use_smooth = True
    group = o.vertex_groups.new(name="right half")
    for v in mesh.vertices:
        group.add([v.index], max(0.0, min(1.0, 0.5 + v.co.x / 2)), "REPLACE")
    colors = mesh.color_attributes.new("tint", "FLOAT_COLOR", "POINT")
    for v, c in zip(mesh.vertices, colors.data):
        c.color = (0.5 + v.co.x / 2, 0.5 + v.co.y / 2, 0.0, 1.0)
    o.shape_key_add(name="Basis")
    raised = o.shape_key_add(name="raised")
    for v, k in zip(mesh.vertices, raised.data):
        k.co = (v.co.x, v.co.y, v.co.z + 0.5 + 0.25 * v.co.x)
    raised.value, raised.slider_max = 0.25, 2.0
    mesh["studio"] = "ours"
    return o


def select(*objects):
    bpy.ops.object.select_all(action="DESELECT")
    for o in objects:
        o.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]


def positions(mesh):
    co = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", co)
    return co.reshape(-1, 3)


def test_all_data_of_a_mesh_are_kept():
    o = sheet()
    before = 2 * len(o.data.polygons)
    select(o)
    assert bpy.ops.object.lodsmith(target="RATIO", ratio=0.1) == {"FINISHED"}
    mesh = o.data
    assert mesh.name == "sheet" and len(bpy.data.meshes) == 1
    assert 0 < len(mesh.polygons) <= 0.1 * before and all(len(p.vertices) == 3 for p in mesh.polygons)
    co = positions(mesh)
    wave = 0.2 * np.sin(3 * co[:, 0]) * np.cos(2 * co[:, 1])
    assert np.abs(co[:, 2] - wave).max() < 0.02

    uvs = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers.active.uv.foreach_get("vector", uvs)
    corner = np.array([loop.vertex_index for loop in mesh.loops])
    assert np.abs(uvs.reshape(-1, 2) - (co[corner, :2] + 1) / 2).max() < 0.03

    assert [m.name for m in mesh.materials] == ["left", "right"]
    sides = {p.material_index for p in mesh.polygons if p.center.x > 0.1}
    assert sides == {1} and {p.material_index for p in mesh.polygons} == {0, 1}
    assert all(p.use_smooth for p in mesh.polygons)

    assert [g.name for g in o.vertex_groups] == ["right half"]
    for v in mesh.vertices:
        weight = {g.group: g.weight for g in v.groups}.get(0, 0.0)
        assert abs(weight - max(0.0, min(1.0, 0.5 + v.co.x / 2))) < 0.05
    tint = np.array([c.color[:] for c in mesh.color_attributes["tint"].data])
    assert np.abs(tint[:, 0] - (0.5 + co[:, 0] / 2)).max() < 0.05

    keys = mesh.shape_keys.key_blocks
    assert [k.name for k in keys] == ["Basis", "raised"]
    assert keys["raised"].value == pytest.approx(0.25) and keys["raised"].slider_max == pytest.approx(2)
    raised = np.array([k.co[:] for k in keys["raised"].data])
    assert np.abs(raised[:, 2] - (co[:, 2] + 0.5 + 0.25 * co[:, 0])).max() < 0.02
    assert mesh["studio"] == "ours"


def test_a_seam_stays_a_seam():
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
    o = bpy.context.object
    bpy.ops.object.shade_smooth()
    for e in o.data.edges:
        v = [o.data.vertices[i].co for i in e.vertices]
        e.use_seam = all(abs(p.y) < 1e-5 and p.x < 0 for p in v)
    select(o)
    bpy.ops.object.lodsmith(ratio=0.2)
    mesh = o.data
    # Still closed: a seam of the texture does not cut the surface.
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.polygons) == 2
    assert any(e.use_seam for e in mesh.edges)
    for p in mesh.polygons:
        u = [mesh.uv_layers.active.uv[i].vector[0] for i in p.loop_indices]
        assert max(u) - min(u) < 0.5, "a triangle across the seam of the texture"


def test_sharp_edges_stay_sharp():
    bpy.ops.mesh.primitive_cylinder_add(vertices=128, depth=2)
    o = bpy.context.object
    bpy.ops.object.shade_smooth()
    for e in o.data.edges:
        v = [o.data.vertices[i].co for i in e.vertices]
        e.use_edge_sharp = abs(v[0].z - v[1].z) < 1e-6
    select(o)
    bpy.ops.object.lodsmith(ratio=0.4)
    mesh = o.data
    rim = [e for e in mesh.edges if all(abs(abs(mesh.vertices[i].co.z) - 1) < 1e-4 and mesh.vertices[i].co.xy.length > 0.9 for i in e.vertices)]
    on_caps = [e for e in rim if abs(mesh.vertices[e.vertices[0]].co.z - mesh.vertices[e.vertices[1]].co.z) < 1e-4]
    assert sum(e.use_edge_sharp for e in on_caps) > 0.4 * len(on_caps) > 10
    upright = [e for e in mesh.edges if abs(mesh.vertices[e.vertices[0]].co.z - mesh.vertices[e.vertices[1]].co.z) > 1]
    assert upright and not any(e.use_edge_sharp for e in upright)


def test_several_objects_and_shared_meshes():
    a, b = sheet("a"), sheet("b", 20, 3.0)
    twin = bpy.data.objects.new("twin", a.data)
    bpy.context.scene.collection.objects.link(twin)
    counts = [len(a.data.polygons), len(b.data.polygons)]
    select(a, b, twin)
    assert bpy.ops.object.lodsmith(ratio=0.25) == {"FINISHED"}
    assert twin.data is a.data and a.data is not b.data
    assert [len(a.data.polygons), len(b.data.polygons)] <= [counts[0] // 2, counts[1] // 2]


def test_faces_and_error_as_targets():
    o = sheet()
    select(o)
    bpy.ops.object.lodsmith(target="FACES", faces=500)
    assert len(o.data.polygons) <= 500
    other = sheet("other")
    select(other)
    bpy.ops.object.lodsmith(target="ERROR", error=0.5)
    co = positions(other.data)
    limit = 0.005 * np.linalg.norm(np.ptp(co, axis=0))
    assert np.abs(co[:, 2] - 0.2 * np.sin(3 * co[:, 0]) * np.cos(2 * co[:, 1])).max() <= limit + 0.005


def test_a_mesh_without_faces_is_an_error_and_stays():
    mesh = bpy.data.meshes.new("points")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    o = bpy.data.objects.new("points", mesh)
    bpy.context.scene.collection.objects.link(o)
    select(o)
    with pytest.raises(RuntimeError, match="no faces"):
        bpy.ops.object.lodsmith(ratio=0.5)
    assert o.data is mesh and len(mesh.edges) == 1


def test_the_menu_and_the_operator_are_registered_and_removed():
    assert hasattr(bpy.types, "OBJECT_OT_lodsmith")
    assert bpy.ops.object.lodsmith.poll() is False
    select(sheet())
    assert bpy.ops.object.lodsmith.poll()


def test_vertex_groups_keep_their_names_locks_and_order():
    o = sheet()
    for name in ("empty", "left half"):
        o.vertex_groups.new(name=name)
    o.vertex_groups["left half"].add([v.index for v in o.data.vertices if v.co.x < 0], 1.0, "REPLACE")
    o.vertex_groups["empty"].lock_weight = True
    o.vertex_groups.active_index = 2
    twin = bpy.data.objects.new("twin", o.data)
    bpy.context.scene.collection.objects.link(twin)
    select(o, twin)
    bpy.ops.object.lodsmith(ratio=0.1)
    for each in (o, twin):
        assert [(g.name, g.lock_weight) for g in each.vertex_groups] == [("right half", False), ("empty", True), ("left half", False)]
        assert each.vertex_groups.active_index == 2
    # Each group has its own weights.
    for v in o.data.vertices:
        weights = {o.vertex_groups[g.group].name: g.weight for g in v.groups}
        assert "empty" not in weights
        assert abs(weights.get("right half", 0.0) - max(0.0, min(1.0, 0.5 + v.co.x / 2))) < 0.05
        if abs(v.co.x) > 0.3:
            assert weights.get("left half", 0.0) == pytest.approx(float(v.co.x < 0), abs=0.05)


def test_a_rig_deforms_and_masks_apply_afterwards():
    o = sheet()
    bpy.ops.object.armature_add(enter_editmode=True)
    rig = bpy.context.object
    rig.data.edit_bones[0].name = "right half"
    bpy.ops.object.mode_set(mode="OBJECT")
    o.modifiers.new("rig", "ARMATURE").object = rig
    lift = o.modifiers.new("lift", "DISPLACE")
    lift.vertex_group, lift.direction, lift.mid_level = "right half", "X", 0.0
    select(o)
    bpy.ops.object.lodsmith(ratio=0.1)
    # The bone points up, so its direction is up in the world.
    rig.pose.bones["right half"].location = (0.0, 2.0, 0.0)
    evaluated = o.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    # (Weights of an armature are normalised: a vertex of weight 0 stays, any other follows its only bone.)
    rest = np.array([v.co[:] for v in o.data.vertices])
    raised = np.array([k.co[:] for k in o.data.shape_keys.key_blocks["raised"].data])
    rest = rest + 0.25 * (raised - rest)
    moved = np.array([v.co[:] for v in evaluated.vertices]) - rest
    weight = np.array([sum(g.weight for g in v.groups) for v in o.data.vertices])
    assert np.abs(moved[weight > 0.1][:, 2] - 2).max() < 1e-4
    # Without its group, the other modifier would move all vertices.
    assert np.abs(moved[:, 0] - weight * lift.strength).max() < 1e-4
