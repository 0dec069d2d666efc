import os
import pathlib
import shutil

import lodsmith
import numpy as np
import pytest


@pytest.fixture
def ball():
    return lodsmith.icosphere(4)


@pytest.fixture
def wave():
    """A wavy sheet with texture coordinates, normals and colours."""
    n = 60
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    z = 0.1 * np.sin(6 * x) * np.cos(6 * y)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.column_stack([i, i + 1, i + n]), np.column_stack([i + 1, i + n + 1, i + n])])
    normals = np.column_stack(
        [-0.6 * (np.cos(6 * x) * np.cos(6 * y)).ravel(), 0.6 * (np.sin(6 * x) * np.sin(6 * y)).ravel(), np.ones(n * n)]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uvs = vertices[:, :2].copy()
    colors = np.column_stack([255 * x.ravel(), 255 * y.ravel(), np.full(n * n, 128)]).astype(np.uint8)
    return lodsmith.Mesh(vertices, faces, {"normals": normals, "uvs": uvs, "colors": colors})


@pytest.fixture
def root():
    return pathlib.Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def program():
    found = os.environ.get("LODSMITH") or shutil.which("lodsmith")
    if not found:
        pytest.skip("no command lodsmith: LODSMITH is not set, and the command is not on the path")
    return found
