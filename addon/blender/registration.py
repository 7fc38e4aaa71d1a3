# SPDX-License-Identifier: GPL-3.0-or-later
"""Registers the parts in order and takes them away in reverse; a failure leaves nothing behind."""

from __future__ import annotations

from . import (
    command,
    engine,
    engine_panels,
    engine_settings,
    handlers,
    operators,
    panel_state,
    panels,
    preferences,
    properties,
)

MODULES = (
    preferences,
    properties,
    panel_state,
    engine_settings,
    operators,
    panels,
    engine,
    engine_panels,
    command,
    handlers,
)


def register() -> None:
    """Register every part, or none: what stands already goes again when a later one fails."""
    done = []
    try:
        for module in MODULES:
            module.register()
            done.append(module)
    except Exception:
        for module in reversed(done):
            module.unregister()
        raise


def unregister() -> None:
    """The reverse."""
    for module in reversed(MODULES):
        module.unregister()
