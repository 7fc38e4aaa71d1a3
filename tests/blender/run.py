# SPDX-License-Identifier: GPL-3.0-or-later
"""Run this folder's tests inside a Blender, which has no pytest:

blender --background --factory-startup --python-exit-code 1 --python tests/blender/run.py

A file pattern may follow after ` -- `.
"""

from __future__ import annotations

import sys
import unittest
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def main() -> int:
    """Return 0 where at least one test passed and none failed; the last line counts them."""
    pattern = "".join(sys.argv[sys.argv.index("--") + 1 :]) if "--" in sys.argv else ""
    sys.path.insert(0, str(FOLDER))
    suite = unittest.defaultTestLoader.discover(str(FOLDER), pattern=pattern or "test_*.py")
    result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2).run(suite)
    skipped = len(result.skipped)
    failed = len(result.failures) + len(result.errors) + len(result.unexpectedSuccesses)
    passed = max(result.testsRun - skipped - failed, 0)
    print(f"{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 0 if result.wasSuccessful() and passed else 1


sys.exit(main())
