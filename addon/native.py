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
import struct
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
    _check_whole()
    try:
        module = importlib.import_module("._core", __package__)
    except ModuleNotFoundError as error:
        if error.name != f"{__package__}._core":
            raise NativeMissing(f"The compiled core does not load: {error}; {REMEDY}") from error
        raise NativeMissing(_missing_file()) from None
    except ImportError as error:
        raise NativeMissing(f"The compiled core does not load: {error}; {REMEDY}") from error
    version = getattr(module, "__version__", None)
    if version is None:
        raise NativeMissing(f"{module.__file__} is not the core of BVH Lab; {REMEDY}")
    if version != package_version():
        raise NativeMissing(
            f"The compiled core is version {version}, but the add-on is version "
            f"{package_version()}; {REMEDY}, then restart"
        )
    return module


def _check_whole() -> None:
    """Raise where the file is cut short: the system's loader would end the process with SIGBUS.

    An ELF file's section headers stand at its end; its header tells where.
    """
    path = next((p for s in EXTENSION_SUFFIXES if (p := FOLDER / f"_core{s}").is_file()), None)
    if path is None:
        return
    with path.open("rb") as file:
        header = file.read(64)
    if header[:6] != b"\x7fELF\x02\x01" or len(header) < 64:
        return  # not a 64-bit ELF file: the loader says what it is
    (sections,) = struct.unpack_from("<Q", header, 40)
    size, count = struct.unpack_from("<HH", header, 58)
    if path.stat().st_size < sections + size * count:
        raise NativeMissing(f"{path} is cut short; {REMEDY}")


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
