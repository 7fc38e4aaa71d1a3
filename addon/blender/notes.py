# SPDX-License-Identifier: GPL-3.0-or-later
"""What extraction approximated or left out, gathered by kind and said in one sentence each."""

from __future__ import annotations

NAMES_SHOWN = 3


class Notes:
    """Sentences for ``Scene.notes``; each kind of approximation names the things it touched."""

    def __init__(self) -> None:
        self._facts: list[str] = []
        self._names: dict[str, dict[str, None]] = {}

    def fact(self, sentence: str) -> None:
        """Add a sentence that names nothing further."""
        if sentence not in self._facts:
            self._facts.append(sentence)

    def add(self, kind: str, name: str) -> None:
        """Add ``name`` to the things of which ``kind`` is true."""
        self._names.setdefault(kind, {})[name] = None

    def sentences(self) -> list[str]:
        """Facts first, then a sentence for each kind, in the order of their first mention."""
        named = [f"{kind}: {listed(list(names))}" for kind, names in self._names.items()]
        return [f"{text[0].upper()}{text[1:]}." for text in self._facts + named]


def listed(names: list[str]) -> str:
    """The first few names, and how many more there are."""
    shown = ", ".join(names[:NAMES_SHOWN])
    rest = len(names) - NAMES_SHOWN
    return f"{shown} and {rest} more" if rest > 0 else shown
