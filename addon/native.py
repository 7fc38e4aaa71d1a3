# SPDX-License-Identifier: GPL-3.0-or-later
"""The door to the compiled core: the only file that imports it, and only when it is asked for.

``from bvh_lab.native import core`` gives the module or raises `NativeMissing`. In a Blender process
`bpy` is always imported before (an older TBB that comes first can stop Blender from starting).
"""

from __future__ import annotations

import functools
import importlib
import platform
import re
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType
from typing import Any

FOLDER = Path(__file__).parent
REMEDY = "run `make build`, or install the zip made for this Python and system"


class NativeMissing(RuntimeError):
    """The compiled core cannot be used; the text says why and what to do, in one sentence."""


def package_version() -> str:
    """Version of this package as its manifest has it, e.g. "0.1.0".

    `bl_info` holds the same (a test compares them), but Blender deletes it from extensions.
    """
    manifest = (FOLDER / "blender_manifest.toml").read_text(encoding="utf-8")
    found = re.search(r'^version = "([^"]+)"$', manifest, re.MULTILINE)
    if found is None:
        raise NativeMissing(f'{FOLDER / "blender_manifest.toml"} has no line version = "..."')
    return found[1]


@functools.cache
def load() -> ModuleType:
    """The compiled module `_core`; raises `NativeMissing` where there is none that fits."""
    try:
        module = importlib.import_module("._core", __package__)
    except ModuleNotFoundError as error:
        if error.name != f"{__package__}._core":
            raise NativeMissing(f"The compiled core does not load: {error}; {REMEDY}") from error
        raise NativeMissing(_missing_file()) from None
    except ImportError as error:
        raise NativeMissing(f"The compiled core does not load: {error}; {REMEDY}") from error
    if module.__version__ != package_version():
        raise NativeMissing(
            f"The compiled core is version {module.__version__}, but the add-on is version "
            f"{package_version()}; {REMEDY}, then restart"
        )
    return module


def _missing_file() -> str:
    """Why no file was found: the name looked for, and those that lie there."""
    found = sorted(path.name for path in FOLDER.glob("_core.*") if path.suffix in (".so", ".pyd"))
    return (
        f"The compiled core for Python {platform.python_version()} is missing: looked for "
        f"_core{EXTENSION_SUFFIXES[0]} in {FOLDER}, found {', '.join(found) or 'none'}; {REMEDY}"
    )


def __getattr__(name: str) -> Any:
    if name == "core":
        return load()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
