# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH Lab: builds every bounding volume hierarchy of the open scene and shows what each costs."""

from __future__ import annotations

# Blender 3.4 to 4.1 read this literal without importing the file; later ones read the manifest.
bl_info = {
    "name": "BVH Lab",
    "author": "BVH Lab authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Render > BVH Lab",
    "description": "Compare bounding volume hierarchies on the open scene",
    "category": "Render",
}


def register() -> None:
    """Add the panel, operators and settings to Blender."""
    from .blender import registration

    registration.register()


def unregister() -> None:
    """Take everything away again; a running comparison is cancelled first."""
    from .blender import registration

    registration.unregister()
