# SPDX-License-Identifier: GPL-3.0-or-later
"""The rays of one view, generated once and traced by every variant."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from .judge import Answers, Judge
from .plan import Plan
from .results import KINDS
from .scene import Camera, Float32Array, Scene


@dataclass
class RaySet:
    """Rays of one kind with what they should meet.

    ``t_max`` is a scalar or (N,) float32; ``reference`` holds the reference variant's answers,
    ``sampled`` the indices of the rays that brute force judged and ``judge`` its answers.
    """

    kind: str
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

    def __len__(self) -> int:
        return len(self.origins)


@dataclass
class View:
    """One camera with its picture size and, once prepared, its rays.

    A kind without rays is absent from ``sets``.
    """

    name: str
    camera: Any  # core.Camera
    width: int
    height: int
    sets: list[RaySet] = field(default_factory=list)
    picture: Float32Array | None = None  # the reference variant's, (H, W, 3)

    @property
    def pixels(self) -> int:
        """Number of pixels, and so of primary rays."""
        return self.width * self.height


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
    return [_view(core, camera, plan) for camera in chosen]


def _view(core: ModuleType, camera: Camera, plan: Plan) -> View:
    width, height = plan.width, plan.height
    if not width:
        scale = plan.long_side / max(camera.aspect, 1.0)
        width, height = (max(1, round(scale * camera.aspect)), max(1, round(scale)))
    window = fit_window(camera.window, width / height)
    made = core.Camera(camera.kind, camera.to_world, window, camera.clip_start)
    return View(camera.name, made, width, height)


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


def core_scene(core: ModuleType, mesh: Any, scene: Scene) -> Any:
    """The scene as `core.Scene`, on a `core.Mesh` of its triangles; ValueError for a bad one."""
    lights = [
        core.Light(
            light.kind,
            light.to_world,
            light.color,
            size_x=light.size_x,
            size_y=light.size_y,
            shape=light.shape,
            spot_angle=light.spot_angle,
            spot_blend=light.spot_blend,
        )
        for light in scene.lights
    ]
    base_color = np.array([m.base_color for m in scene.materials], dtype=np.float32).reshape(-1, 3)
    emission = np.array([m.emission for m in scene.materials], dtype=np.float32).reshape(-1, 3)
    return core.Scene(mesh, base_color, emission, scene.material_index, lights, scene.world)


def generate_rays(
    core: ModuleType, scene: Any, view: View, bvh: Any, plan: Plan, token: Any
) -> None:
    """Fill ``view.sets``: primary rays, and shadow and random diffuse rays from their hits.

    ``scene`` is a `core.Scene`; ``bvh`` supplies the primary hits, and every variant would give the
    same ones. Misses start no rays.
    """
    origins, directions = core.camera_rays(
        view.camera, view.width, view.height, seed=plan.seed, threads=plan.threads
    )
    hit = core.trace(bvh, origins, directions, threads=plan.threads, token=token)
    shadow = core.shadow_rays(scene, origins, directions, hit, seed=plan.seed)
    diffuse = core.diffuse_rays(scene, origins, directions, hit, seed=plan.seed)
    sets = [
        RaySet("primary", origins, directions, float("inf")),
        RaySet("shadow", shadow[0], shadow[1], t_max=shadow[2]),
        RaySet("diffuse", diffuse[0], diffuse[1], float("inf")),
    ]
    assert tuple(rays.kind for rays in sets) == KINDS
    view.sets = [rays for rays in sets if len(rays)]


def judge_rays(
    core: ModuleType, mesh: Any, rays: RaySet, plan: Plan, seed: int, token: Any
) -> None:
    """Ask brute force in double precision about a seeded sample of the rays."""
    count = min(plan.judged_rays, len(rays))
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
    rays.judge = Judge(mesh.vertices, mesh.triangles, origins, directions, Answers.of(truth))
