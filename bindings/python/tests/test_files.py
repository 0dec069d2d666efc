"""Files, and the same bytes as the command."""

import pathlib
import subprocess
from types import MappingProxyType

import lodsmith
import numpy as np
import pytest


@pytest.fixture
def files(tmp_path, wave, ball):
    wave.save(tmp_path / "wave.ply")
    ball.save(tmp_path / "ball.obj")
    return tmp_path


@pytest.mark.filterwarnings("ignore:.*glTF stores positions in single precision")
def test_a_mesh_survives_a_file(tmp_path, wave):
    for name in ("wave.ply", "wave.glb", "wave.obj"):
        wave.save(tmp_path / name)
        back = lodsmith.load(tmp_path / name)
        assert back.format == name[-3:] and len(back.faces) == len(wave.faces)
        assert lodsmith.compare(wave, back)["hausdorff"]["symmetric"] < 1e-6
        assert back.uvs is not None and back.normals is not None


@pytest.mark.filterwarnings("ignore:.*glTF stores positions in single precision")
def test_files_are_written_smaller(tmp_path, wave):
    wave.save(tmp_path / "plain.glb")
    with pytest.warns(lodsmith.LodsmithWarning, match="quantization changes"):
        wave.save(tmp_path / "small.glb", compress="meshopt", quantize=True)
    plain, small = (tmp_path / name for name in ("plain.glb", "small.glb"))
    assert small.stat().st_size < plain.stat().st_size / 2
    assert len(lodsmith.load(small).faces) == len(wave.faces)
    with pytest.warns(lodsmith.LodsmithWarning, match="PLY is neither compressed nor quantized"):
        wave.save(tmp_path / "wave.ply", quantize=True)
    with pytest.raises(ValueError, match="compress: one of none, meshopt"):
        wave.save(tmp_path / "none.glb", compress="zip")


def test_formats_that_can_be_read():
    assert {"obj", "glb", "3mf", "dae", "fbx"} <= set(lodsmith.FORMATS)


def test_losses_are_warnings(tmp_path, wave):
    with pytest.warns(lodsmith.LodsmithWarning):
        wave.save(tmp_path / "wave.stl")


def test_wrong_files(tmp_path):
    with pytest.raises(FileNotFoundError):
        lodsmith.load(tmp_path / "none.ply")
    (tmp_path / "bad.ply").write_text("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nzero\n")
    with pytest.raises(lodsmith.InvalidMesh, match="bad.ply"):
        lodsmith.load(tmp_path / "bad.ply")
    with pytest.raises(ValueError, match="format: one of obj"):
        lodsmith.load(tmp_path / "bad.ply", format="tla")
    with pytest.raises(OSError):
        lodsmith.icosphere(1).save(tmp_path / "none" / "ball.ply")


@pytest.mark.filterwarnings("ignore:target not reached", "ignore:seams were moved")
def test_a_seam_survives_load_and_simplify(tmp_path):
    # Rows of the same vertex have the same number in the map.
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\nf 1/1 2/2 3/3\nf 2/4 4/1 3/3\n"
    (tmp_path / "seam.obj").write_text(text)
    mesh = lodsmith.load(tmp_path / "seam.obj")
    assert len(mesh.vertices) == 5 and sorted(mesh.vertex_map) == [0, 1, 1, 2, 3]
    # Lists have a value for each row; a vertex is locked if any of its rows is.
    made = lodsmith.simplify(mesh, faces=1, locked=np.arange(5) == 0, attributes=None)
    assert [0, 0, 0] in made.vertices.tolist()


def same_bytes(program, folder, words, options, name):
    out = subprocess.run([program, *words, "-o", f"command_{name}"], cwd=folder, capture_output=True, text=True)
    assert out.returncode == 0, out.stderr
    report = lodsmith.simplify_file(folder / words[1], folder / f"python_{name}", **options)
    assert (folder / f"python_{name}").read_bytes() == (folder / f"command_{name}").read_bytes()
    return report


