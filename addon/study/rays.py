# SPDX-License-Identifier: GPL-3.0-or-later
"""The rays of one view, generated once and traced by every variant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from .core_scene import core_camera
from .judge import Answers, Judge
from .machine import free_bytes
from .plan import Plan
from .scene import Camera, Float32Array, Scene

BYTES_PER_RAY = 45  # origin, direction, t_max and the reference's answer


@dataclass
class RaySet:
    """Rays of one kind and bounce, traced together, with what they should meet.

    ``t_max`` is a scalar or (N,) float32; ``reference`` holds the answers of the default tests,
    ``sampled`` the indices of the rays that brute force judged and ``judge`` its answers.
    """

    kind: str
    bounce: int
    origins: Float32Array
    directions: Float32Array
    t_max: float | Float32Array
    reference: Answers | None = None
    sampled: npt.NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    judge: Judge | None = None

    @property
    def any_hit(self) -> bool:
        """Whether the first hit found answers the ray."""
        return self.kind == "shadow"

    @property
    def name(self) -> str:
        """E.g. "secondary rays 2", those of the second bounce."""
        return "primary rays" if self.kind == "primary" else f"{self.kind} rays {self.bounce}"

    def __len__(self) -> int:
        return len(self.origins)


@dataclass
class View:
    """One camera with its picture size and, once prepared, its rays.

    ``ray_camera`` frames the same as ``camera`` for ``ray_width`` x ``ray_height`` pixels, of which
    the rays are that speed is measured on. Kinds and bounces without rays are absent from ``sets``.
    ``pictures`` holds the first one that each device rendered, (H, W, 3).
    """

    name: str
    camera: Any  # core.Camera
    width: int
    height: int
    ray_camera: Any
    ray_width: int
    ray_height: int
    sets: list[RaySet] = field(default_factory=list)
    pictures: dict[str, Float32Array] = field(
        default_factory=dict
    )  # each device's first, (H, W, 3)

    @property
    def rays(self) -> int:
        """Number of primary rays."""
        return self.ray_width * self.ray_height


def choose_views(core: ModuleType, scene: Scene, plan: Plan) -> list[View]:
    """The cameras that the plan asks for; ValueError lists the scene's for an unknown one."""
    if not scene.cameras:
        raise ValueError(f"scene {scene.name!r} has no camera")
    chosen = scene.cameras
    if isinstance(plan.views, int):
        chosen = chosen[: plan.views]
    else:
        by_name = {camera.name: camera for camera in scene.cameras}
        for name in plan.views:
            if name not in by_name:
                raise ValueError(f"unknown view {name!r}; there are: {', '.join(by_name)}")
        chosen = [by_name[name] for name in plan.views]
    views = [_view(core, camera, plan) for camera in chosen]
    _check_memory(views, plan)
    return views


def _view(core: ModuleType, camera: Camera, plan: Plan) -> View:
    width, height = plan.width, plan.height
    if not width:
        width, height = _size(plan.long_side, camera.aspect)
    ray_width, ray_height = width, height
    if plan.ray_long_side:
        ray_width, ray_height = _size(plan.ray_long_side, width / height)

    def framed(width: int, height: int) -> Any:
        return core_camera(core, camera, fit_window(camera.window, width / height))

    return View(
        camera.name,
        framed(width, height),
        width,
        height,
        framed(ray_width, ray_height),
        ray_width,
        ray_height,
    )


def _size(long_side: int, aspect: float) -> tuple[int, int]:
    scale = long_side / max(aspect, 1.0)
    return max(1, round(scale * aspect)), max(1, round(scale))


def most_rays(view: View, plan: Plan) -> dict[str, int]:
    """How many rays of each kind the view can have: as many as if no path ended early."""
    return {
        "primary": view.rays,
        "secondary": view.rays * plan.depth,
        "shadow": view.rays * plan.shadow_rays * (plan.depth + 1),
    }


def _check_memory(views: Sequence[View], plan: Plan) -> None:
    """Raise ValueError where the rays may not fit; the rays of all views are held at once."""
    needed = BYTES_PER_RAY * sum(sum(most_rays(view, plan).values()) for view in views)
    if needed > (free := free_bytes()):
        raise ValueError(
            f"the rays to be traced may take {needed / 2**30:.1f} GiB and {free / 2**30:.1f} GiB "
            "are free; choose a lower resolution, less depth or fewer views"
        )


def fit_window(
    window: tuple[float, float, float, float], aspect: float
) -> tuple[float, float, float, float]:
    """``window`` with its shorter side changed about its middle, so that pixels stay square."""
    left, right, bottom, top = window
    if right - left >= top - bottom:
        middle, half = (bottom + top) / 2.0, (right - left) / aspect / 2.0
        return (left, right, middle - half, middle + half)
    middle, half = (left + right) / 2.0, (top - bottom) * aspect / 2.0
    return (middle - half, middle + half, bottom, top)


def generate_rays(
    core: ModuleType, scene: Any, view: View, bvh: Any, plan: Plan, token: Any
) -> None:
    """Fill ``view.sets`` with what the path tracer traces for one path of each pixel.

    ``scene`` is a `core.Scene`; ``bvh`` supplies the hits, and every variant would give the same
    ones. Paths that have ended have no rays.
    """
    paths = core.path_rays(
        bvh,
        scene,
        view.ray_camera,
        view.ray_width,
        view.ray_height,
        depth=plan.depth,
        shadow_rays=plan.shadow_rays,
        seed=plan.seed,
        threads=plan.threads,
        token=token,
    )
    infinity = float("inf")
    closest = [("primary", 0, paths.primary)]
    closest += [("secondary", i, rays) for i, rays in enumerate(paths.secondary, start=1)]
    sets = [RaySet(kind, bounce, rays[0], rays[1], infinity) for kind, bounce, rays in closest]
    for bounce, (origins, directions, t_max) in enumerate(paths.shadow):
        sets.append(RaySet("shadow", bounce, origins, directions, t_max))
    view.sets = [rays for rays in sets if len(rays)]


def judge_rays(
    core: ModuleType, mesh: Any, rays: RaySet, wanted: int, plan: Plan, seed: int, token: Any
) -> None:
    """Ask brute force in double precision about a seeded sample of ``wanted`` of the rays."""
    count = min(wanted, len(rays))
    chosen = np.random.default_rng([plan.seed, seed]).choice(len(rays), count, replace=False)
    rays.sampled = np.sort(chosen)
    origins, directions = rays.origins[rays.sampled], rays.directions[rays.sampled]
    t_max = rays.t_max if isinstance(rays.t_max, float) else rays.t_max[rays.sampled]
    truth = core.brute_force(
        mesh,
        origins,
        directions,
        t_max=t_max,
        any_hit=rays.any_hit,
        threads=plan.threads,
        token=token,
    )
    rays.judge = Judge(core, mesh, origins, directions, Answers.of(truth))
