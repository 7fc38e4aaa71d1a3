# SPDX-License-Identifier: GPL-3.0-or-later
"""What to measure: every choice of a study in one plain record."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

from .devices import CPU, has_tests, resolved
from .precision import (
    BOX_TESTS,
    CONSERVATIVE,
    CWBVH_BRANCHING,
    FULL,
    LAYOUTS,
    TRIANGLE_TESTS,
    WATERTIGHT,
    has_layout,
    is_exact,
)
from .records import from_plain, parse_json

BRANCHINGS = (2, 4, 8)
PRESETS = ("quick", "paper")
REORDERS = ("off", "aila", "origin", "octahedron", "two_point")  # of rays, as in core.trace

# The paper's ten, in its order, and those beyond it.
BUILDERS = (
    "lbvh",
    "hlbvh",
    "ploc",
    "atrbvh",
    "prbvh",
    "prbvh_a",
    "prbvh_s",
    "prbvh_sa",
    "sah",
    "sbvh",
    "trbvh",
    "hybrid",
)

# Lists of names: the field of Plan, what one of them is called, and those that there are.
CHOICES: dict[str, tuple[str, Sequence[str]]] = {
    "reorders": ("reorder", REORDERS),
    "layouts": ("layout", tuple(LAYOUTS)),
    "triangle_tests": ("triangle test", tuple(TRIANGLE_TESTS)),
    "box_tests": ("box test", tuple(BOX_TESTS)),
}

# Where the presets differ from the builders' defaults. Annealing: the paper runs 3000 iterations.
QUICK_ITERATIONS = 200
UNLIMITED_REFERENCES = 2.0**31
QUICK_PARAMS = {name: {"iterations": float(QUICK_ITERATIONS)} for name in ("prbvh_a", "prbvh_sa")}
PAPER_PARAMS = {
    name: {"max_references": UNLIMITED_REFERENCES}
    for name in ("sbvh", "prbvh_s", "prbvh_sa", "hybrid")
}


@dataclass(frozen=True)
class Variant:
    """One row of the study: a tree and how it is traced."""

    builder: str
    branching: int
    reorder: str
    device: str
    layout: str = FULL
    triangle_test: str = WATERTIGHT
    box_test: str = CONSERVATIVE

    @property
    def name(self) -> str:
        """Name for files and look-up, e.g. "sbvh_8", "sbvh_8_cwbvh_plain" or "sbvh_8_aila"."""
        parts = [self.builder, str(self.branching)]
        defaults = {FULL, WATERTIGHT, CONSERVATIVE, "off"}
        choices = (self.layout, self.triangle_test, self.box_test, self.reorder)
        parts += [choice for choice in choices if choice not in defaults]
        if self.device != CPU:
            parts.append("".join(c if c.isalnum() else "-" for c in self.device))
        return "_".join(parts)


@dataclass
class Plan:
    """Every choice of a study. `check` names the first bad one.

    ``reorders`` are of `REORDERS`: how secondary and shadow rays are sorted before they are traced.
    ``layouts``, ``triangle_tests`` and ``box_tests`` are of the module `precision`. Layout "cwbvh"
    is for branching factor 8 alone, tests other than the default ones for device "cpu": there are
    no other such variants. ``devices`` are ids of `core.devices()`, or "opencl" for the first of
    those that can be used.
    ``views`` is a number of cameras (the first ones of the scene) or their names.

    Pictures have ``width`` x ``height`` pixels, 0 for both meaning ``long_side`` along the longer
    side of each camera, and ``samples`` paths a pixel. Paths go on ``depth`` times after their
    first hit and send ``shadow_rays`` rays towards lights from each hit. Speed is measured on the
    rays of one path for each pixel of a picture whose longer side has ``ray_long_side`` pixels (0:
    as in the picture).

    ``target_error`` is a relMSE: the time that each variant takes to it is measured in the first
    view, which needs ``pictures`` and a converged reference. 0 measures no such time.

    ``repeats`` counts the timed runs after one warm-up; ``build_repeats`` the timed builds.
    ``judged_rays`` are compared with brute force for each view and kind of ray. ``memory_gib``
    bounds the trees held at once (0: half of what is free at the start). ``threads`` 0 means all.
    """

    preset: str = "quick"
    builders: list[str] = field(default_factory=lambda: list(BUILDERS))
    branchings: list[int] = field(default_factory=lambda: list(BRANCHINGS))
    reorders: list[str] = field(default_factory=lambda: ["off"])
    devices: list[str] = field(default_factory=lambda: ["cpu"])
    layouts: list[str] = field(default_factory=lambda: list(LAYOUTS))
    triangle_tests: list[str] = field(default_factory=lambda: [WATERTIGHT])
    box_tests: list[str] = field(default_factory=lambda: [CONSERVATIVE])
    params: dict[str, dict[str, float]] = field(default_factory=lambda: deepcopy(QUICK_PARAMS))
    views: int | list[str] = 3
    long_side: int = 256
    width: int = 0
    height: int = 0
    samples: int = 1
    depth: int = 2
    shadow_rays: int = 2
    ray_long_side: int = 160
    pictures: bool = True
    target_error: float = 0.0
    embree: bool = True
    repeats: int = 5
    build_repeats: int = 3
    judged_rays: int = 512
    seed: int = 0
    threads: int = 0
    traversal: float = 3.0
    intersection: float = 2.0
    memory_gib: float = 0.0

    @classmethod
    def from_preset(cls, preset: str) -> Plan:
        """The plan of a preset: "quick" (the default) or "paper".

        "paper" is Meister & Bittner 2022, section 4: 1024 x 768 pixels, 32 samples, depth 8 with
        two shadow rays a hit, three views, with and without reordering, c_T = 3, c_I = 2 and the
        builders' settings: their defaults, without a limit on duplicated references. Nodes are full
        ones, the paper has no compressed ones. Hits are ours, exact; the paper's triangle test is
        "woop_affine".
        """
        if preset not in PRESETS:
            raise ValueError(f"unknown preset {preset!r}; there are: {', '.join(PRESETS)}")
        if preset == "quick":
            return cls()
        return cls(
            preset="paper",
            reorders=["off", "aila"],
            layouts=[FULL],
            params=deepcopy(PAPER_PARAMS),
            width=1024,
            height=768,
            samples=32,
            depth=8,
            ray_long_side=0,
        )

    def preset_note(self) -> str:
        """What the preset means, in a sentence for the report."""
        side = f"{self.ray_long_side} pixels along the longer side"
        if self.preset == "paper":
            note = (
                "Preset paper: 1024x768 pixels, 32 samples, depth 8, two shadow rays a hit, no "
                "Russian roulette, three views, c_T = 3, c_I = 2, full nodes (no cwbvh) and the "
                "paper's builder settings, but for what was set otherwise. Where the paper tests "
                "triangles by Woop's affine transform (woop_affine), the default here is exact."
            )
        else:
            long_side = f"{self.long_side} pixels along the longer side"
            size = f"{self.width}x{self.height} pixels" if self.width else long_side
            note = (
                f"Preset quick: pictures of {size}, samples {self.samples} and depth {self.depth}, "
                "where the paper has 1024x768, 32 and 8."
            )
        where = f"a picture of {side}" if self.ray_long_side else "the picture"
        note += f" Speed is measured on the rays of one path for each pixel of {where}."
        if self.preset == "paper":
            return note
        for builder in self.builders:
            if builder in QUICK_PARAMS and "iterations" in self.params.get(builder, {}):
                iterations = self.params[builder]["iterations"]
                note += f" {builder}: {iterations:g} iterations of annealing, the paper's are 3000."
        return note

    def variants(self) -> list[Variant]:
        """All combinations that there are, builders slowest."""
        return [
            Variant(builder, branching, reorder, device, layout, triangle_test, box_test)
            for builder, branching, layout, triangle_test, box_test, reorder, device in product(
                self.builders,
                self.branchings,
                self.layouts,
                self.triangle_tests,
                self.box_tests,
                self.reorders,
                self.devices,
            )
            if has_layout(branching, layout) and has_tests(device, triangle_test, box_test)
        ]

    def all_exact(self) -> bool:
        """Whether all variants promise exact hits: triangle and box test are the default."""
        return all(is_exact(t, b) for t in self.triangle_tests for b in self.box_tests)

    def check(
        self,
        builders: Sequence[Mapping[str, Any]] | None = None,
        devices: Sequence[Mapping[str, Any]] | None = None,
    ) -> None:
        """Raise ValueError naming the first bad choice and what may stand there.

        ``builders`` and ``devices`` are what the core offers (`core.builders()`, `core.devices()`);
        without them only what needs no core is checked.
        """
        self._check_lists()
        self._check_numbers()
        if builders is not None:
            _check_builders(self.builders, self.params, builders)
        if devices is not None:
            resolved(self.devices, devices)

    def _check_lists(self) -> None:
        for name in ("builders", "branchings", "devices", *CHOICES):
            values = getattr(self, name)
            if not values:
                raise ValueError(f"{name} is empty; name at least one")
            if len(set(values)) < len(values):
                raise ValueError(f"{name} names one twice: {', '.join(map(str, values))}")
        for branching in self.branchings:
            if branching not in BRANCHINGS:
                raise ValueError(f"branching {branching} is not known; it is 2, 4 or 8")
        for name, (what, known) in CHOICES.items():
            for value in getattr(self, name):
                if value not in known:
                    raise ValueError(f"unknown {what} {value!r}; there are: {', '.join(known)}")
        if not any(has_layout(b, layout) for b in self.branchings for layout in self.layouts):
            raise ValueError(
                f"layout cwbvh is {CWBVH_BRANCHING}-wide: choose branching {CWBVH_BRANCHING} or "
                "the layout full, too"
            )
        if not self.variants():
            raise ValueError(
                "OpenCL devices have the default triangle and box test only: choose those, too, or "
                "device cpu"
            )
        if self.preset not in PRESETS:
            raise ValueError(f"unknown preset {self.preset!r}; there are: {', '.join(PRESETS)}")
        if isinstance(self.views, list) and not self.views:
            raise ValueError("views is empty; name at least one camera, or give a number")

    def _check_numbers(self) -> None:
        if (self.width == 0) != (self.height == 0):
            raise ValueError(f"resolution {self.width}x{self.height} needs both width and height")
        if isinstance(self.views, int):
            _within("views", self.views, 1, 1000)
        _within("long_side", self.long_side, 8, 16384)
        if self.width:
            _within("width", self.width, 8, 16384)
            _within("height", self.height, 8, 16384)
        if self.ray_long_side:
            _within("ray_long_side", self.ray_long_side, 8, 16384)
        _within("samples", self.samples, 1, 65536)
        _within("depth", self.depth, 0, 1024)
        _within("shadow_rays", self.shadow_rays, 0, 64)
        if self.target_error != 0.0:
            _within("target_error (0: none)", self.target_error, 1e-5, 100.0)
            if not self.pictures:
                raise ValueError(
                    "target_error is judged by pictures and there are none: choose pictures, "
                    "or a target_error of 0"
                )
        _within("repeats", self.repeats, 3, 1000)
        _within("build_repeats", self.build_repeats, 1, 1000)
        _within("judged_rays", self.judged_rays, 0, 1_000_000)
        _within("seed", self.seed, 0, 2**32 - 1)
        _within("threads", self.threads, 0, 4096)
        _within("traversal", self.traversal, 1e-6, 1e6)
        _within("intersection", self.intersection, 1e-6, 1e6)
        _within("memory_gib", self.memory_gib, 0.0, 1e6)

    def to_json(self) -> str:
        """JSON text that `from_json` reads back into an equal plan."""
        return json.dumps(asdict(self), indent=2, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Plan:
        """The plan that `to_json` wrote; raises ValueError naming a bad field.

        In ``reorders``, false and true mean "off" and "aila": that is how it was once written.
        """
        plain = parse_json(text)
        if isinstance(plain, dict) and isinstance(reorders := plain.get("reorders"), list):
            named = {False: "off", True: "aila"}
            plain["reorders"] = [named[r] if isinstance(r, bool) else r for r in reorders]
        return from_plain(cls, plain)


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} is {value}; it must be from {low:g} to {high:g}")


def _check_builders(
    chosen: Sequence[str],
    params: Mapping[str, Mapping[str, float]],
    builders: Sequence[Mapping[str, Any]],
) -> None:
    known = {builder["id"]: builder for builder in builders}
    for name in [*chosen, *params]:
        if name not in known:
            raise ValueError(f"unknown builder {name!r}; there are: {', '.join(known)}")
    for name, settings in params.items():
        parameters = {parameter["name"]: parameter for parameter in known[name]["parameters"]}
        for key, value in settings.items():
            if key not in parameters:
                there = ", ".join(parameters) or "none"
                raise ValueError(f"builder {name!r} has no parameter {key!r}; there are: {there}")
            _within(f"{name}.{key}", value, parameters[key]["minimum"], parameters[key]["maximum"])
