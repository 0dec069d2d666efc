"""Examples, stubs and the notebook are correct."""

import doctest
import importlib
import pathlib
import pkgutil
import re
import subprocess
import sys

import lodsmith
import pytest

HERE = pathlib.Path(__file__).resolve().parents[1]


def test_examples_in_docstrings():
    names = [f"lodsmith.{m.name}" for m in pkgutil.iter_modules(lodsmith.__path__) if m.name != "_lodsmith"]
    results = [doctest.testmod(importlib.import_module(name)) for name in ["lodsmith", *names]]
    assert sum(r.attempted for r in results) >= 15 and not any(r.failed for r in results)


def test_examples_of_the_page(tmp_path, monkeypatch):
    page = HERE.parents[1] / "docs" / "python.md"
    if not page.exists():
        pytest.skip("docs/python.md is missing")
    monkeypatch.chdir(tmp_path)
    result = doctest.testfile(str(page), module_relative=False)
    assert result.attempted >= 10 and result.failed == 0


def test_everything_public_is_documented():
    for name in lodsmith.__all__:
        thing = getattr(lodsmith, name)
        if name != "__version__":
            assert thing.__doc__, name
            assert name in (HERE / "python" / "lodsmith" / "__init__.pyi").read_text(), name


def test_the_stubs_agree_with_the_engine():
    run = subprocess.run([sys.executable, HERE / "stubs.py", "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_types(tmp_path):
    pytest.importorskip("mypy")
    (tmp_path / "use.py").write_text(
        "import lodsmith\n"
        "import numpy as np\n"
        "ball = lodsmith.icosphere(2)\n"
        "reveal_type(lodsmith.simplify(ball.vertices, ball.faces, ratio=0.5))\n"
        "reveal_type(lodsmith.simplify(ball, error='0.1%', method='quadric', progress=True))\n"
        "reveal_type(lodsmith.lod(ball, levels=[0.5])[0].distance)\n"
        "lodsmith.simplify(ball, ratio=0.5, method='quadratic')\n"
        "lodsmith.simplify(ball, rato=0.5)\n"
    )
    run = subprocess.run([sys.executable, "-m", "mypy", "use.py"], cwd=tmp_path, capture_output=True, text=True)
    shown = re.findall(r'use.py:(\d+): note: Revealed type is "([^"]+)"', run.stdout)
    result = "lodsmith._run.Result"
    assert shown == [("4", result), ("5", result), ("6", "float | None")], run.stdout
    assert {int(n) for n in re.findall(r"use.py:(\d+): error", run.stdout)} == {7, 8}, run.stdout


def test_the_notebook_runs(tmp_path):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(HERE / "examples" / "lodsmith.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [out for cell in notebook.cells if cell.cell_type == "code" for out in cell.outputs]
    assert sum("image/png" in out.get("data", {}) for out in outputs) >= 3
    assert not any(out.output_type == "error" for out in outputs)
