# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes from mesh files: .npz by numpy, .obj and .ply by trimesh."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .framing import auto_cameras
from .machine import free_bytes
from .scene import Material, Scene, World

SUFFIXES = (".npz", ".obj", ".ply")
LARGEST_COORDINATE = 1e37  # that core.Mesh takes


class LoadError(ValueError):
    """A file holds no scene that can be measured: one sentence with the file and why."""


def load_mesh_file(path: Path, up: Literal["y", "z"] = "z") -> Scene:
    """The mesh in a .npz, .obj or .ply file, with three cameras around it and a white world.

    A .npz holds ``vertices`` (V, 3) floats and ``triangles`` (T, 3) integers. Vertices and
    triangles keep their order. ``up`` is the axis that points up in the pictures. Raises LoadError.
    """
    if not path.is_file():
        raise LoadError(f"there is no file {path}")
    if path.suffix.lower() not in SUFFIXES:
        raise LoadError(f"{path} is none of {', '.join(SUFFIXES)}")
    read = _read_npz if path.suffix.lower() == ".npz" else _read_with_trimesh
    vertices, triangles = read(path)
    notes = [
        "A mesh file has no camera, light or material: three cameras look at it from outside, in a "
        f"white world, {up.upper()} up, and all of it is grey.",
    ]
    _check(path, vertices, triangles)
    given = vertices
    with np.errstate(over="ignore"):
        vertices = vertices.astype(np.float32)
    _check_size(path, vertices)
    if (vertices != given).any():
        notes.append(f"Vertices were rounded from {given.dtype} to float32.")
    return Scene(
        name=path.stem,
        vertices=np.ascontiguousarray(vertices),
        triangles=np.ascontiguousarray(triangles, dtype=np.uint32),
        material_index=np.zeros(len(triangles), dtype=np.uint32),
        materials=[Material("grey")],
        cameras=auto_cameras(vertices[np.unique(triangles)], 3, up),
        lights=[],
        world=World((1.0, 1.0, 1.0)),
        geometry="mesh file",
        source=str(path),
        notes=notes,
    )


def _read_npz(path: Path) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    try:
        _check_promises(path)
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in ("vertices", "triangles") if name in file}
            there = ", ".join(file) or "none"
    except LoadError:
        raise
    except Exception as error:  # whatever a broken file makes zipfile and numpy raise
        raise _unreadable(path, error) from error
    for name in ("vertices", "triangles"):
        if name not in arrays:
            raise LoadError(f"{path} has no array {name!r}; its arrays: {there}")
    return arrays["vertices"], arrays["triangles"]


def _check_promises(path: Path) -> None:
    """Refuse arrays that promise more than the file holds, or than fits in memory.

    numpy makes room for the whole array before it reads the first number.
    """
    npy: Any = np.lib.format  # its functions have no types
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            if member.filename not in ("vertices.npy", "triangles.npy"):
                continue
            with archive.open(member) as file:
                version = npy.read_magic(file)
                if version == (1, 0):
                    shape, _, dtype = npy.read_array_header_1_0(file)
                else:
                    shape, _, dtype = npy.read_array_header_2_0(file)
                held = member.file_size - file.tell()
            name = member.filename.removesuffix(".npy")
            if not dtype.hasobject and math.prod(shape) * dtype.itemsize > held:
                raise LoadError(f"{path}: {name} has shape {shape}, but the file ends before that")
            if held > free_bytes():
                raise LoadError(f"{path}: {name} needs {held / 2**30:.1f} GiB, more than is free")


def _unreadable(path: Path, error: Exception) -> LoadError:
    lines = str(error).splitlines() or [type(error).__name__]
    return LoadError(f"{path} is not a readable {path.suffix} file: {lines[0][:300]}")


def _read_with_trimesh(path: Path) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    try:
        import trimesh
    except ImportError:
        raise LoadError(
            f"reading {path} needs the Python package trimesh; install it or give a .npz file"
        ) from None
    try:
        mesh: Any = trimesh.load_mesh(path, process=False, skip_materials=True)
    except Exception as error:  # whatever a broken file makes trimesh raise
        raise _unreadable(path, error) from error
    faces = getattr(mesh, "faces", None)
    if faces is None or len(faces) == 0:
        raise LoadError(f"{path} has no triangles")
    return np.asarray(mesh.vertices), np.asarray(faces)


def _check(path: Path, vertices: npt.NDArray[Any], triangles: npt.NDArray[Any]) -> None:
    """Name the first thing wrong with the arrays."""
    for name, array, kinds in (("vertices", vertices, "f"), ("triangles", triangles, "iu")):
        if array.ndim != 2 or array.shape[1] != 3:
            raise LoadError(f"{path}: {name} has shape {array.shape}, not (N, 3)")
        if array.dtype.kind not in kinds:
            wanted = "floats" if kinds == "f" else "integers"
            raise LoadError(f"{path}: {name} has dtype {array.dtype}, not {wanted}")
    if len(triangles) == 0:
        raise LoadError(f"{path} has no triangles")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise LoadError(f"{path}: vertex {bad[0]} is not finite: {vertices[bad[0]].tolist()}")
    out = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
    if len(out):
        raise LoadError(
            f"{path}: triangle {out[0]} is {triangles[out[0]].tolist()}, but vertices go from 0 to "
            f"{len(vertices) - 1}"
        )


def _check_size(path: Path, vertices: npt.NDArray[np.float32]) -> None:
    """Name the first vertex that is too far out, once rounded."""
    far = np.flatnonzero(~(np.abs(vertices) <= np.float32(LARGEST_COORDINATE)).all(axis=1))
    if len(far):
        raise LoadError(
            f"{path}: vertex {far[0]} is {vertices[far[0]].tolist()}: coordinates must be at most "
            f"{LARGEST_COORDINATE:g} in size"
        )
