"""simplify() on arrays: types, layouts, invalid values."""

import lodsmith
import numpy as np
import pytest

FACES = (np.int32, np.uint32, np.int64)


@pytest.mark.parametrize("faces", FACES + (np.int16, np.uint16, np.uint64))
@pytest.mark.parametrize("vertices", (np.float32, np.float64))
def test_types_are_kept(ball, vertices, faces):
    made = lodsmith.simplify(ball.vertices.astype(vertices), ball.faces.astype(faces), faces=100)
    assert made.faces.shape == (100, 3) and made.vertices.dtype == vertices
    # Types that are too small for the numbers of vertices are not kept.
    assert made.faces.dtype == (faces if np.dtype(faces).itemsize > 2 else np.int32)
    assert made.faces.min() == 0 and made.faces.max() == len(made.vertices) - 1


def test_all_layouts_give_the_same_bytes(ball):
    v, f = ball.vertices, ball.faces
    wanted = lodsmith.simplify(v, f, ratio=0.1)
    frozen = v.copy()
    frozen.flags.writeable = False
    wide = np.zeros((len(v), 6))
    wide[:, ::2] = v
    layouts = [
        (v.tolist(), f.tolist()),
        (np.asfortranarray(v), np.asfortranarray(f)),
        (wide[:, ::2], f[::-1][::-1]),
        (frozen, f),
        (v.astype(">f8"), f.astype(">i8")),
        (np.frombuffer(b"\0" + v.tobytes(), np.uint8)[1:].view(np.float64).reshape(-1, 3), f),
    ]
    for vertices, faces in layouts:
        made = lodsmith.simplify(vertices, faces, ratio=0.1)
        assert made.vertices.tobytes() == wanted.vertices.tobytes()
        assert made.faces.astype(np.int64).tobytes() == wanted.faces.tobytes()


def test_the_input_is_not_changed(ball):
    before = ball.vertices.copy(), ball.faces.copy()
    lodsmith.simplify(ball.vertices, ball.faces, ratio=0.1)
    assert (ball.vertices == before[0]).all() and (ball.faces == before[1]).all()


@pytest.mark.parametrize("dtype", FACES)
def test_a_bad_index_is_named(ball, dtype):
    faces = ball.faces.astype(dtype)
    faces[1234, 1] = 99999
    with pytest.raises(lodsmith.InvalidMesh, match="face 1234 uses vertex 99999, but the mesh has 2562") as info:
        lodsmith.simplify(ball.vertices, faces, ratio=0.1)
    assert (info.value.face, info.value.index) == (1234, 99999) and isinstance(info.value, ValueError)
    if dtype != np.uint32:
        faces[1234, 1] = -1
        with pytest.raises(lodsmith.InvalidMesh, match="face 1234 uses vertex -1"):
            lodsmith.simplify(ball.vertices, faces, ratio=0.1)


def test_an_empty_mesh_is_an_error(ball):
    for vertices, faces in [([], []), (ball.vertices, []), (np.zeros((0, 3)), np.zeros((0, 3), int))]:
        with pytest.raises(lodsmith.InvalidMesh, match="no face with an area") as info:
            lodsmith.simplify(vertices, faces, ratio=0.5)
        assert info.value.face is None


def test_wrong_shapes_and_types(ball):
    v, f = ball.vertices, ball.faces
    for bad_v, bad_f, kind, text in [
        (v[:, :2], f, ValueError, r"vertices: a shape of \(n, 3\)"),
        (v, f[:, :2], ValueError, r"faces: a shape of \(m, 3\)"),
        (v, f.astype(float), TypeError, "faces: integers"),
        (np.array([["a", "b", "c"]]), f, TypeError, "vertices: numbers"),
    ]:
        with pytest.raises(kind, match=text):
            lodsmith.simplify(bad_v, bad_f, ratio=0.5)
    with pytest.raises(TypeError, match="faces are missing"):
        lodsmith.simplify(v, ratio=0.5)
    with pytest.raises(TypeError, match="unknown type of mesh"):
        lodsmith.simplify(object(), ratio=0.5)


