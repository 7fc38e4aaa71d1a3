# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutates small files and reads them: .npz, .obj, .ply, results.json, plans, pictures.

    fuzz_files.py [--runs N] [--seconds S] [--seed N] [TARGET ...]

Each must be read or refused in the documented way. Another exception, a crash, ten seconds or more
than four gigabytes of memory are a finding: the bytes are left in out/fuzz/ and the exit status is
not 0. The same seed gives the same files. ``corpus/TARGET/`` holds the files that it starts from,
among them all that once were a finding; they are read as they are first.
"""

from __future__ import annotations

import argparse
import dataclasses
import faulthandler
import random
import resource
import signal
import sys
import time
import typing
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from bvh_lab.native import core
from bvh_lab.study.load import LoadError, load_mesh_file
from bvh_lab.study.plan import Plan
from bvh_lab.study.results import Result

HERE = Path(__file__).resolve().parent
FINDINGS = HERE.parents[1] / "out" / "fuzz"
SECONDS_A_FILE = 10
MOST_BYTES = 4 << 30
LONGEST = 16384  # bytes of a mutated file

# What headers and texts of these formats are made of, and numbers at the ends of their ranges.
TOKENS = [
    *(b"0 1 -1 2 3 4 255 256 65535 65536 2147483647 2147483648 4294967295 4294967296".split()),
    *(b"9223372036854775807 18446744073709551616 1000000000000 1e308 1e-320 nan inf -inf".split()),
    *(b"v vn vt f l g o s usemtl mtllib / // \\ # ply format element vertex face property".split()),
    *(b"list uchar int float double char short ushort uint ascii binary_little_endian".split()),
    *(b"binary_big_endian 1.0 end_header comment vertex_indices texcoord x y z red".split()),
    *(b"<f4 <f8 >f4 <i4 <u4 |O |S1 |b1 <c8 shape descr fortran_order True False".split()),
    *(b'null true false [] {} [ ] { } ( ) , : "" NaN Infinity -Infinity 1e999'.split()),
    *(
        b"\0\0\0\0 \xff\xff\xff\xff \x7f\xff\xff\xff \xff\xff\xff\x7f \0\0\0\x80 \n \r\n \t".split(
            b" "
        )
    ),
]


def mutated(seeds: list[bytes], source: random.Random) -> bytes:
    """One of the seeds after one to eight changes at random places."""
    data = bytearray(source.choice(seeds)[:LONGEST])
    for _ in range(source.randint(1, 8)):
        at, length = source.randint(0, len(data)), source.choice([1, 1, 2, 4, 16, 64])
        kind = source.randrange(7)
        if kind == 0:  # change a bit
            if at < len(data):
                data[at] ^= 1 << source.randrange(8)
        elif kind == 1:
            data[at : at + length] = source.randbytes(length)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + length] * source.choice([1, 2, 16])
        elif kind == 4:
            data[at:at] = source.choice(TOKENS)
        elif kind == 5:
            token = source.choice(TOKENS)
            data[at : at + len(token)] = token
        else:  # the tail of another
            other = source.choice(seeds)
            data[at:] = other[source.randint(0, len(other)) :]
    return bytes(data[:LONGEST])


def read_mesh(path: Path) -> bool:
    """A mesh file gives a scene that the core takes, or LoadError with a sentence."""
    try:
        scene = load_mesh_file(path)
    except LoadError as error:
        assert str(path) in str(error), "the message does not name the file"
        assert len(str(error)) < 2000, "the message is no sentence"
        return False
    mesh = core.Mesh(scene.vertices, scene.triangles)
    core.build(mesh, "lbvh").validate()
    return True


def read_record(kind: type[Result] | type[Plan], path: Path) -> bool:
    """A text gives a record that is written and read back as it is, or ValueError."""
    try:
        record = kind.from_json(path.read_text(encoding="utf-8"))
    except ValueError as error:
        assert 0 < len(str(error)) < 2000, "the message is no sentence"
        return False
    assert kind.from_json(record.to_json()) == record
    return True


def read_picture(path: Path) -> bool:
    """A picture gives a texture that can be looked up, or RuntimeError."""
    try:
        texture = core.Texture.read(str(path))
    except RuntimeError as error:
        assert str(path) in str(error), "the message does not name the file"
        return False
    texture.look_up([[0.3, 0.7]])
    return True


TARGETS: dict[str, Callable[[Path], bool]] = {
    "npz": read_mesh,
    "obj": read_mesh,
    "ply": read_mesh,
    "results": lambda path: read_record(Result, path),
    "plan": lambda path: read_record(Plan, path),
    "png": read_picture,
    "exr": read_picture,
    "jpg": read_picture,
    "hdr": read_picture,
    "tif": read_picture,
}


PLANS = {Result: {"plan": Plan()}}


def sample(kind: Any) -> Any:
    """A value of that type: a record with all that it must have, lists with one item."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is list:
        return [sample(arguments[0])]
    if origin is dict:
        return {"a": sample(arguments[1])}
    if arguments:  # a union
        return sample(arguments[0])
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        given = {field.name for field in dataclasses.fields(kind)} - {"plan", "format"}
        return kind(**{name: sample(hints[name]) for name in given}, **PLANS.get(kind, {}))
    return {str: "a", int: 1, float: 0.5, bool: True}.get(kind)


def files(name: str, source: random.Random) -> Iterator[bytes]:
    """The corpus as it is, and then mutations of it for ever."""
    seeds = [path.read_bytes() for path in sorted((HERE / "corpus" / name).iterdir())]
    seeds += [text.encode() for text in RECORDS.get(name, [])]
    yield from seeds
    while True:
        yield mutated(seeds, source)


RECORDS = {"plan": [Plan().to_json()], "results": [sample(Result).to_json()]}


def fuzz(name: str, runs: int, seconds: float, seed: int) -> None:
    """Read files until one of the limits is met; stops at the first finding."""
    FINDINGS.mkdir(parents=True, exist_ok=True)
    path = FINDINGS / f"finding.{name}"
    read = TARGETS[name]
    start, taken, done = time.monotonic(), 0, 0
    for data in files(name, random.Random(f"{name} {seed}")):
        if done >= runs or time.monotonic() - start > seconds:
            break
        path.write_bytes(data)
        signal.alarm(SECONDS_A_FILE)
        taken += read(path)
        signal.alarm(0)
        done += 1
    path.unlink(missing_ok=True)
    print(f"{name}: {done} files, {taken} of them readable, {time.monotonic() - start:.1f} s")
    if not 0 < taken < done:
        sys.exit(f"{name}: nothing was read, or nothing refused: this shows nothing")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--runs", type=int, default=sys.maxsize, help="files of each target")
    parser.add_argument("--seconds", type=float, default=1e9, help="for each target")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    for name in arguments.targets:
        if name not in TARGETS:
            parser.error(f"unknown target {name!r}; there are: {', '.join(TARGETS)}")
    faulthandler.enable()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # kills, also in the middle of foreign code
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    warnings.simplefilter("ignore")
    for name in arguments.targets or TARGETS:
        try:
            fuzz(name, arguments.runs, arguments.seconds, arguments.seed)
        except Exception:
            print(f"fuzz_files: the finding is {FINDINGS / f'finding.{name}'}", file=sys.stderr)
            raise


if __name__ == "__main__":
    main()
