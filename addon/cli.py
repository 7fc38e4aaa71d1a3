# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line, the same from three sides:

    blender --background scene.blend --python addon/cli.py -- compare --out out/scene
    blender --command bvhlab compare             (Blender 4.2 and later)
    python -m bvh_lab compare scene.blend        (.blend through the bpy module, .npz, .obj, .ply)

Results go to stdout, progress and errors to stderr. Exit codes: 0; 1 when a variant failed or the
input is bad; 2 for bad usage; 128 + signal after Ctrl-C (130) or SIGTERM (143).
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path


def _run_by_path() -> int:
    """Blender runs this file by its path: go on in the package that it belongs to."""
    folder = Path(__file__).absolute().parent
    # An installed add-on's folder bears the package's name; a checkout has its package in build/.
    packages = folder.parent if folder.name == "bvh_lab" else folder.parent / "build"
    if not (packages / "bvh_lab").is_dir():
        print(
            f"bvh_lab: error: there is no {packages / 'bvh_lab'}; run `make build`", file=sys.stderr
        )
        return 1
    loaded = sys.modules.get("bvh_lab")
    if loaded is not None and Path(loaded.__path__[0]) != packages / "bvh_lab":
        print(
            f"bvh_lab: error: Blender has loaded the add-on in {loaded.__path__[0]} already; run "
            "the cli.py there, or give Blender --factory-startup",
            file=sys.stderr,
        )
        return 1
    sys.path.insert(0, str(packages))
    from bvh_lab.cli import main

    return main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])


if __name__ == "__main__":
    try:
        code = _run_by_path()
    except Exception:  # a bug: Blender would print it and exit with 0
        traceback.print_exc()
        code = 1
    sys.exit(code)

import argparse
import io
import json
import os
import shutil
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import FrameType, ModuleType
from typing import NoReturn

from .native import NativeMissing, load
from .study.arguments import add_plan_arguments, plan_from_arguments
from .study.console import ProgressLine, stdout_to_stderr
from .study.devices import described
from .study.job import Job
from .study.load import SUFFIXES, load_mesh_file
from .study.output import check_writable, publish_folder, staged_folder, write_text_aside
from .study.plan import Plan
from .study.report import fill_report
from .study.run import Study
from .study.scene import Scene
from .study.table import failures, text_report

POLL_SECONDS = 0.05


class UsageError(ValueError):
    """Arguments that cannot be; exit code 2."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; ``argv`` are the words after the program's name."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± gets a ?
    try:
        with _stopped_by_sigterm():
            arguments = _parser().parse_args(argv)
            code = int(arguments.command(arguments))
            _print("")  # what is left in the buffer
            return code
    except UsageError as error:
        return _fail(error, 2)
    except Terminated as error:
        return _fail(error, 128 + signal.SIGTERM)
    except (NativeMissing, ValueError, OSError) as error:
        return _fail(error, 1)
    except MemoryError as error:  # a device says how much it lacks
        return _fail(MemoryError(str(error) or "not enough memory"), 1)
    except KeyboardInterrupt:
        return _fail(KeyboardInterrupt("stopped"), 128 + signal.SIGINT)
    except SystemExit as end:  # --help
        return int(end.code or 0)


class Terminated(BaseException):
    """SIGTERM outside of a study: what was begun is cleaned up on the way out."""


@contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """Turn SIGTERM into `Terminated`; the study itself (`_run`) keeps what it has instead."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise Terminated("stopped")

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        # None is a handler of Blender's own, in C, that Python cannot give back.
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


def _print(text: str) -> None:
    """Print to stdout, now. Raises an OSError that says so where that cannot be written."""
    try:
        print(text, end="\n" if text else "", flush=True)
    except OSError as error:
        # What stays in the buffer would fail again, with a traceback, when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(f"the standard output cannot be written: {error.strerror}") from error