@pytest.mark.filterwarnings("ignore:.*glTF stores positions in single precision")
def test_whole_files_have_the_bytes_of_the_command(program, files, root):
    report = same_bytes(program, files, ["simplify", "wave.ply", "--ratio=0.1"], {"ratio": 0.1}, "low.ply")
    assert report["reached"] and report["output"]["faces"] <= 0.1 * report["input"]["faces"]
    same_bytes(
        program,
        files,
        ["simplify", "wave.ply", "--error=0.1%", "--weight=uv=2", "--weight=color=0.5", "--border=slide", "--measure"],
        {"error": "0.1%", "weight": {"uv": 2, "color": 0.5}, "border": "slide", "measure": True},
        "low.glb",
    )
    same_bytes(program, files, ["simplify", "ball.obj", "--faces=300"], {"faces": 300}, "low.stl")


def test_arrays_have_the_geometry_of_the_command(program, files):
    words = [program, "simplify", "wave.ply", "--ratio=0.1", "-o", "command.ply"]
    subprocess.run(words, cwd=files, check=True, capture_output=True)
    lodsmith.simplify(lodsmith.load(files / "wave.ply"), ratio=0.1).save(files / "python.ply")
    assert (files / "python.ply").read_bytes() == (files / "command.ply").read_bytes()


@pytest.mark.filterwarnings("ignore:.*(PLY has one set of attributes|seams were moved)")
def test_errors_of_the_command_are_exceptions(files):
    low = files / "low.ply"
    with pytest.raises(TypeError, match="there is no option rato; a similar one is ratio"):
        lodsmith.simplify_file(files / "wave.ply", low, rato=0.1)
    with pytest.raises(lodsmith.CommandError, match=r"^give a target \(faces, vertices, ratio, error\)") as info:
        lodsmith.simplify_file(files / "wave.ply", low)
    assert info.value.status == 2
    with pytest.raises(lodsmith.CommandError, match="none.ply") as info:
        lodsmith.simplify_file(files / "none.ply", low, ratio=0.1)
    assert info.value.status == 1 and isinstance(info.value, ValueError)
    with pytest.raises(lodsmith.CommandError) as info:
        lodsmith.simplify_file(files / "wave.ply", low, faces=2, border="lock", topology="preserve", strict=True)
    assert info.value.status == 3 and info.value.report["reached"] is False
    with pytest.warns(lodsmith.LodsmithWarning, match="target not reached"):
        lodsmith.simplify_file(files / "wave.ply", low, faces=2, border="lock", topology="preserve")


@pytest.mark.filterwarnings("ignore:.*glTF stores positions in single precision")
def test_values_of_options(files):
    def faces(**options):
        return lodsmith.simplify_file(files / "ball.obj", files / "low.glb", **options)["output"]["faces"]

    assert faces(faces=np.int64(100), threads=np.int32(1), quantize=np.False_, asset_root=files) == 100
    assert faces(ratio=np.float32(0.5), weight=MappingProxyType({"normal": np.float32(2)}), max_memory="1G") == 2560
    # Not given.
    assert faces(ratio=0.5, border=None, bake=None, lock=None, per_mesh=None, map_files=False, strict=False) == 2560
    made = lodsmith.lod_file(files / "ball.obj", out_dir=files / "levels", levels=np.array([0.5, 0.25]))
    assert [level["faces"] for level in made["levels"]] == [2560, 1280]
    with pytest.raises(ValueError, match="^ratio: a value of type .* is not taken$"):
        faces(ratio=object())
    with pytest.raises(lodsmith.CommandError, match='^ratio: a fraction .*"NaN"$'):
        faces(ratio=float("nan"))