def test_wrong_keywords(ball):
    for options, kind, text in [
        ({"rato": 0.1}, TypeError, "no keyword 'rato'; a similar one is 'ratio'"),
        ({"ratio": 0.1, "max_norml": 3}, TypeError, "'max_normal'"),
        ({"ratio": 0.1, "zzzzz": 3}, TypeError, "'zzzzz'$"),
        ({}, TypeError, "^give a target: faces=, vertices=, ratio= or error="),
        ({"method": "cluster", "two_stage": True, "cell": 0.1}, TypeError, "^give a target"),
        ({"target_reduction": 0.9}, TypeError, "'target_reduction'; use ratio=1 - target_reduction"),
        ({"percent": 0.9}, TypeError, "'percent'; use ratio=1 - percent"),
        ({"face_count": 100}, TypeError, "'face_count'; use faces="),
        ({"ratio": 0.1, "method": "lindstrom_turk"}, ValueError, "^method: 'lindstrom_turk' is spelled 'lindstrom-turk'"),
        ({"ratio": float("nan")}, ValueError, "^ratio: "),
        ({"ratio": object()}, ValueError, "^ratio: a value of type .*object.* is not taken"),
        ({"ratio": 2.0}, ValueError, "^ratio: a fraction"),
        ({"ratio": "ten"}, ValueError, "^ratio: "),
        ({"ratio": [0.1]}, ValueError, "^ratio: "),
        ({"faces": 0}, ValueError, "^faces: a whole number of at least 1 is expected, not 0"),
        ({"faces": 10.5}, ValueError, "^faces: "),
        ({"faces": -5}, ValueError, "^faces: "),
        ({"faces": True}, ValueError, "^faces: "),
        ({"faces": ball.faces}, TypeError, "second argument"),
        ({"ratio": 0.1, "method": "quadratic"}, ValueError, "^method: one of memoryless, "),
        ({"ratio": 0.1, "max_normal": 500}, ValueError, "^max_normal: a number above 0 and at most 180 degrees"),
        ({"ratio": 0.1, "max_edge": "5 m"}, ValueError, "^max_edge: a length"),
        ({"ratio": 0.1, "weight": {"uvs": 1}}, ValueError, r"^weight: a factor of 0 or more for each name, as in \{'name': 2\} \(names are normal, uv"),
        ({"ratio": 0.1, "weight": 2}, ValueError, "^weight: "),
        ({"ratio": 0.1, "cell": 0.1}, ValueError, "^cell is not an option of method memoryless"),
        ({"ratio": 0.1, "escalate": "perhaps"}, ValueError, "^escalate: "),
        ({"ratio": 0.1, "locked": [True]}, ValueError, r"^locked: the shape \(1,\) is not \(2562,\)"),
        ({"ratio": 0.1, "importance": np.ones(5)}, ValueError, "^importance: "),
        ({"ratio": 0.1, "time_limit": -1}, ValueError, "^time_limit: "),
        ({"ratio": 0.1, "progress": 7}, TypeError, "^progress: "),
    ]:
        with pytest.raises(kind, match=text):
            lodsmith.simplify(ball.vertices, ball.faces, **options)


@pytest.mark.filterwarnings("ignore:target not reached")
def test_every_option_is_taken(ball):
    samples = {"count": 50, "ratio": "20%", "length": "1%", "degrees": 40.0, "number": 0.1, "seed": 7, "flag": True}
    of_method = {"cell": "cluster", "two_stage": "cluster", "edge_length": "shortest-edge", "angle": "planar"}
    of_method.update(flat="planar", iterations="unsubdivide", voxel="remesh", subdivisions="remesh", adaptive="remesh")
    for option in lodsmith.options():
        name = option["name"]
        assert "--" not in option["help"]
        value = samples.get(option["kind"])
        if option["kind"] == "word":
            value = option["words"][0]
            assert option["default"] is None or option["default"] in option["words"]
        if option["kind"] == "weights":
            value = {"uv": 2, "normal": 0.5}
        keywords = {"faces": 500, name: value}
        if name in of_method:
            keywords["method"] = of_method[name]
        if name == "voxel":
            keywords.pop("faces")
        if name == "subdivisions":
            keywords[name] = 1
        made = lodsmith.simplify(ball, **keywords)
        assert 0 < len(made.faces) <= 5120 or name == "voxel", name


