# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture coordinates: which UV map an image is looked up with, or how an environment is turned."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Euler

from ..study.scene import Float64Array, Mapping
from .nodes import Input, Output, follow

VECTOR_MATH = {"ADD", "SUBTRACT", "MULTIPLY", "SCALE"}


def uv_coordinates(node: Output, lost: set[str]) -> tuple[Mapping, str]:
    """How (u, v, 1) becomes the coordinates of an Image Texture node, and the UV map's name.

    "" is the map that renders.
    """
    start = node.input("Vector")
    if follow(start) == start:
        matrix, layer = np.eye(4), ""
    else:
        matrix, layer = _uv_matrix(start, lost)
    matrix = _own_mapping(node.node) @ matrix
    (a, b, _, c), (d, e, _, f) = matrix[:2].tolist()  # a UV map's third coordinate is 0
    return ((a, b, c), (d, e, f)), layer


def world_rotation(node: Output, lost: set[str]) -> Float64Array:
    """(3, 3): from directions in the world to those of an Environment Texture node."""
    start = node.input("Vector")
    matrix = np.eye(4) if follow(start) == start else _direction_matrix(start, lost)
    matrix = (_own_mapping(node.node) @ matrix)[:3]
    linear = matrix[:, :3]
    size = np.cbrt(abs(np.linalg.det(linear)))
    if size > 0.0:
        linear = linear / size
    if np.abs(linear @ linear.T - np.eye(3)).max() > 1e-5 or np.abs(matrix[:, 3]).max() > 1e-6:
        lost.add("approximated: the environment texture is only turned, not moved or stretched")
        left, _, right = np.linalg.svd(linear)  # the nearest rotation
        linear = left @ right
    return linear


def _uv_matrix(at: Input, lost: set[str]) -> tuple[Float64Array, str]:
    """(4, 4) from (u, v, 0, 1) to the vector at ``at``, and the name of the UV map."""
    found = follow(at)
    if isinstance(found, Input):
        return _constant_matrix(found), ""
    node, output = found.node, found.socket.identifier
    if node.type == "UVMAP":
        if node.from_instancer:
            lost.add("approximated: texture coordinates of the instancer by the UV map")
        return np.eye(4), node.uv_map
    if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY" and output == "Vector":
        return np.eye(4), node.attribute_name
    if node.type == "TEX_COORD" and output == "UV":
        return np.eye(4), ""
    changed = _changed(found, lost)
    if changed is not None:
        matrix, layer = _uv_matrix(found.input("Vector"), lost)
        return changed @ matrix, layer
    name = output if node.type == "TEX_COORD" else node.bl_label
    lost.add(f"approximated: texture coordinates '{name}' by the UV map")
    return np.eye(4), ""


def _direction_matrix(at: Input, lost: set[str]) -> Float64Array:
    """(4, 4) from a direction in the world to the vector at ``at``."""
    found = follow(at)
    if isinstance(found, Output):
        node, output = found.node, found.socket.identifier
        if node.type == "TEX_COORD" and output == "Generated":
            return np.eye(4)
        if node.type == "NEW_GEOMETRY" and output == "Position":
            return np.eye(4)
        changed = _changed(found, lost)
        if changed is not None:
            return changed @ _direction_matrix(found.input("Vector"), lost)
    lost.add("approximated: coordinates of the environment texture by directions")
    return np.eye(4)


def _changed(found: Output, lost: set[str]) -> Float64Array | None:
    """(4, 4) of a node that changes its vector, None for other nodes."""
    node = found.node
    if node.type == "MAPPING":
        values = [_vector(found.input(name), lost) for name in ("Location", "Rotation", "Scale")]
        return mapping_matrix(node.vector_type, *values)
    if node.type != "VECT_MATH" or node.operation not in VECTOR_MATH:
        return None
    matrix = np.eye(4)
    if node.operation == "SCALE":
        scale = _vector(found.input("Scale"), lost)[0]
        matrix[:3, :3] *= scale
        return matrix
    second = _vector(found.input("Vector_001"), lost)
    if node.operation == "MULTIPLY":
        return np.diag([*second, 1.0])
    matrix[:3, 3] = second if node.operation == "ADD" else -second
    return matrix


def mapping_matrix(
    kind: str, location: Float64Array, rotation: Float64Array, scale: Float64Array
) -> Float64Array:
    """(4, 4) of a Mapping node: POINT, VECTOR, TEXTURE (the inverse of a point's) or NORMAL."""
    turn = np.eye(4)
    turn[:3, :3] = np.array(Euler(rotation.tolist(), "XYZ").to_matrix())
    if kind == "NORMAL":
        return turn @ np.diag([*_inverse(scale), 1.0])
    if kind == "TEXTURE":
        back = np.eye(4)
        back[:3, 3] = -location
        return np.diag([*_inverse(scale), 1.0]) @ turn.T @ back
    matrix = turn @ np.diag([*scale, 1.0])
    if kind == "POINT":
        matrix[:3, 3] = location
    return matrix


def _own_mapping(node: bpy.types.Node) -> Float64Array:
    """The mapping that a texture node carries itself, a remnant of old files."""
    own = node.texture_mapping
    values = (np.array(value, np.float64) for value in (own.translation, own.rotation, own.scale))
    return mapping_matrix(own.vector_type, *values)


def _vector(at: Input, lost: set[str]) -> Float64Array:
    """The constant at ``at``; the socket's own where a node feeds it, and said."""
    found = follow(at)
    if isinstance(found, Output):
        lost.add("approximated: changing texture mapping by a constant")
        found = at
    return np.broadcast_to(np.array(found.socket.default_value, np.float64), 3)


def _constant_matrix(at: Input) -> Float64Array:
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = at.socket.default_value
    matrix[3, 3] = 1.0
    return matrix


def _inverse(scale: Float64Array) -> Float64Array:
    return np.where(scale != 0.0, 1.0 / np.where(scale != 0.0, scale, 1.0), 0.0)