def test_messages_name_keywords(files):
    ball, low = files / "ball.obj", files / "low.ply"
    for options, text in [
        ({"edge_length": 0.1}, "ball.obj: edge_length is not an option of method memoryless"),
        ({"max_edge": "5 m"}, "^max_edge: a length"),
        ({"max_memory": "1M"}, "^max_memory: "),
        ({"texture_size": 64}, "^texture_size: "),
    ]:
        with pytest.raises(lodsmith.CommandError, match=text) as info:
            lodsmith.simplify_file(ball, low, ratio=0.5, **options)
        assert (info.value.status, info.value.report) == (2, None)
    with pytest.raises(OSError, match="^low: .* set the format with format=$"):
        lodsmith.icosphere(1).save("low")
    with pytest.warns(lodsmith.LodsmithWarning, match=r"a higher max_normal \(now 1\) would go further"):
        lodsmith.simplify_file(ball, low, faces=10, max_normal=1)
    for places in [{}, {"output": files / "low.glb", "out_dir": files / "levels"}]:
        with pytest.raises(lodsmith.CommandError, match="give one output"):
            lodsmith.lod_file(ball, levels=[0.5], **places)
    assert lodsmith.lod_file(ball, levels=[0.5], dry_run=True)["levels"][0]["faces"] == 2560


def test_names_that_look_like_options(tmp_path, ball, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball.save("-ball.ply")
    lodsmith.simplify_file("-ball.ply", "--low.ply", ratio=0.1)
    assert len(lodsmith.load("--low.ply").faces) == 512


def test_nothing_is_printed(files, capfd):
    lodsmith.simplify_file(files / "wave.ply", files / "low.ply", ratio=0.1)
    lodsmith.info(files / "wave.ply")
    with pytest.raises(lodsmith.CommandError):
        lodsmith.info(files / "none.ply")
    assert capfd.readouterr() == ("", "")


def test_progress_of_a_file(files):
    lodsmith.icosphere(8).save(files / "large.ply")
    seen = []
    lodsmith.simplify_file(files / "large.ply", files / "low.ply", ratio=0.02, progress=lambda d, s: seen.append(d))
    assert seen == sorted(seen) and len(seen) > 3 and seen[-1] == 1.0


@pytest.mark.filterwarnings("ignore:.*glTF stores positions in single precision")
def test_levels_conversion_repair_and_information(files):
    made = lodsmith.lod_file(files / "ball.obj", files / "levels.glb", levels=[0.5, 0.25])
    assert (files / "levels.glb").exists() and len(made["levels"]) == 2
    lodsmith.lod_file(files / "ball.obj", out_dir=files / "levels", count=2)
    assert (files / "levels" / "lods.json").exists()
    lodsmith.convert(files / "ball.obj", files / "ball.ply", scale=2.0)
    about = lodsmith.info(files / "ball.ply")
    assert about["closed"] and about["bounds"]["max"][2] == pytest.approx(2, rel=0.01)
    mine = lodsmith.info(lodsmith.load(files / "ball.ply"))
    assert mine == {key: about[key] for key in mine}
    assert lodsmith.clean_file(files / "ball.obj", files / "clean.ply")["output"]["faces"] == 5120


def test_levels_of_a_mesh(ball):
    levels = lodsmith.lod(ball, count=3, factor=0.5, geomorph=True)
    assert [len(level.faces) for level in levels] == [2560, 1280, 640]
    distances = [level.distance for level in levels]
    assert distances == sorted(distances) and distances[0] > 0
    assert levels[0].geomorph.shape == levels[0].vertices.shape and levels[-1].geomorph is None
    assert np.abs(np.linalg.norm(levels[0].geomorph, axis=1) - 1).max() < 0.05
    for wrong in [{}, {"levels": [0.5], "count": 2}, {"levels": [0.1, 0.5]}, {"levels": [0.5], "fov": 200}]:
        with pytest.raises(ValueError):
            lodsmith.lod(ball, **wrong)
    with pytest.raises(TypeError):
        lodsmith.lod(ball, ratio=0.5)
    with pytest.warns(lodsmith.LodsmithWarning, match="^level 2: target not reached, stopped by refusals") as caught:
        lodsmith.lod(ball, levels=[0.5, 0.01], max_normal=5, topology="preserve")
    assert len(caught) == 1


def test_a_progressive_mesh_has_every_level(ball, tmp_path):
    mesh = lodsmith.Progressive(ball)
    for n in (50, 1000, 200, 5120):
        assert len(mesh.level(faces=n).faces) == n
    full = mesh[-1]
    assert (full.vertices == ball.vertices).all() and (full.faces == ball.faces).all()
    assert full.faces.dtype == ball.faces.dtype
    errors = [mesh.level(faces=n).report["error"]["estimate"] for n in (2000, 500, 100)]
    assert errors == sorted(errors)
    assert len(mesh.level(error=errors[1]).faces) <= 510
    mesh.save(tmp_path / "ball.lpm")
    back = lodsmith.Progressive.load(tmp_path / "ball.lpm")
    # Splits are stored exactly; moves of the fit are rounded.
    recorded = [m.level(faces=300, fit=False).vertices for m in (back, mesh)]
    assert len(back) == len(mesh) and (recorded[0] == recorded[1]).all()
    assert np.abs(back.level(faces=300).vertices - mesh.level(faces=300).vertices).max() < 1e-3
    with pytest.raises(IndexError):
        mesh[len(mesh)]
    with pytest.raises(TypeError):
        mesh.level(3, faces=5)


def test_repair(ball):
    faces = np.concatenate([ball.faces, ball.faces[:7], ball.faces[:3, ::-1] * 0])
    made = lodsmith.clean(ball.vertices, faces)
    assert made.report["duplicate_faces"] == 7 and made.report["degenerate_faces"] == 3
    assert made.report["done"]["duplicate_faces"] == 7 and made.report["left"] == made.report["remaining"]
    assert len(made.faces) == len(ball.faces) and made.report["remaining"]["border_edges"] == 0
    with pytest.raises(ValueError, match="non_manifold: one of keep"):
        lodsmith.clean(ball, non_manifold="burn")


def test_pictures(ball, wave, files):
    picture = lodsmith.render(ball, size=(120, 80))
    assert picture.shape == (80, 120, 4) and picture.dtype == np.uint8 and picture.std() > 10
    assert picture._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    assert (lodsmith.render(ball, size=(120, 80)) == picture).all()
    assert (lodsmith.render(ball, size=(120, 80), wireframe=True) != picture).any()
    clear = lodsmith.render(ball, size=(40, 40), transparent=True)
    assert clear[0, 0, 3] == 0 and clear[20, 20, 3] == 255
    heat = lodsmith.render(wave, size=(40, 40), heat=wave.vertices[:, 0], colors="viridis")
    assert (heat != lodsmith.render(wave, size=(40, 40))).any()
    of_file = lodsmith.render(files / "wave.ply", size=(64, 48), view="top")
    assert of_file.shape == (48, 64, 4)
    picture.save(files / "ball.png")
    assert pathlib.Path(files / "ball.png").stat().st_size > 500
    assert "image/png" in ball._repr_mimebundle_()
    with pytest.raises(TypeError, match="save"):
        lodsmith.render(files / "wave.ply", files / "wave.png")
    unit = np.asarray(ball.vertices, np.float32)
    z_up = lodsmith.Mesh(unit, ball.faces, {"normals": unit})
    turned = unit[:, [0, 2, 1]] * np.float32([1, 1, -1])
    y_up = lodsmith.Mesh(turned, ball.faces, {"normals": turned})
    drawn = [lodsmith.render(z_up, size=(80, 80), up="z"), lodsmith.render(y_up, size=(80, 80))]
    # (The rotation of a mesh is rounded.)
    assert np.abs(np.diff(np.int16(drawn), axis=0)).max() <= 1
    for wrong in [{"view": "inside"}, {"size": (0, 10)}, {"heat": [1, 2]}, {"shading": "heat"}, {"up": "x"}]:
        with pytest.raises(ValueError):
            lodsmith.render(ball, **wrong)


def test_a_mesh_has_the_picture_of_its_file(files):
    corners = np.float32([[0, 0, 0], [5, 0, 0], [0, 2, 0], [1, 0, 0.5]])
    fin = lodsmith.Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    fin.save(files / "fin.ply")
    seen = set()
    views = [{}, {"up": "z"}, {"azimuth": 200}, {"elevation": 60, "color": (1, 0.3, 0)}, {"view": "left", "fine": True}]
    for options in views:
        of_mesh, of_file = (lodsmith.render(what, size=(96, 64), **options) for what in (fin, files / "fin.ply"))
        assert (of_mesh == of_file).all(), options
        seen.add(of_file.tobytes())
    assert len(seen) == len(views)


def test_images_of_files_have_the_bytes_of_the_command(program, files, root):
    arm = str(root / "testdata" / "arm.glb")

    def same(words, path, **options):
        run = subprocess.run([program, "render", *words, "-o", "command.png"], cwd=files, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        assert lodsmith.render(path, **options).to_png() == (files / "command.png").read_bytes(), words

    small = ["--size=64x48"]
    same(["wave.ply", *small], files / "wave.ply", size=(64, 48))
    same(
        [arm, *small, "--azimuth=-20", "--time=0.5", "--shadow", "--color=#ff8000", "--light=sun:1,0,0", "--light=point:1,2,3"],
        arm,
        size=(64, 48),
        azimuth=-20,
        time=0.5,
        shadow=True,
        color=(1, 0.5, 0),
        light=["sun:1,0,0", "point:1,2,3"],
    )
    same(
        ["wave.ply", *small, "--levels=500,90", "--shading=heat", "--range=0,0.5", "--colors=viridis", "--fine", "--up=z"],
        files / "wave.ply",
        size=(64, 48),
        levels=[500, 90],
        shading="heat",
        range=(0, 0.5),
        colors="viridis",
        fine=True,
        up="z",
    )
    same(
        ["wave.ply", *small, "--compare", "ball.obj", "--background=transparent", "--no-captions", "--threads=1"],
        files / "wave.ply",
        size=(64, 48),
        compare=files / "ball.obj",
        transparent=True,
        no_captions=True,
        threads=1,
    )


def test_wrong_options_of_images_are_refused(files):
    for options, status, text in [
        ({"shading": "heat"}, 2, "^shading heat shows distances from a reference: add compare or levels$"),
        ({"time": 1}, 2, "wave.ply: has no animation"),
        ({"size": (0, 9)}, 2, "^size: a size is WxH"),
        ({"matcap": "none.png"}, 1, "^none.png: "),
        ({"levels": [9], "compare": "a.ply"}, 2, "^only one of levels and compare may be given"),
        ({"fps": 5}, 2, "^fps: it needs turntable"),
    ]:
        with pytest.raises(lodsmith.CommandError, match=text) as info:
            lodsmith.render(files / "wave.ply", **options)
        assert info.value.status == status
    with pytest.raises(lodsmith.CommandError, match="none.ply: cannot read") as info:
        lodsmith.render(files / "none.ply")
    assert info.value.status == 1
    with pytest.raises(TypeError, match="no option wirefram; a similar one is wireframe"):
        lodsmith.render(files / "wave.ply", wirefram=True)


def test_calls_in_threads_are_independent(files):
    import threading

    reports = [None] * 4

    def work(i):
        reports[i] = lodsmith.simplify_file(files / "wave.ply", files / f"low{i}.ply", ratio=0.1 * (i + 1))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    [t.start() for t in threads]
    [t.join() for t in threads]
    assert [r["output"]["path"][-8:] for r in reports] == [f"low{i}.ply" for i in range(4)]
    faces = [r["output"]["faces"] for r in reports]
    assert faces == sorted(faces) and faces[0] < faces[3]
