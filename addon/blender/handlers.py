# SPDX-License-Identifier: GPL-3.0-or-later
"""No worker thread outlives the file it works for, the add-on, or Blender."""

from __future__ import annotations

import atexit

import bpy
from bpy.app.handlers import persistent

from . import store


@persistent
def _forget(*_: object) -> None:
    store.clear()


@persistent
def _forget_deleted(*_: object) -> None:
    if store.studies:
        store.forget_deleted()


def register() -> None:
    """Stop and forget before another file opens, and at exit; forget what is deleted."""
    bpy.app.handlers.load_pre.append(_forget)
    bpy.app.handlers.depsgraph_update_post.append(_forget_deleted)
    atexit.register(store.stop)


def unregister() -> None:
    """Stop and forget now."""
    store.clear()
    atexit.unregister(store.stop)
    bpy.app.handlers.depsgraph_update_post.remove(_forget_deleted)
    bpy.app.handlers.load_pre.remove(_forget)
