# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender --command bvhlab ...`, which Blender has from 4.2 on."""

from __future__ import annotations

import bpy

_handle: object | None = None


def _run(argv: list[str]) -> int:
    from .. import cli

    return cli.main(argv)


def register() -> None:
    """Add the command where Blender knows commands."""
    global _handle
    if hasattr(bpy.utils, "register_cli_command"):
        _handle = bpy.utils.register_cli_command("bvhlab", _run)


def unregister() -> None:
    """Remove it."""
    global _handle
    if _handle is not None:
        bpy.utils.unregister_cli_command(_handle)
        _handle = None
