# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are there whole or not at all: written aside, then renamed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def staged_folder(out: Path) -> Iterator[Path]:
    """A new empty folder beside ``out``, removed at the end unless it was published.

    Entering it makes the folders above ``out``, so that an ``out`` that cannot be written fails
    here, before any work, with an OSError.
    """
    out = Path(os.path.abspath(out))
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(f"{out} is a file, not a folder")
    if out.is_dir() and not os.access(out, os.W_OK | os.X_OK):
        raise PermissionError(f"no permission to write into {out}")
    out.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".partial", dir=out.parent))
    staging.chmod(0o777 & ~_umask())
    try:
        yield staging
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def publish_folder(staging: Path, out: Path) -> None:
    """Rename ``staging`` to ``out``, or its files into an ``out`` that is there.

    Files in ``out`` of other names stay as they are.
    """
    if not out.exists():
        staging.rename(out)
        return
    for path in sorted(staging.rglob("*")):
        target = out / path.relative_to(staging)
        if path.is_dir():
            target.mkdir(exist_ok=True)
        else:
            path.replace(target)


def check_writable(path: Path) -> None:
    """Raise an OSError unless a file can be written in the folder of ``path``."""
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, not a file")
    with tempfile.NamedTemporaryFile(prefix=f".{path.name}.", dir=path.absolute().parent):
        pass


def write_text_aside(path: Path, text: str) -> None:
    """Write a text file under another name, then rename it. Raises OSError."""
    folder = path.absolute().parent
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=folder)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def file_stems(names: Iterable[str]) -> dict[str, str]:
    """A file name, without suffix, for each distinct name: safe on every system and unique."""
    stems: dict[str, str] = {}
    for name in names:
        if name in stems:
            continue
        stem = "".join(c if c.isalnum() or c in "-." else "_" for c in name).strip(".") or "view"
        taken = {other.lower() for other in stems.values()}
        unique, number = stem, 2
        while unique.lower() in taken:
            unique, number = f"{stem}_{number}", number + 1
        stems[name] = unique
    return stems


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
