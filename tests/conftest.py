# SPDX-License-Identifier: GPL-3.0-or-later
"""A run in which every test was skipped has tested nothing: it fails as an empty one does.

Property tests draw the same examples in every run; BVHLAB_TEST_RANDOM=1 draws new ones.
Tests that measure errors show them: `record_property("table", (head, cells))` is a line of the
table with that head, printed after the last test.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tables whose lines tests recorded."""
    tables: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for outcome in ("passed", "failed"):
        for report in terminalreporter.stats.get(outcome, []):
            for name, value in getattr(report, "user_properties", []):
                if name == "table" and report.when == "call":
                    head, cells = value
                    tables.setdefault(tuple(head), []).append(tuple(cells))
    if not tables:
        return
    sys.path.append(str(Path(__file__).resolve().parents[1] / "scripts"))
    from stability_tables import table

    for head, lines in tables.items():
        terminalreporter.section("errors against the exact answer")
        for line in table(head, lines):
            terminalreporter.write_line(line)
