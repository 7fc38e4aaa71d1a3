# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings kept in the file, ``Scene.bvh_lab``."""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
)

from ..study.devices import CPU, described
from ..study.plan import BRANCHINGS, QUICK_ITERATIONS, Plan
from ..study.precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS
from . import preferences, store

QUICK = Plan()

_devices: list[tuple[str, str, str, int]] = []  # Blender keeps no reference to the strings


def _device_items(
    settings: BVHLAB_PG_settings, context: bpy.types.Context | None
) -> list[tuple[str, str, str, int]]:
    """The devices that can be used; a number depends on the id alone, so that files keep theirs."""
    if not _devices:
        for device in store.devices():
            if device["available"]:
                number = 0 if device["id"] == CPU else zlib.crc32(device["id"].encode()) >> 1
                name = f"{'CPU' if device['id'] == CPU else 'OpenCL'}, {device['name']}"
                _devices.append((device["id"], name, described(device), number))
    return _devices or [("cpu", "CPU", "The processor", 0)]


class BVHLAB_PG_settings(bpy.types.PropertyGroup):
    """What to compare. Builders are switches of their own, so that a click toggles one."""

    use_lbvh: BoolProperty(
        name="LBVH",
        description="Linear BVH: sorts the triangles along a curve. The fastest to build",
        default=True,
    )
    use_hlbvh: BoolProperty(
        name="HLBVH",
        description="LBVH below, the surface area heuristic at the top. Fast to build",
        default=True,
    )
    use_ploc: BoolProperty(
        name="PLOC",
        description="Merges nearest neighbours, bottom-up. Fast to build, good to trace",
        default=True,
    )
    use_atrbvh: BoolProperty(
        name="ATRBVH",
        description="LBVH, improved piece by piece: treelets of 20 leaves are built anew",
        default=True,
    )
    use_prbvh: BoolProperty(
        name="PRBVH",
        description="LBVH, improved by moving subtrees to better places until none is found",
        default=True,
    )
    use_prbvh_a: BoolProperty(
        name="PRBVHᴬ",
        description="PRBVH with simulated annealing: takes minutes, gains about a percent",
        default=False,
    )
    use_prbvh_s: BoolProperty(
        name="PRBVHₛ",
        description="SBVH, improved by moving subtrees. Slow to build, the fastest to trace",
        default=True,
    )
    use_prbvh_sa: BoolProperty(
        name="PRBVHₛᴬ",
        description="PRBVHₛ with simulated annealing: takes minutes",
        default=False,
    )
    use_sah: BoolProperty(
        name="SAH",
        description="Full sweep of the surface area heuristic: slow to build, fast to trace",
        default=True,
    )
    use_sbvh: BoolProperty(
        name="SBVH",
        description="SAH with spatial splits, which cut long triangles. Slow to build",
        default=True,
    )
    use_trbvh: BoolProperty(
        name="TRBVH",
        description="LBVH, improved piece by piece: treelets of 7 leaves are built the best way",
        default=True,
    )
    use_hybrid: BoolProperty(
        name="Hybrid",
        description="SBVH, improved where it matters: about as good as PRBVHₛ, sooner built",
        default=True,
    )
    use_2: BoolProperty(name="2", description="Binary: two children a node", default=True)
    use_4: BoolProperty(name="4", description="Four children a node", default=True)
    use_8: BoolProperty(name="8", description="Eight children a node", default=True)
    use_reordering: BoolProperty(
        name="Ray Reordering",
        description="Trace a second time with the secondary and shadow rays sorted, so that "
        "neighbours go the same way: twice as many variants",
        default=False,
    )
    reorder_key: EnumProperty(
        name="Sort By",
        description="What decides the order of the rays",
        items=[
            ("aila", "Origin and Direction", "The key of the paper (Aila)", 0),
            ("origin", "Origin", "Where rays start", 1),
            ("octahedron", "Origin, then Direction", "Direction as a point of an octahedron", 2),
            ("two_point", "Both Ends", "Where rays start, and where they may end", 3),
        ],
    )
    layout_full: BoolProperty(
        name="Full",
        description="Keep boxes in full precision, the usual way",
        default=True,
    )
    layout_cwbvh: BoolProperty(
        name="Compressed",
        description="Keep every BVH of branching factor 8 a second time in less memory, its boxes "
        "rounded outwards: the same hits, shown as 8c",
        default=True,
    )
    triangle_watertight: BoolProperty(
        name="Watertight",
        description="Exact, and the same from every BVH: no ray slips through a closed surface. "
        "Pictures are rendered with this test only",
        default=True,
    )
    triangle_moller_trumbore: BoolProperty(
        name="Möller-Trumbore",
        description="The best known test. May lose rays at edges and far from the origin; how many "
        "is shown",
        default=False,
    )
    triangle_woop_affine: BoolProperty(
        name="Woop Affine",
        description="The test of the paper: prepares each triangle, which takes memory. May lose "
        "rays at edges; how many is shown",
        default=False,
    )
    triangle_baldwin_weber: BoolProperty(
        name="Baldwin-Weber",
        description="Prepares each triangle to have little left to do. May lose rays at edges; how "
        "many is shown",
        default=False,
    )
    box_conservative: BoolProperty(
        name="Conservative",
        description="Boxes a little too large rather than too small: no hit is lost. Pictures are "
        "rendered with this test only",
        default=True,
    )
    box_plain: BoolProperty(
        name="Plain",
        description="Boxes without the margin for rounding. May lose hits; how many is shown",
        default=False,
    )
    device: EnumProperty(name="Device", description="What builds and traces", items=_device_items)
    geometry: EnumProperty(
        name="Geometry",
        description="Which state of the scene to measure",
        items=[
            ("viewport", "Viewport", "What the viewport shows: eye icons, viewport levels", 0),
            ("render", "Render", "What a final render sees: camera icons, render levels", 1),
        ],
    )
    preset: EnumProperty(
        name="Preset",
        description="How much to measure",
        items=[
            ("quick", "Quick", "Resolution and samples of your choice", 0),
            ("paper", "Paper", "1024 x 768 pixels, 32 samples, depth 8: takes hours", 1),
        ],
    )
    resolution: IntProperty(
        name="Resolution",
        description="Pixels along the longer side of the picture",
        default=QUICK.long_side,
        min=8,
        soft_min=64,
        soft_max=2048,
        max=16384,
        subtype="PIXEL",
    )
    samples: IntProperty(
        name="Samples",
        description="Paths a pixel of the picture; speed is measured on the rays of one path",
        default=QUICK.samples,
        min=1,
        soft_max=64,
        max=65536,
    )
    depth: IntProperty(
        name="Depth",
        description="How often light is followed on after the first surface; 0 is direct light",
        default=QUICK.depth,
        min=0,
        soft_max=16,
        max=1024,
    )
    ray_resolution: IntProperty(
        name="Measured Rays",
        description="Pixels along the longer side for which rays are traced and timed: more take "
        "longer and spread less",
        default=QUICK.ray_long_side,
        min=8,
        soft_min=64,
        soft_max=1024,
        max=16384,
        subtype="PIXEL",
    )
    annealing: IntProperty(
        name="Annealing",
        description="Iterations of simulated annealing, for PRBVHᴬ and PRBVHₛᴬ",
        default=QUICK_ITERATIONS,
        min=1,
        soft_max=3000,
        max=1_000_000,
    )
    views: IntProperty(
        name="Views",
        description="How many cameras to look through, the active one first",
        default=3,
        min=1,
        soft_max=8,
        max=1000,
    )
    repeats: IntProperty(
        name="Repeats",
        description="Timed runs of which the median counts",
        default=QUICK.repeats,
        min=3,
        soft_max=25,
        max=1000,
    )
    judged_rays: IntProperty(
        name="Checked Rays",
        description="Rays of each view and kind that are checked against brute force",
        default=QUICK.judged_rays,
        min=0,
        soft_max=10_000,
        max=1_000_000,
    )
    embree: BoolProperty(
        name="Embree for Comparison",
        description="Add rows for Embree, the ray tracer inside Cycles, on the same rays",
        default=True,
    )
    pictures: BoolProperty(
        name="Pictures", description="Render a picture with every variant", default=True
    )

    target_error: FloatProperty(
        name="Target Error",
        description="Measure how long each variant's picture takes to this relative error (relMSE; "
        "0.05 is noisy, 0.01 fair); 0 does not. The first time it takes a minute or more, for a "
        "converged picture to compare with",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        max=100.0,
        step=1,
        precision=3,
    )

    def builders(self) -> list[str]:
        """Ids of the builders switched on, of those that the core offers."""
        offered = [str(builder["id"]) for builder in store.builders()]
        return [name for name in offered if getattr(self, f"use_{name}", False)]

    def branchings(self) -> list[int]:
        """The branching factors switched on."""
        return [branching for branching in BRANCHINGS if getattr(self, f"use_{branching}")]

    def plan(self) -> Plan:
        """These settings as a plan."""
        plan = Plan.from_preset(self.preset)
        plan.builders, plan.branchings = self.builders(), self.branchings()
        plan.reorders = ["off", self.reorder_key] if self.use_reordering else ["off"]
        plan.devices = [self.device or CPU]
        plan.threads = preferences.threads()
        if self.preset == "quick":
            plan.long_side, plan.samples, plan.views = self.resolution, self.samples, self.views
            plan.depth, plan.ray_long_side = self.depth, self.ray_resolution
            for params in plan.params.values():
                params["iterations"] = self.annealing
            plan.layouts = self._switched_on("layout", LAYOUTS)
            plan.triangle_tests = self._switched_on("triangle", TRIANGLE_TESTS)
            plan.box_tests = self._switched_on("box", BOX_TESTS)
        plan.repeats, plan.judged_rays = self.repeats, self.judged_rays
        plan.embree, plan.pictures = self.embree, self.pictures
        if self.pictures:  # what is judged
            plan.target_error = self.target_error
        return plan

    def variants(self) -> int:
        """How many variants the settings ask for."""
        return len(self.plan().variants())

    def _switched_on(self, group: str, names: Iterable[str]) -> list[str]:
        return [name for name in names if getattr(self, f"{group}_{name}")]


def register() -> None:
    """Put the settings on every scene."""
    bpy.utils.register_class(BVHLAB_PG_settings)
    bpy.types.Scene.bvh_lab = PointerProperty(type=BVHLAB_PG_settings)


def unregister() -> None:
    """Take them away; their values stay in the file for the next time."""
    del bpy.types.Scene.bvh_lab
    bpy.utils.unregister_class(BVHLAB_PG_settings)
    _devices.clear()
