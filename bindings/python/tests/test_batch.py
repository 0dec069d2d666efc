"""Batches through Ray Data on a local cluster. The large run is bench_batch.py."""

import collections
import os
import pathlib
import subprocess
import sys

import lodsmith
import numpy as np
import pytest

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")
fs = pytest.importorskip("pyarrow.fs")
parquet = pytest.importorskip("pyarrow.parquet")

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import bench_batch
from lodsmith import batch

LEVELS = bench_batch.LEVELS
WORDS = ["--levels", ",".join(map(str, LEVELS))]


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init(num_cpus=2, log_to_driver=False, include_dashboard=False)
    yield
    ray.shutdown()


@pytest.fixture(scope="module")
def assets(tmp_path_factory):
    """Twelve assets in three formats, two of them truncated."""
    folder = tmp_path_factory.mktemp("assets")
    return folder, bench_batch.make(folder, 12, seed=3, bad=2)


def by_asset(table):
    rows = collections.defaultdict(list)
    for row in table.to_pylist():
        rows[row["input"]].append(row)
    return rows


def test_levels_and_report(assets, tmp_path, program):
    folder, names = assets
    out, other = tmp_path / "batch", tmp_path / "plain"
    table = batch.run(folder, out, levels=LEVELS)
    rows = by_asset(table)
    assert sorted(rows) == sorted(names)
    for name in names[:10]:
        assert [row["level"] for row in rows[name]] == [1, 2, 3]
        assert all(row["failure"] is None and row["state"] == "made" and row["attempt"] == 1 for row in rows[name])
        counts = [row["faces_before"] for row in rows[name][:1]] + [row["faces_after"] for row in rows[name]]
        assert counts == sorted(counts, reverse=True)
        assert all((out / row["output"]).is_file() for row in rows[name])
    # A bad file is a row with its error, and leaves nothing behind.
    for name in names[10:]:
        (row,) = rows[name]
        assert row["failure"] and row["level"] is None and row["state"] == "failed"
        assert not (out / name).exists()
    assert parquet.read_table(out / "report.parquet").to_pylist() == table.to_pylist()
    # The files have the same bytes as from the command.
    failed = bench_batch.plain(folder, other, program, WORDS, 2)
    assert sorted(failed) == sorted(names[10:])
    assert bench_batch.files(out) == bench_batch.files(other)


def test_complete_results_are_kept(assets, tmp_path):
    folder, names = assets
    out = tmp_path / "out"
    first = batch.run(folder, out, names=names[:4], levels=LEVELS)
    before = bench_batch.files(out)
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*.*") if ".lodsmith" not in path.parts}
    # One output is missing: only its asset is made again.
    gone = by_asset(first)[names[1]][0]["output"]
    (out / gone).unlink()
    again = batch.run(folder, out, names=names[:4], levels=LEVELS)
    states = {name: rows[0]["state"] for name, rows in by_asset(again).items()}
    assert states == {name: "made" if name == names[1] else "kept" for name in names[:4]}
    assert bench_batch.files(out) == before
    kept = [path for path in times if names[1] not in str(path) and path.name != "report.parquet"]
    assert kept and all(path.stat().st_mtime_ns == times[path] for path in kept)
    # Other options need new results.
    other = batch.run(folder, out, names=names[:1], levels=[0.3])
    assert {row["state"] for row in other.to_pylist()} == {"made"}
    assert sorted(p.name for p in (out / names[0]).iterdir()) == sorted(
        ["lods.json", *(f"asset00000_lod{k}.ply" for k in (0, 1))]
    )


def test_a_killed_worker_loses_nothing(assets, tmp_path):
    folder = tmp_path / "in"
    names = bench_batch.make(folder, 60, seed=5)
    out = tmp_path / "out"
    killer = bench_batch.Killer(out, 20)
    killer.start()
    table = batch.run(folder, out, levels=LEVELS)
    killer.ended = True
    killer.join()
    assert killer.at is not None and killer.at < 60
    seen = collections.Counter((row["input"], row["level"]) for row in table.to_pylist())
    assert seen == {(name, level): 1 for name in names for level in (1, 2, 3)}
    assert table.column("failure").null_count == len(table)
    assert all((out / row["output"]).is_file() for row in table.to_pylist())
    leftover = out / ".lodsmith" / "parts"
    assert not leftover.exists() or len(list(leftover.iterdir())) <= 2


def test_other_file_systems(assets, tmp_path):
    # The package does not treat a part of a file system as local: assets and results are copied.
    folder, names = assets
    store = fs.SubTreeFileSystem(str(tmp_path), fs.LocalFileSystem())
    table = batch.run(f"file://{folder}", "results", names=names[:3], output_filesystem=store, levels=[0.5])
    assert table.column("failure").null_count == 3
    assert all((tmp_path / "results" / row["output"]).is_file() for row in table.to_pylist())
    source = fs.SubTreeFileSystem(str(folder), fs.LocalFileSystem())
    again = batch.run("", tmp_path / "others", names=names[:3], filesystem=source, output_filesystem=fs.LocalFileSystem(), levels=[0.5])
    assert again.column("failure").null_count == 3


