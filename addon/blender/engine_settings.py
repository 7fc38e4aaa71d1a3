# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's settings, ``Scene.bvh_lab_render``, and its passes, ``ViewLayer.bvh_lab``."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty

# Every builder of `core.builders()`; a file keeps the number.
BUILDERS = [
    ("lbvh", "LBVH", "Built in no time, slower to trace", 0),
    ("hlbvh", "HLBVH", "Built in no time, a little better than LBVH", 1),
    ("ploc", "PLOC", "Fast to build, good to trace", 2),
    ("atrbvh", "ATRBVH", "LBVH with improved treelets", 3),
    ("prbvh", "PRBVH", "LBVH with subtrees moved to better places", 4),
    ("prbvh_a", "PRBVHᴬ", "PRBVH with simulated annealing: takes minutes", 5),
    ("prbvh_s", "PRBVHₛ", "SBVH with subtrees moved to better places: slow to build", 6),
    ("prbvh_sa", "PRBVHₛᴬ", "PRBVHₛ with simulated annealing: takes minutes", 7),
    ("sah", "SAH", "Surface area heuristic: a good compromise of build and trace", 8),
    ("sbvh", "SBVH", "SAH with spatial splits: slow to build, fast to trace", 9),
    ("trbvh", "TRBVH", "LBVH with small treelets built the best way", 10),
    ("hybrid", "Hybrid", "SBVH improved where it matters: slow to build", 11),
]
BRANCHINGS = [
    ("2", "2", "Two children a node", 2),
    ("4", "4", "Four children a node", 4),
    ("8", "8", "Eight children a node: usually the fastest", 8),
]
REORDERS = [
    ("off", "Off", "Trace rays in the order in which paths make them", 0),
    ("aila", "Aila", "Sort by origin and direction interleaved, as in the paper", 1),
    ("origin", "Origin", "Sort by the ray's origin", 2),
    ("octahedron", "Octahedron", "Sort by origin, then by direction on an octahedron", 3),
    ("two_point", "Two Point", "Sort by the ray's origin and an estimate of its end", 4),
]


class BVHLAB_PG_render(bpy.types.PropertyGroup):
    """How the engine renders a scene."""

    samples: IntProperty(
        name="Samples",
        description="Paths through each pixel of a final render",
        default=64,
        min=1,
        soft_max=4096,
        max=1 << 24,
    )
    viewport_samples: IntProperty(
        name="Viewport Samples",
        description="Paths through each pixel after which the viewport rests",
        default=32,
        min=1,
        soft_max=1024,
        max=1 << 24,
    )
    seed: IntProperty(
        name="Seed",
        description="Choose another noise pattern. The same seed gives the same picture",
        default=0,
        min=0,
    )
    depth: IntProperty(
        name="Depth",
        description="How many times light is followed from surface to surface after the first one. "
        "0 renders direct light only",
        default=8,
        min=0,
        soft_max=32,
        max=1024,
    )
    shadow_rays: IntProperty(
        name="Shadow Rays",
        description="Rays from each surface point to lights",
        default=2,
        min=0,
        soft_max=8,
        max=64,
    )
    builder: EnumProperty(
        name="BVH",
        description="How the bounding volume hierarchy of a final render is built. "
        "The picture does not depend on it, the time does",
        items=BUILDERS,
        default="sah",
    )
    viewport_builder: EnumProperty(
        name="Viewport BVH",
        description="How the viewport's hierarchy is built, anew at every change of the scene",
        items=BUILDERS,
        default="lbvh",
    )
    branching: EnumProperty(
        name="Branching", description="Children of a node", items=BRANCHINGS, default="8"
    )
    reorder: EnumProperty(
        name="Reorder Rays",
        description="Sort secondary and shadow rays, so that neighbours go the same way",
        items=REORDERS,
        default="off",
    )


class BVHLAB_PG_view_layer(bpy.types.PropertyGroup):
    """Passes of a view layer beyond those that Blender has switches for."""

    use_pass_albedo: BoolProperty(
        name="Albedo", description="Colour of the surface that is seen first"
    )
    use_pass_traversal_steps: BoolProperty(
        name="Traversal Steps",
        description="Nodes of the hierarchy visited to find the surface that is seen first, "
        "the mean over samples",
    )
    use_pass_triangle_tests: BoolProperty(
        name="Triangle Tests",
        description="Triangles tested to find the surface that is seen first, "
        "the mean over samples",
    )


CLASSES = (BVHLAB_PG_render, BVHLAB_PG_view_layer)


def _label(items: list[tuple[str, str, str, int]], name: str) -> str:
    return next(item[1] for item in items if item[0] == name)


def bvh_label(builder: str, branching: str) -> str:
    """The tree in words, e.g. "SAH 8-wide"."""
    return f"{_label(BUILDERS, builder)} {branching}-wide"


def register() -> None:
    """Put the settings on every scene and view layer."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.bvh_lab_render = PointerProperty(type=BVHLAB_PG_render)
    bpy.types.ViewLayer.bvh_lab = PointerProperty(type=BVHLAB_PG_view_layer)


def unregister() -> None:
    """Take them away; their values stay in the file for the next time."""
    del bpy.types.ViewLayer.bvh_lab
    del bpy.types.Scene.bvh_lab_render
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