def _fail(error: BaseException, code: int) -> int:
    text = " ".join(str(error).split()) or type(error).__name__
    print(f"bvh_lab: error: {text}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="bvh_lab", description="Compare bounding volume hierarchies on a scene.")
    commands = parser.add_subparsers(
        required=True, metavar="compare | builders | devices | precisions"
    )
    compare = commands.add_parser(
        "compare", help="build, trace and render every variant; print a table"
    )
    compare.set_defaults(command=_compare)
    compare.add_argument(
        "scene", nargs="?", type=Path, help=".blend, .npz, .obj or .ply; without it, the open scene"
    )
    compare.add_argument(
        "--out", type=Path, help="folder for table, CSV, JSON, web page and pictures"
    )
    compare.add_argument("--json", metavar="PATH", help="write the results as JSON; - is stdout")
    compare.add_argument(
        "--geometry",
        choices=("viewport", "render"),
        default="viewport",
        help="visibility and modifier levels of a .blend (default: viewport)",
    )
    compare.add_argument(
        "--up", choices=("y", "z"), default="z", help="axis up in a mesh file (default: z)"
    )
    add_plan_arguments(compare)
    for name, command, text in (
        ("builders", _builders, "list the builders with their parameters"),
        ("devices", _devices, "list the devices, and Embree"),
        ("precisions", _precisions, "list the layouts of nodes and the triangle and box tests"),
    ):
        listing = commands.add_parser(name, help=text)
        listing.set_defaults(command=command)
        listing.add_argument("--json", action="store_true", help="as JSON")
    return parser


def _compare(arguments: argparse.Namespace) -> int:
    try:
        plan = plan_from_arguments(arguments)
    except ValueError as error:
        raise UsageError(str(error)) from error
    with ExitStack() as stack:
        _check_json_path(arguments.json)
        staging = _staging(arguments.out, stack) if arguments.out else None
        scene, host = _open_scene(arguments, plan)
        study, signum = _run(Job(scene, plan, host))
        code = _put_out(study, arguments, staging)
    return 128 + signum if signum else code


def _put_out(study: Study, arguments: argparse.Namespace, staging: Path | None) -> int:
    """Print and write the results, as much as can be, and give the exit code.

    Where one of the outputs fails, the others still hold the results.
    """
    code = 0
    for put in (_show, _write_json, _write_folder):
        try:
            code = max(code, put(study, arguments, staging))
        except OSError as error:
            code = _fail(error, 1)
    return code


def _write_json(study: Study, arguments: argparse.Namespace, staging: Path | None) -> int:
    if arguments.json is None or arguments.json == "-":
        return 0
    try:
        write_text_aside(Path(arguments.json), study.result.to_json())
    except OSError as error:
        raise _unwritable("--json", arguments.json, error) from error
    return 0


def _write_folder(study: Study, arguments: argparse.Namespace, staging: Path | None) -> int:
    if staging is None:
        return 0
    try:
        fill_report(study.result, study.pictures, staging)
        publish_folder(staging, arguments.out)
    except OSError as error:
        raise _unwritable("--out", arguments.out, error) from error
    print(f"bvh_lab: wrote {arguments.out}", file=sys.stderr)
    return 0


def _check_json_path(path: str | None) -> None:
    """Fail before the work, not after it."""
    if path is None or path == "-":
        return
    try:
        check_writable(Path(path))
    except OSError as error:
        raise _unwritable("--json", path, error) from error


def _staging(out: Path, stack: ExitStack) -> Path:
    """A folder to write into before it is renamed to ``out``; fails where it could not be."""
    try:
        return stack.enter_context(staged_folder(out))
    except OSError as error:
        raise _unwritable("--out", out, error) from error


def _unwritable(option: str, path: str | Path, error: OSError) -> OSError:
    return OSError(f"{option} {path} cannot be written: {error.strerror or error}")


def _open_scene(arguments: argparse.Namespace, plan: Plan) -> tuple[Scene, str]:
    """The scene and the program around. Blender's libraries are loaded before ours, always."""
    path = arguments.scene
    if path is None and "bpy" not in sys.modules:
        raise UsageError("compare needs a scene file: .blend, .npz, .obj or .ply")
    if path is not None and not path.is_file():
        raise ValueError(f"there is no file {path}")
    from_mesh_file = path is not None and path.suffix.lower() in SUFFIXES
    if "bpy" in sys.modules or not from_mesh_file:
        session = _blender_session(path)
    core = load()
    try:
        plan.check(core.builders(), core.devices())
    except ValueError as error:
        raise UsageError(str(error)) from error
    host = session.program() if "bpy" in sys.modules else ""
    if from_mesh_file:
        return load_mesh_file(path, arguments.up), host
    with stdout_to_stderr():
        return session.open_scene(path, arguments.geometry), host


def _blender_session(path: Path | None) -> ModuleType:
    try:
        from .blender import session
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        raise ValueError(
            f"reading {path} needs Blender: run `blender --background {path} --python cli.py "
            "-- compare`, or install the Python package bpy"
        ) from None
    return session


def _run(job: Job) -> tuple[Study, int]:
    """Wait for the study, showing progress. Ctrl-C and SIGTERM stop it; the signal is returned."""
    caught = 0

    def stop(signum: int, frame: FrameType | None) -> None:
        nonlocal caught
        caught = signum
        job.cancel()

    signals = (signal.SIGINT, signal.SIGTERM)
    before = {signum: signal.signal(signum, stop) for signum in signals}
    line = ProgressLine(sys.stderr)
    try:
        while job.running:
            job.wait(POLL_SECONDS)
            job.poll()
            line.show(job.fraction, job.stage, job.seconds_left)
    finally:
        line.clear()
        for signum, handler in before.items():
            # None is a handler of Blender's own, in C, that Python cannot give back.
            signal.signal(signum, signal.SIG_DFL if handler is None else handler)
    return job.study, caught


def _show(study: Study, arguments: argparse.Namespace, staging: Path | None) -> int:
    """Print the result and give the exit code."""
    result = study.result
    for failure in failures(result):
        print(f"bvh_lab: error: {failure}", file=sys.stderr)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    _print(result.to_json() if arguments.json == "-" else text_report(result, width))
    return 1 if result.failed() else 0


def _builders(arguments: argparse.Namespace) -> int:
    builders = load().builders()
    if arguments.json:
        _print(json.dumps(builders, indent=1, ensure_ascii=False))
        return 0
    for builder in builders:
        _print(f"{builder['id']:<10}{builder['label']}: {builder['source']}")
        for parameter in builder["parameters"]:
            unit = f" {parameter['unit']}" if parameter["unit"] else ""
            _print(
                f"{'':10}  {builder['id']}.{parameter['name']} = {parameter['default']:g}{unit} "
                f"({parameter['minimum']:g} to {parameter['maximum']:g}): "
                f"{parameter['description']}"
            )
    return 0


def _devices(arguments: argparse.Namespace) -> int:
    core = load()
    devices, embree = core.devices(), core.embree()
    if arguments.json:
        _print(json.dumps({"devices": devices, "embree": embree}, indent=1, ensure_ascii=False))
        return 0
    for device in devices:
        _print(f"{device['id']:<10} {device['name']}: {described(device)}")
    _print(f"{'embree':<10} {embree['version'] if embree['available'] else embree['reason']}")
    return 0


def _precisions(arguments: argparse.Namespace) -> int:
    choices = load().precisions()
    if arguments.json:
        _print(json.dumps(choices, indent=1, ensure_ascii=False))
        return 0
    for option, name in (
        ("--layouts", "layout"),
        ("--triangle-tests", "triangle_test"),
        ("--box-tests", "box_test"),
    ):
        for choice in choices[name]:
            _print(f"{option:<17} {choice['id']:<16}{choice['label']}: {choice['source']}")
    return 0