def test_a_model_with_files_beside_it(tmp_path):
    source, out = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    lodsmith.icosphere(3).save(source / "ball.obj")
    text = (source / "ball.obj").read_text()
    (source / "ball.obj").write_text("mtllib parts/red.mtl\nusemtl red\n" + text)
    (source / "parts").mkdir()
    (source / "parts" / "red.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (source / "parts" / "other.mtl").write_text("newmtl other\n")
    # The package does not treat this file system as local: files that the model refers to are copied with it.
    store = fs.SubTreeFileSystem(str(source), fs.LocalFileSystem())

    def run():
        return batch.run("", out, filesystem=store, output_filesystem=fs.LocalFileSystem(), levels=[0.5], to="glb").to_pylist()

    (row,) = run()
    assert row["failure"] is None and row["state"] == "made" and not any("mtl" in text for text in row["warnings"])
    assert b'"baseColorFactor":[1' in (out / row["output"]).read_bytes().replace(b" ", b"")
    # If a file that it refers to changes, the model is new.
    assert run()[0]["state"] == "kept"
    (source / "parts" / "red.mtl").write_text("newmtl red\nKd 0 1 0\n")
    assert run()[0]["state"] == "made"


def test_wrong_options_are_errors_before_any_work(assets, tmp_path):
    with pytest.raises(lodsmith.CommandError, match="levels"):
        batch.run(assets[0], tmp_path / "out", levels=[2])
    assert not (tmp_path / "out" / "report.parquet").exists()


def test_a_command_line_in_any_order_is_checked_before_ray_starts(assets, tmp_path, monkeypatch, capsys):
    source, out = str(assets[0]), str(tmp_path / "out")
    seen = []
    monkeypatch.setattr(batch, "_run_of_shell", lambda args, names, options: seen.append((args, names, options)) or 0)
    for words in (
        ["--levels", "0.5,0.2", "--strict", source, out, "--retries", "1"],
        [source, "--retries=1", "--levels=0.5,0.2", out, "--strict"],
        [source, out, "--strict", "--retries", "1", "--levels", "0.5,0.2"],
    ):
        assert batch.main(words) == 0
        args, names, options = seen.pop()
        assert (args.source, args.output, args.retries) == (source, out, 1) and names == sorted(assets[1])
        assert {k: v for k, v in options.items() if v is not None} == {"levels": "0.5,0.2", "strict": True}
    for words, status, text in [
        (["--levels", "2", source, out], 2, "levels: "),
        (["--levls", "0.5", source, out], 2, "--levls is not expected; a similar option is --levels"),
        ([source, out, "another", "--levels", "0.5"], 2, "another is not expected"),
        ([source], 2, "OUT"),
        (["--levels", "0.5", str(tmp_path / "missing"), out], 1, "missing"),
    ]:
        assert batch.main(words) == status and text in capsys.readouterr().err
    assert not seen
    # From Python, too.
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", lambda **_: pytest.fail("Ray was started"))
    with pytest.raises(lodsmith.CommandError, match="levels"):
        batch.run(source, out, levels=[2])
    with pytest.raises(FileNotFoundError):
        batch.run(tmp_path / "missing", out, levels=[0.5])


def test_options_as_words_and_as_values(assets, tmp_path):
    words = ["--levels", "0.5,0.25", "--max-normal=30", "--per-mesh", "--lock", "a", "--lock=b"]
    wanted = {"levels": "0.5,0.25", "max_normal": "30", "per_mesh": True, "lock": ["a", "b"]}
    assert batch.options_of_words(words) == wanted
    for wrong in (["levels"], ["--levels"]):
        with pytest.raises(lodsmith.CommandError, match="expected"):
            batch.options_of_words(wrong)
    # NumPy values and paths are passed to the processes too.
    options = {"levels": np.array([0.5]), "max_normal": np.float32(60), "asset_root": assets[0]}
    table = batch.run(assets[0], tmp_path / "out", names=assets[1][:1], **options)
    assert table.column("failure").null_count == 1


def test_a_time_limit_ends_a_process(assets, tmp_path):
    table = batch.run(assets[0], tmp_path / "out", names=assets[1][:1], levels=LEVELS, timeout=1e-6)
    assert "took longer" in table.to_pylist()[0]["failure"]


def test_the_command_line(assets, tmp_path):
    words = [sys.executable, "-m", "lodsmith.batch", "--levels", "0.5", str(assets[0]), str(tmp_path / "out")]
    environment = {k: v for k, v in os.environ.items() if k != "RAY_ADDRESS"}
    done = subprocess.run(words, capture_output=True, text=True, env=environment)
    assert done.returncode == 1
    assert "12 assets: 10 made, 0 kept, 2 failed" in done.stdout
    assert sum("/asset00011.glb: " in line for line in done.stderr.splitlines()) == 1