def test_numbers_of_numpy_are_numbers(ball):
    assert len(lodsmith.simplify(ball, faces=np.int64(100)).faces) == 100
    assert len(lodsmith.simplify(ball, ratio=np.float32(0.5)).faces) == 2560
    assert len(lodsmith.simplify(ball, faces=100, seed=2**64 - 1).faces) == 100


def test_an_unreachable_target_warns(ball):
    with pytest.warns(lodsmith.LodsmithWarning, match="target not reached, stopped by refusals"):
        made = lodsmith.simplify(ball, faces=10, max_normal=1.0, topology="preserve")
    assert not made.report["reached"]


def test_locked_vertices_stay(ball):
    locked = ball.vertices[:, 2] > 0.5
    made = lodsmith.simplify(ball, ratio=0.5, locked=locked)
    kept = {p.tobytes() for p in made.vertices}
    assert all(p.tobytes() in kept for p in ball.vertices[locked])
    assert made.report["locked"]["vertices"] == locked.sum()


def test_an_error_map_keeps_places(ball):
    coarse = lodsmith.simplify(ball, error="2%")
    shares = np.where(ball.vertices[:, 2] > 0, 0.0, 1.0)
    made = lodsmith.simplify(ball, error="2%", error_map=shares)
    kept = ball.vertices[shares == 0.0].astype(np.float32)
    assert {tuple(p) for p in kept} <= {tuple(p) for p in made.vertices.astype(np.float32)}
    assert len(coarse.faces) < len(made.faces) < len(ball.faces) * 3 // 4
    with pytest.raises(ValueError, match="error"):
        lodsmith.simplify(ball, ratio=0.5, error_map=shares)


def test_of_the_shares_of_one_vertex_the_least_counts(ball):
    # Two rows for each vertex, told apart by an attribute.
    count = len(ball.vertices)
    vertices, faces = np.concatenate([ball.vertices] * 2), ball.faces.copy()
    faces[::2] += count
    attributes = {"side": np.repeat([0.0, 1.0], count)}
    shares = np.concatenate([np.ones(count), np.zeros(count)])
    made = lodsmith.simplify(vertices, faces, attributes=attributes, error="5%", error_map=shares)
    used = ball.vertices[np.unique(ball.faces[::2])].astype(np.float32)
    assert {tuple(p) for p in used} <= {tuple(p) for p in made.vertices.astype(np.float32)}


def test_importance_attracts_triangles(ball):
    importance = np.where(ball.vertices[:, 2] > 0, 8.0, 1.0)
    made = lodsmith.simplify(ball, ratio=0.2, importance=importance)
    upper = (made.vertices[made.faces].mean(axis=1)[:, 2] > 0).mean()
    assert upper > 0.7


def test_attributes_keep_their_types(wave):
    labels = (wave.vertices[:, 0] > 0.5).astype(np.int8) * 7
    heat = (wave.vertices[:, 0] * 2).astype(np.float64)
    attributes = {**wave._named(), "label": labels, "heat": heat, "pair": np.stack([heat, -heat], axis=1)}
    made = lodsmith.simplify(wave.vertices, wave.faces, attributes=attributes, ratio=0.2)
    n = len(made.vertices)
    assert made.colors.dtype == np.uint8 and made.colors.shape == (n, 3)
    assert np.abs(made.colors[:, 0] - 255 * made.vertices[:, 0]).max() < 4
    assert np.abs(made.uvs - made.vertices[:, :2]).max() < 0.01 and made.uvs.dtype == np.float64
    assert np.abs(np.linalg.norm(made.normals, axis=1) - 1).max() < 1e-5
    assert made.attributes["label"].dtype == np.int8 and set(made.attributes["label"]) == {0, 7}
    assert made.attributes["heat"].shape == (n,) and np.abs(made.attributes["heat"] - 2 * made.vertices[:, 0]).max() < 0.02
    assert np.allclose(made.attributes["pair"][:, 0], -made.attributes["pair"][:, 1])


