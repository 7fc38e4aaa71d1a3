# SPDX-License-Identifier: GPL-3.0-or-later
"""The converged picture that others are judged by, kept in the user's cache folder."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .rays import View
from .scene import Float32Array, Scene

FORMAT = 1  # of the files
EPSILON = 0.01  # of relMSE, see core.image_error
MOST_BYTES = 2**30  # of all cached pictures; the ones used longest ago go first
NOT_OF_THE_PICTURE = ("name", "cameras", "geometry", "source", "frame", "notes")  # fields of Scene


@dataclass
class ReferencePicture:
    """``pixels`` is (H, W, 3) float32, linear, of ``samples`` per pixel.

    ``noise``, of the same shape, is half the difference of its two halves: it has mean 0 and the
    variance of the reference's own error, without being that error. ``error`` is the relMSE that
    this amounts to. ``notes`` says what went wrong with the cache, a sentence each.
    """

    pixels: Float32Array
    noise: Float32Array
    samples: int
    error: float
    from_cache: bool = False
    notes: list[str] = field(default_factory=list)


def reference_picture(
    core: ModuleType,
    bvh: Any,
    scene: Scene,
    core_scene: Any,
    view: View,
    samples: int,
    settings: dict[str, Any],
    token: Any = None,
    on_step: Callable[[int], None] | None = None,
    folder: Path | None = None,
) -> ReferencePicture:
    """The picture of two halves of ``samples`` / 2 each, from the cache if it is there.

    ``settings`` are those of `core.Renderer` that the judged pictures have (depth, shadow_rays,
    seed, threads, ...); both halves have seeds of their own, so that the reference shares no noise
    with what it judges. ``on_step`` gets the samples rendered so far. A cache that cannot be read
    or written is no failure but a note. Raises core.Cancelled.
    """
    if samples < 2:
        raise ValueError(f"a reference needs at least 2 samples per pixel, not {samples}")
    folder = cache_folder() if folder is None else folder
    path = folder / f"{_key(core, scene, view, samples, settings)}.npz"
    found, note = _read(path, view)
    if found is not None:
        return found
    halves, done = [], 0
    seed = int(settings.get("seed", 0))
    for number, count in enumerate((samples - samples // 2, samples // 2)):
        half_settings = settings | {"seed": (seed + 0x9E3779B9 * (number + 1)) % 2**32}
        renderer = core.Renderer(
            bvh, core_scene, view.camera, view.width, view.height, **half_settings
        )
        for chunk in _chunks(count):
            renderer.render(chunk, token=token)
            done += chunk
            if on_step:
                on_step(done)
        halves.append((count, np.asarray(renderer.picture().pixels, np.float64)))
    result = combine(halves)
    result.notes = [text for text in (note, _write(path, result)) if text]
    return result


def combine(halves: list[tuple[int, Any]]) -> ReferencePicture:
    """The mean of two independent pictures, (samples, (H, W, 3) float64) each, with its error.

    Where both have the same variance V, their mean has V / 2, and so has half their difference.
    """
    (first, a), (second, b) = halves
    pixels, noise = (first * a + second * b) / (first + second), 0.5 * (a - b)
    squares, scale = noise**2, pixels**2 + EPSILON * pixels.mean() ** 2
    error = np.divide(squares, scale, out=np.zeros_like(squares), where=squares > 0.0).mean()
    return ReferencePicture(
        pixels.astype(np.float32), noise.astype(np.float32), first + second, float(error)
    )


def _chunks(count: int) -> list[int]:
    return [16] * (count // 16) + ([count % 16] if count % 16 else [])


# --- the key -------------------------------------------------------------------------------------


def _key(core: ModuleType, scene: Scene, view: View, samples: int, settings: dict[str, Any]) -> str:
    """SHA-256 of all that the picture depends on, the program included."""
    sha = hashlib.sha256()
    program = Path(str(core.__file__)).read_bytes()
    camera = scene_camera(scene, view)
    kept = {name: value for name, value in settings.items() if name not in ("threads", "reorder")}
    parts = [FORMAT, core.__version__, program, camera, view.width, view.height, samples, kept]
    parts += [
        (entry.name, getattr(scene, entry.name))
        for entry in dataclasses.fields(scene)
        if entry.name not in NOT_OF_THE_PICTURE
    ]
    parts += [_file_state(texture.path) for texture in scene.textures if texture.path]
    _feed(sha, parts)
    return sha.hexdigest()


def scene_camera(scene: Scene, view: View) -> Any:
    """The scene's camera of the view's name."""
    return next(camera for camera in scene.cameras if camera.name == view.name)


def _file_state(path: str) -> tuple[int, int] | str:
    try:
        state = os.stat(path)
    except OSError:
        return "missing"
    return (state.st_size, state.st_mtime_ns)


def _feed(sha: Any, value: Any) -> None:
    """Hash plain values, arrays, lists, dictionaries and dataclasses, each with its type."""
    sha.update(type(value).__name__.encode() + b":")
    if isinstance(value, np.ndarray):
        sha.update(f"{value.dtype.str}{value.shape}".encode())
        sha.update(np.ascontiguousarray(value).data)
    elif dataclasses.is_dataclass(value):
        for entry in dataclasses.fields(value):
            _feed(sha, (entry.name, getattr(value, entry.name)))
    elif isinstance(value, dict):
        _feed(sha, sorted(value.items()))
    elif isinstance(value, (list, tuple)):
        sha.update(f"{len(value)};".encode())
        for item in value:
            _feed(sha, item)
    elif isinstance(value, bytes):
        sha.update(f"{len(value)};".encode() + value)
    elif isinstance(value, (str, bool, int, float, type(None))):
        sha.update(f"{value!r};".encode())
    else:
        raise TypeError(f"a {type(value).__name__} cannot be hashed for the cache")


# --- the files -----------------------------------------------------------------------------------


def cache_folder() -> Path:
    """Where pictures are kept: below XDG_CACHE_HOME, or ~/.cache where that is not set."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    root = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
    return root / "bvh_lab" / "references"


def _read(path: Path, view: View) -> tuple[ReferencePicture | None, str]:
    """The cached picture, and a note where the file is there but broken."""
    try:
        with np.load(path, allow_pickle=False) as file:
            pixels, noise = file["pixels"], file["noise"]
            samples, error = int(file["samples"]), float(file["error"])
        for part in (pixels, noise):
            if part.shape != (view.height, view.width, 3) or part.dtype != np.float32:
                raise ValueError(f"it holds {part.dtype} {part.shape}")
        os.utime(path)  # it was used now
    except FileNotFoundError:
        return None, ""
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as problem:
        return None, f"Rendered the reference anew: {path} cannot be read ({problem})."
    return ReferencePicture(pixels, noise, samples, error, from_cache=True), ""


def _write(path: Path, picture: ReferencePicture) -> str:
    """Keep the picture, written aside and renamed; a note where that fails."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(".partial", f".{path.stem[:16]}.", path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(
                    file,
                    pixels=picture.pixels,
                    noise=picture.noise,
                    samples=picture.samples,
                    error=picture.error,
                )
            os.replace(aside, path)
        except BaseException:
            os.unlink(aside)
            raise
        _trim(path.parent)
    except OSError as problem:
        return f"The reference is not kept: {path.parent} cannot be written ({problem.strerror})."
    return ""


def _trim(folder: Path) -> None:
    files = sorted(folder.glob("*.npz"), key=lambda file: file.stat().st_mtime, reverse=True)
    total = 0
    for file in files:
        total += file.stat().st_size
        if total > MOST_BYTES and file != files[0]:
            file.unlink(missing_ok=True)
