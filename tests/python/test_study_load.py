# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes from mesh files, and what is said about bad ones."""

from __future__ import annotations

import builtins
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.study.load import LoadError, load_mesh_file
from study_samples import grid_of_boxes

TRIANGLE = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACE = np.uint32([[0, 1, 2]])


def test_npz_keeps_its_arrays(tmp_path: Path) -> None:
    vertices, triangles = grid_of_boxes()
    np.savez(tmp_path / "boxes.npz", vertices=vertices, triangles=triangles)
    scene = load_mesh_file(tmp_path / "boxes.npz")
    assert (scene.vertices == vertices).all() and (scene.triangles == triangles).all()
    assert (scene.name, scene.geometry) == ("boxes", "mesh file")
    assert (scene.world.color, scene.world.texture) == ((1.0, 1.0, 1.0), None)
    assert (scene.uvs, scene.normals, scene.textures) == (None, None, [])
    assert len(scene.cameras) == 3 and not scene.lights and len(scene.materials) == 1
    assert len(scene.notes) == 1 and "three cameras" in scene.notes[0]


def test_rounding_to_float32_is_said(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", vertices=TRIANGLE.astype(np.float64) + 0.1, triangles=FACE)
    assert "rounded from float64" in load_mesh_file(tmp_path / "a.npz").notes[-1]
    np.savez(tmp_path / "b.npz", vertices=TRIANGLE.astype(np.float64), triangles=FACE)
    assert len(load_mesh_file(tmp_path / "b.npz").notes) == 1


def test_obj_keeps_the_order_of_its_vertices(tmp_path: Path) -> None:
    path = tmp_path / "two.OBJ"
    path.write_text("v 5 5 5\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nf 2 3 4\nf 5 4 1\n")
    scene = load_mesh_file(path)
    assert scene.vertices[0].tolist() == [5, 5, 5] and len(scene.vertices) == 5
    assert scene.triangles.tolist() == [[1, 2, 3], [4, 3, 0]]


def test_ply_is_read(tmp_path: Path) -> None:
    path = tmp_path / "one.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    scene = load_mesh_file(path)
    assert scene.vertices.tolist() == TRIANGLE.tolist() and scene.triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"points": TRIANGLE}, "has no array 'vertices'; its arrays: points"),
        ({"vertices": TRIANGLE}, "has no array 'triangles'; its arrays: vertices"),
        ({"vertices": TRIANGLE[:, :2], "triangles": FACE}, r"vertices has shape \(3, 2\)"),
        ({"vertices": TRIANGLE, "triangles": FACE[0]}, r"triangles has shape \(3,\)"),
        ({"vertices": FACE, "triangles": FACE}, "vertices has dtype uint32, not floats"),
        (
            {"vertices": TRIANGLE, "triangles": TRIANGLE},
            "triangles has dtype float32, not int",
        ),
        ({"vertices": TRIANGLE, "triangles": FACE[:0]}, "has no triangles"),
        ({"vertices": TRIANGLE, "triangles": FACE + 1}, r"triangle 0 is \[1, 2, 3\], but vertices"),
        (
            {"vertices": TRIANGLE, "triangles": np.int64([[0, -1, 2]])},
            r"triangle 0 is \[0, -1, 2\]",
        ),
        ({"vertices": TRIANGLE * [np.nan, 1, 1], "triangles": FACE}, "vertex 0 is not finite"),
        ({"vertices": np.array([[{}] * 3]), "triangles": FACE}, "is not a readable .npz file"),
    ],
)
def test_bad_arrays_are_named(tmp_path: Path, arrays: dict[str, Any], said: str) -> None:
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(LoadError, match=rf"^{tmp_path}/bad.npz.*{said}"):
        load_mesh_file(tmp_path / "bad.npz")


@pytest.mark.parametrize("name", ["a.npz", "a.obj", "a.ply"])
@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 broken", b"ply\nformat\n"])
def test_broken_files_are_named(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(LoadError, match=rf"{name} (is not a readable|has no triangles)"):
        load_mesh_file(tmp_path / name)


def test_truncated_npz_is_named(tmp_path: Path) -> None:
    path = tmp_path / "boxes.npz"
    np.savez_compressed(path, vertices=grid_of_boxes()[0], triangles=grid_of_boxes()[1])
    whole = path.read_bytes()
    path.write_bytes(whole[:100] + b"\0" * 200 + whole[300:])
    with pytest.raises(LoadError, match=r"is not a readable \.npz file"):
        load_mesh_file(path)


def test_npz_that_promises_more_than_it_holds_is_named(tmp_path: Path) -> None:
    path = tmp_path / "huge.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name, shape, kind in (("vertices", (10**15, 3), "<f4"), ("triangles", (1, 3), "<u4")):
            with archive.open(f"{name}.npy", "w") as file:
                header = {"descr": kind, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, header)
                file.write(FACE.tobytes())
    with pytest.raises(LoadError, match=r"vertices has shape \(10{15}, 3\), but the file ends"):
        load_mesh_file(path)


def test_npz_larger_than_memory_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez_compressed(tmp_path / "a.npz", vertices=TRIANGLE, triangles=np.tile(FACE, (9999, 1)))
    monkeypatch.setattr("bvh_lab.study.load.free_bytes", lambda: 1e5)
    with pytest.raises(LoadError, match=r"triangles needs .* GiB, more than is free"):
        load_mesh_file(tmp_path / "a.npz")


def test_npz_of_an_unknown_compression_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, vertices=TRIANGLE, triangles=FACE)
    stored, unknown = rb"([\x14\x2d]\0\0\0)\0\0", b"\\1\x63\0"  # in the headers of the archive
    path.write_bytes(re.sub(stored, unknown, path.read_bytes()))
    with pytest.raises(LoadError, match=r"is not a readable \.npz file: .*compression"):
        load_mesh_file(path)


@pytest.mark.parametrize("coordinate", [2e37, -1e39, 1e300])
def test_coordinates_that_are_too_large_are_named(tmp_path: Path, coordinate: float) -> None:
    vertices = TRIANGLE.astype(np.float64)
    vertices[1, 0] = coordinate
    np.savez(tmp_path / "far.npz", vertices=vertices, triangles=FACE)
    with pytest.raises(LoadError, match=r"vertex 1 is .*: coordinates must be at most 1e\+37"):
        load_mesh_file(tmp_path / "far.npz")


def test_files_of_other_kinds_are_named(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="there is no file"):
        load_mesh_file(tmp_path / "none.npz")
    (tmp_path / "a.stl").touch()
    with pytest.raises(LoadError, match=r"a.stl is none of .npz, .obj, .ply"):
        load_mesh_file(tmp_path / "a.stl")


def test_missing_trimesh_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without_trimesh(name: str, *rest: Any) -> Any:
        if name == "trimesh":
            raise ImportError(name)
        return real(name, *rest)

    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    monkeypatch.setattr(builtins, "__import__", without_trimesh)
    with pytest.raises(LoadError, match=r"reading .*a.obj needs the Python package trimesh"):
        load_mesh_file(tmp_path / "a.obj")