def test_regions_keep_their_border(wave):
    regions = (wave.vertices[wave.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
    made = lodsmith.simplify(wave.vertices, wave.faces, attributes={"regions": regions}, ratio=0.05)
    middle = made.vertices[made.faces].mean(axis=1)[:, 0]
    assert made.regions.dtype == np.int32 and set(made.regions) == {0, 1}
    assert (middle[made.regions == 0].max() <= 0.52) and (middle[made.regions == 1].min() >= 0.48)


def test_names_of_attributes_may_be_spelled_as_in_weight(wave):
    plural = {"normals": wave.normals, "uvs": wave.uvs, "colors": wave.colors}
    singular = {name[:-1]: values for name, values in plural.items()}
    a, b = (
        lodsmith.simplify(wave.vertices, wave.faces, attributes=given, weight={"uv": 2, "normal": 3}, ratio=0.1)
        for given in (plural, singular)
    )
    assert not b.attributes and (a.vertices == b.vertices).all()
    assert (a.uvs == b.uvs).all() and (a.normals == b.normals).all() and (a.colors == b.colors).all()
    with pytest.raises(ValueError, match="'uv' and 'uvs' are the same"):
        lodsmith.Mesh(wave.vertices, wave.faces, {"uv": wave.uvs, "uvs": wave.uvs})


def test_faces_with_invalid_positions_are_dropped_with_a_warning(ball):
    vertices = ball.vertices.copy()
    vertices[5, 1], vertices[40, 2] = np.nan, np.inf
    count = np.isin(ball.faces, [5, 40]).any(axis=1).sum()
    text = f"^{count} faces have a position that is not finite: removed$"
    with pytest.warns(lodsmith.LodsmithWarning, match=text):
        made = lodsmith.simplify(vertices, ball.faces, ratio=0.2)
    assert made.report["cleanup"]["non_finite_faces"] == count
    with pytest.warns(lodsmith.LodsmithWarning, match=text) as caught:
        lodsmith.lod(vertices, ball.faces, levels=[0.5, 0.2])
    assert len(caught) == 1
    # A vertex without faces is not a loss.
    unused = np.concatenate([ball.vertices, [[np.nan] * 3]])
    assert len(lodsmith.simplify(unused, ball.faces, ratio=0.2).faces) == 1024


def test_a_warning_points_to_the_call(ball, tmp_path):
    vertices = ball.vertices.copy()
    vertices[0] = np.nan
    mesh = lodsmith.Mesh(ball.vertices, ball.faces, {"id": np.arange(len(ball.vertices)) + (1 << 30)})
    calls = [
        lambda: lodsmith.simplify(vertices, ball.faces, ratio=0.5),
        lambda: lodsmith.simplify(ball, faces=10, max_normal=1.0, topology="preserve"),
        lambda: lodsmith.save(mesh, tmp_path / "a.ply"),
        lambda: mesh.save(tmp_path / "b.ply"),
        lambda: lodsmith.simplify_file(tmp_path / "a.ply", tmp_path / "c.ply", faces=10, max_normal=1, topology="preserve"),
    ]
    for call in calls:
        with pytest.warns(lodsmith.LodsmithWarning) as caught:
            call()
        assert {w.filename for w in caught} == {__file__}


def test_wrong_attributes(wave):
    v, f = wave.vertices, wave.faces
    for attributes, kind, text in [
        ({"uvs": np.zeros((3, 2))}, ValueError, "'uvs' has the shape"),
        ({"uvs": np.zeros((len(v), 5))}, ValueError, r"'uvs' has the shape \(3600, 5\), not \(n, 2\)"),
        ({"regions": np.zeros(len(v), int)}, ValueError, "faces"),
        ({"regions": np.zeros(len(f))}, ValueError, "'regions' needs one integer"),
        ({"name": np.full(len(v), "a")}, TypeError, "'name' has values of type"),
    ]:
        with pytest.raises(kind, match=text):
            lodsmith.simplify(v, f, attributes=attributes, ratio=0.5)


def test_the_source_map_transfers_any_data(wave):
    made = lodsmith.simplify(wave.vertices, wave.faces, ratio=0.1)
    source = made.source
    assert source is made.source and len(source.faces) == len(made.vertices)
    assert np.allclose(source.weights.sum(axis=1), 1, atol=1e-6)
    carried = source.transfer(wave.vertices)
    assert np.abs(carried - made.vertices).max() < 0.02
    kept = source.vertices >= 0
    assert (wave.vertices[source.vertices[kept]] == made.vertices[kept]).all()
    labels = source.transfer(np.arange(len(wave.vertices)))
    assert labels.dtype == np.int64 and labels.max() < len(wave.vertices)


def test_a_result_is_measured(ball):
    made = lodsmith.simplify(ball, ratio=0.1, measure=True)
    found = lodsmith.compare(ball, made)
    assert found["rms"] == pytest.approx(made.report["error"]["measured"]["rms"])
    assert found["normal_deviation_deg"] == {"mean": found["normal_mean_deg"], "p95": found["normal_p95_deg"]}
    for wrong in ({"samples": 0}, {"samples": -5}, {"seed": -1}):
        with pytest.raises(ValueError, match="^(samples|seed): a whole number of at least"):
            lodsmith.compare(ball, made, **wrong)
    levels = lodsmith.Progressive(ball)
    for wrong in ({"faces": -3}, {"vertices": -1}, {"error": float("nan")}):
        with pytest.raises(ValueError, match=f"^{next(iter(wrong))}: a number of 0 or more is expected, not "):
            levels.level(**wrong)
    with pytest.raises(lodsmith.InvalidMesh):
        lodsmith.compare(ball, ([[0, 0, 0]], []))


def test_an_error_limit_is_met(ball):
    made = lodsmith.simplify(ball, error="0.5%")
    limit = 0.005 * made.report["error"]["diagonal"]
    assert made.report["error"]["bound"] <= limit
    assert lodsmith.compare(ball, made)["hausdorff"]["symmetric"] <= limit


def test_results_own_their_memory(ball):
    made = lodsmith.simplify(ball, ratio=0.1)
    vertices = made.vertices
    del made
    assert vertices.flags.writeable and np.isfinite(vertices).all()
    vertices[0] = 5


def test_numbers_of_64_bits_are_exact_where_a_vertex_is_kept(ball):
    n = len(ball.vertices)
    # Geographic coordinates, times in seconds since 1970, and numbers of very different magnitudes.
    attributes = {
        "north": 4_649_776.22 + 100 * ball.vertices[:, 0],
        "time": 1.7e9 + 0.001 * np.arange(n),
        "size": 10.0 ** np.linspace(-200, 200, n),
    }
    made = lodsmith.simplify(ball.vertices, ball.faces, attributes=attributes, ratio=0.2, placement="endpoint")
    rows = made.source.vertices
    assert (rows >= 0).all()
    for name, values in attributes.items():
        assert made.attributes[name].dtype == np.float64 and (made.attributes[name] == values[rows]).all(), name
    assert list(made.attributes) == list(attributes)


def test_numbers_of_64_bits_are_interpolated_where_a_vertex_moves(ball):
    north, time = 4_649_776.22 + 100 * ball.vertices[:, 0], 1.7e9 + 1000 * ball.vertices[:, 1]
    small = {"x": 100 * ball.vertices[:, 0], "y": 1000 * ball.vertices[:, 1]}
    made = lodsmith.simplify(ball.vertices, ball.faces, attributes={"north": north, "time": time}, ratio=0.1)
    plain = lodsmith.simplify(ball.vertices, ball.faces, attributes=small, ratio=0.1)
    assert (made.source.vertices < 0).any()
    # As exact as the same numbers minus an offset.
    assert np.abs(made.attributes["north"] - 4_649_776.22 - 100 * made.vertices[:, 0]).max() < 2
    assert np.abs(plain.attributes["x"] - 100 * plain.vertices[:, 0]).max() < 2
    assert np.abs(made.attributes["time"] - 1.7e9 - 1000 * made.vertices[:, 1]).max() < 20
    levels = lodsmith.lod(ball.vertices, ball.faces, attributes={"time": time}, levels=[0.5, 0.1])
    for level in levels + [lodsmith.Progressive(ball.vertices, ball.faces, attributes={"time": time}).level(faces=512)]:
        kept = level.source.vertices >= 0
        assert (level.attributes["time"][kept] == time[level.source.vertices[kept]]).all()
    carried = made.source.transfer(time)
    assert np.abs(carried - 1.7e9 - 1000 * made.vertices[:, 1]).max() < 20


def test_texture_coordinates_of_64_bits_are_exact_where_a_vertex_is_kept(ball):
    uvs = np.pi * ball.vertices[:, :2]
    made = lodsmith.simplify(ball.vertices, ball.faces, attributes={"uvs": uvs}, ratio=0.2, placement="endpoint")
    assert (made.uvs == uvs[made.source.vertices]).all()


def test_large_integers_are_exact(ball, tmp_path):
    n = len(ball.vertices)
    attributes = {
        "id": np.arange(n, dtype=np.int64) + (1 << 60),
        "hash": np.arange(n, dtype=np.uint64) * 0x9E3779B97F4A7C15 // 3,
        "node": np.arange(n, dtype=np.int32) + (1 << 30),
        "small": np.arange(n, dtype=np.int16),
    }
    given = lodsmith.Mesh(ball.vertices, ball.faces, attributes)
    for made in (
        lodsmith.simplify(given, ratio=0.1),
        lodsmith.lod(given, levels=[0.1])[0],
        lodsmith.Progressive(given).level(faces=512),
        lodsmith.clean(given),
    ):
        row = made.attributes["id"] - (1 << 60)
        # The value of a nearby row of the original.
        away = np.linalg.norm(ball.vertices[row] - made.vertices, axis=1)
        assert list(made.attributes) == list(attributes) and away.max() < 0.15
        for name in ("hash", "node"):
            assert made.attributes[name].dtype == attributes[name].dtype
            assert (made.attributes[name] == attributes[name][row]).all()
    assert lodsmith.compare(given, given)["hausdorff"]["symmetric"] < 1e-7
    with pytest.warns(lodsmith.LodsmithWarning, match="does not have id, hash, node: integers above 16,777,216"):
        given.save(tmp_path / "ball.ply")


def test_a_source_map_does_not_scale_large_numbers_and_leaves_missing_ones(ball):
    made = lodsmith.simplify(ball, ratio=0.1)
    assert np.abs(made.source.transfer(np.full(len(ball.vertices), 1.7e9)) - 1.7e9).max() == 0
    heat = ball.vertices[:, 2].copy()
    heat[::7] = np.nan
    carried = made.source.transfer(heat)
    is_missing = np.isnan(carried)
    assert 0 < is_missing.mean() < 0.3
    assert np.abs(carried[~is_missing] - made.vertices[~is_missing, 2]).max() < 0.15


def test_missing_values_stay_missing_and_do_not_count(ball):
    heat = ball.vertices[:, 2].copy()
    full = lodsmith.simplify(ball.vertices, ball.faces, attributes={"heat": heat}, ratio=0.1)
    heat[::7] = np.nan
    made = lodsmith.simplify(ball.vertices, ball.faces, attributes={"heat": heat}, ratio=0.1)
    levels = lodsmith.lod(ball.vertices, ball.faces, attributes={"heat": heat}, levels=[0.2, 0.1])
    for mesh in (made, levels[1]):
        values = np.asarray(mesh.attributes["heat"])
        is_missing = np.isnan(values)
        assert 0 < is_missing.mean() < 0.4
        assert np.abs(values[~is_missing] - np.asarray(mesh.vertices)[~is_missing, 2]).max() < 0.03
    rms = [lodsmith.compare(ball, mesh)["rms"]["symmetric"] for mesh in (full, made)]
    assert rms[1] < 1.2 * rms[0]
