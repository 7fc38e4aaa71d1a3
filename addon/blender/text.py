# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences for the user; a panel does not wrap text by itself."""

from __future__ import annotations

import textwrap

import bpy

PIXELS_PER_CHARACTER = 6.0  # of Blender's interface font at scale 1, a little pessimistic
MARGIN = 60  # pixels for the panel's frame and an icon


def paragraph(
    layout: bpy.types.UILayout, context: bpy.types.Context, sentence: str, icon: str = "NONE"
) -> None:
    """Draw one sentence over as many lines as the region's width takes; the icon goes first."""
    scale = context.preferences.system.ui_scale
    width = (context.region.width - MARGIN * scale) / (PIXELS_PER_CHARACTER * scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(sentence, max(20, int(width)))):
        lead = icon if number == 0 else "BLANK1"
        column.label(text=line, icon=lead if icon != "NONE" else "NONE")


def sentence(error: BaseException) -> str:
    """What a user is told of an error, in one line."""
    text = " ".join(str(error).split())
    if not text:
        return "Not enough memory" if isinstance(error, MemoryError) else type(error).__name__
    return text[0].upper() + text[1:]
