# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies in a thread of their own: polled, cancelled, and gone when they end."""

from __future__ import annotations

import threading
import time

import pytest
from bvh_lab.study.job import Job
from bvh_lab.study.results import Result
from study_samples import sample_scene, small_plan


def test_a_job_polls_and_ends() -> None:
    job = Job(sample_scene(), small_plan(builders=["sah"]))
    while job.running:
        job.wait(0.01)
        job.poll()
    job.poll()
    assert job.fraction > 0.5 and job.stage and job.seconds_left >= 0.0
    assert not job.study.result.failed()


def test_a_job_hands_over_its_error() -> None:
    job = Job(sample_scene(cameras=[]), small_plan())
    job.wait(60.0)
    with pytest.raises(ValueError, match="has no camera"):
        _ = job.study


def test_cancel_keeps_the_rows_measured() -> None:
    job = Job(sample_scene(), small_plan(repeats=300, ray_long_side=16, embree=False))
    while job.fraction < 0.05 or not job.stage.startswith("timing"):
        job.wait(0.005)
        job.poll()
    start = time.perf_counter()
    job.cancel()
    result = job.study.result
    assert time.perf_counter() - start < 0.5
    assert result.cancelled and len(result.rows) == 4
    assert result.rows[0].speed("primary") and not result.failed()
    assert Result.from_json(result.to_json()) == result


def test_a_job_leaves_no_thread() -> None:
    before = threading.active_count()
    job = Job(sample_scene(), small_plan(builders=["lbvh"], embree=False, pictures=False))
    assert job.study.result.rows and threading.active_count() == before
