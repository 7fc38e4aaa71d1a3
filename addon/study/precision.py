# SPDX-License-Identifier: GPL-3.0-or-later
"""The precision choices: how nodes are stored, and how rays meet boxes and triangles.

All by their ids in `core.precisions()`, with a name for people. The first of each is the default.
Every layout gives the same hits, bit for bit. So do the default tests, from every tree; the other
tests are float arithmetic as published, and may be wrong.
"""

from __future__ import annotations

LAYOUTS = {"full": "full", "cwbvh": "compressed"}
TRIANGLE_TESTS = {
    "watertight": "watertight",
    "moller_trumbore": "Möller-Trumbore",
    "woop_affine": "Woop affine",
    "baldwin_weber": "Baldwin-Weber",
}
BOX_TESTS = {"conservative": "conservative", "plain": "plain"}

FULL, WATERTIGHT, CONSERVATIVE = "full", "watertight", "conservative"

CWBVH_BRANCHING = 8  # the one branching factor that the compressed nodes have

# In as few letters as tell a row apart; the defaults are not said.
SHORT = {
    "full": "",
    "cwbvh": "c",
    "watertight": "",
    "moller_trumbore": "MT",
    "woop_affine": "Woop",
    "baldwin_weber": "BW",
    "conservative": "",
    "plain": "plain",
}


def has_layout(branching: int, layout: str) -> bool:
    """Whether trees of this branching factor can be stored so."""
    return layout != "cwbvh" or branching == CWBVH_BRANCHING


def is_exact(triangle_test: str, box_test: str) -> bool:
    """Whether these tests give the exact hit, the same from every tree: the defaults do."""
    return (triangle_test, box_test) == (WATERTIGHT, CONSERVATIVE)


def width_text(branching: int, layout: str) -> str:
    """Branching factor and layout as a table has them: "8", or "8c" for compressed nodes."""
    return f"{branching}{SHORT.get(layout, layout)}"


def tests_in_words(triangle_test: str, box_test: str) -> list[str]:
    """The tests that are not the default, e.g. ["Woop affine", "plain boxes"]."""
    words = []
    if triangle_test not in ("", WATERTIGHT):
        words.append(TRIANGLE_TESTS.get(triangle_test, triangle_test))
    if box_test not in ("", CONSERVATIVE):
        words.append(f"{BOX_TESTS.get(box_test, box_test)} boxes")
    return words
