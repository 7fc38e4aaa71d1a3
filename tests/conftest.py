# SPDX-License-Identifier: GPL-3.0-or-later
"""A run in which every test was skipped has tested nothing: it fails as an empty one does.

Property tests draw the same examples in every run; BVHLAB_TEST_RANDOM=1 draws new ones.
"""

from __future__ import annotations

import os

import pytest

try:
    import hypothesis
except ImportError:  # Blender's own Python has none, nor tests that need it
    pass
else:
    hypothesis.settings.register_profile("repeatable", derandomize=True)
    if os.environ.get("BVHLAB_TEST_RANDOM") != "1":
        hypothesis.settings.load_profile("repeatable")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Turn a run of nothing but skips into pytest's own 'no tests ran' (exit code 5)."""
    reporter = session.config.pluginmanager.getplugin("terminalreporter")
    ran = any(reporter.stats.get(outcome) for outcome in ("passed", "failed", "error", "xfailed"))
    if exitstatus == pytest.ExitCode.OK and not ran and not session.config.option.collectonly:
        session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED
