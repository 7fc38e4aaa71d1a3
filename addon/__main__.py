# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m bvh_lab`: the command line outside of Blender."""

from __future__ import annotations

import sys

from .cli import main

sys.exit(main())
