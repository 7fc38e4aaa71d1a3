# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a script in a Blender with a window, under Xvfb."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("BVHLAB_BUILD", REPOSITORY / "build"))
BLENDER = shutil.which("blender", path="/usr/bin")


def what_blender_saw(
    script: str, folder: Path, width: int, height: int, *options: str, words: Sequence[str] = ()
) -> dict[str, Any]:
    """Run the script beside this file and return its seen.json; "folder" holds its screenshots.

    The window is ``width`` x ``height`` pixels; ``options`` go to Blender, ``words`` to the script.
    A script that failed
    fails the test with its traceback.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "seen.json").unlink(missing_ok=True)
    command = ["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24", str(BLENDER)]
    command += ["--factory-startup", "-noaudio", *options]
    command += ["--window-geometry", "0", "0", str(width), str(height), "--python-exit-code", "1"]
    command += [
        "--python",
        str(Path(__file__).with_name(script)),
        "--",
        str(BUILD),
        str(folder),
        *words,
    ]
    environment = {
        **os.environ,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "BLENDER_USER_RESOURCES": str(folder),
    }
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert (folder / "seen.json").is_file(), f"{run.returncode}\n{run.stdout}\n{run.stderr}"
    seen = json.loads((folder / "seen.json").read_text())
    assert "error" not in seen, f"{seen['error']}\nscreenshots: {folder}"
    assert run.returncode == 0, run.stderr
    assert "Traceback" not in run.stdout + run.stderr, run.stdout + run.stderr
    return {**seen, "folder": folder}
