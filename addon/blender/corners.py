# SPDX-License-Identifier: GPL-3.0-or-later
"""What belongs to the corners of triangles: texture coordinates and smooth normals."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, Float64Array, UInt32Array


@dataclass
class CornerParts:
    """Corners of the instances in their order; only those that have any are kept."""

    count: int = 0
    _uvs: list[tuple[int, Float32Array]] = field(default_factory=list)
    _normals: list[tuple[int, npt.NDArray[np.bool_], Float32Array]] = field(default_factory=list)

    def add(
        self,
        triangles: int,
        uvs: Float32Array | None,
        smooth: npt.NDArray[np.bool_] | None,
        normals: Float32Array | None,
    ) -> None:
        """Append an instance of so many triangles: ``uvs`` (T, 3, 2) or None; which triangles are
        ``smooth``, (T,), and the ``normals`` of those alone, (S, 3, 3), or None for both.
        """
        if uvs is not None:
            self._uvs.append((self.count, uvs))
        if smooth is not None and normals is not None:
            self._normals.append((self.count, smooth, normals))
        self.count += triangles

    def uvs(self, triangles: int) -> Float32Array:
        """(T, 3, 2), (0, 0) where an instance has none, as in Cycles."""
        whole = np.zeros((triangles, 3, 2), np.float32)
        for first, uvs in self._uvs:
            whole[first : first + len(uvs)] = uvs
        return whole

    def normals(self, vertices: Float32Array, triangles: UInt32Array) -> Float32Array | None:
        """(T, 3, 3) unit vectors; of flat triangles the geometric normal; None if all are flat."""
        if not self._normals:
            return None
        whole = np.empty((len(triangles), 3, 3), np.float32)
        is_flat = np.ones(len(triangles), np.bool_)
        for first, smooth, normals in self._normals:
            is_flat[first : first + len(smooth)] = ~smooth
            whole[first : first + len(smooth)][smooth] = normals
        # A corner without a normal of its own takes the triangle's.
        is_flat[(whole == 0.0).all(axis=2).any(axis=1)] = True
        whole[is_flat] = geometric_normals(vertices, triangles[is_flat])[:, None]
        return whole


def geometric_normals(vertices: Float32Array, triangles: UInt32Array) -> Float32Array:
    """(T, 3) unit vectors; +Z for a triangle without area."""
    a, b, c = (vertices[triangles[:, corner]].astype(np.float64) for corner in range(3))
    return _unit(np.cross(b - a, c - a), (0.0, 0.0, 1.0)).astype(np.float32)


def normals_to_world(normals: Float32Array, linear: Float64Array) -> Float32Array:
    """Normals (..., 3) under ``linear`` (3, 3), unit length; 0 where one collapses.

    Cofactors are the inverse transpose times the determinant, and exist for every matrix; the
    determinant's sign keeps normals outside under mirroring.
    """
    scale = np.abs(linear).max() or 1.0
    rows = linear / scale
    cofactors = np.stack([np.cross(rows[(i + 1) % 3], rows[(i + 2) % 3]) for i in range(3)])
    sign = -1.0 if np.linalg.det(rows) < 0.0 else 1.0
    turned = normals.astype(np.float64) @ (sign * cofactors).T
    return _unit(turned, (0.0, 0.0, 0.0)).astype(np.float32)


def _unit(vectors: Float64Array, otherwise: tuple[float, float, float]) -> Float64Array:
    """Unit vectors, ``otherwise`` where one has no direction.

    Squares neither vanish nor overflow: a cross product of edges in float32 has a length of 1e-90
    to 1e77.
    """
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    lost = ~(np.isfinite(length) & (length > 0.0))
    length[lost] = 1.0
    unit = vectors / length[..., None]
    unit[lost] = otherwise
    return unit
