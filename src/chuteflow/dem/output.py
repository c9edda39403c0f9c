"""What LAMMPS has written: layers.txt, totals.txt, waves.txt and contacts.dump, also of resumed runs.

A run that goes on from a restart file repeats what came after it: of two records of one step the later counts. What is
incomplete at the end of a file is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.dem.script import MOMENTS, SUMS, WAVE_PARTS
from chuteflow.errors import InputError

#: An array of numbers, whole numbers or truth values.
Array = NDArray[Any]
#: Lines before the grains of a frame.
_HEAD = 9
#: Numbers in a line of contacts.dump, without and with rotation.
_COLUMNS = (8, 11)


@dataclass(frozen=True, eq=False)
class Layers:
    """Means over the blocks that end at ``steps`` (b,): ``count`` (b, k) grains in each bin, and ``moments``
    (b, k, 9) of their velocities, see :data:`chuteflow.dem.script.MOMENTS`."""

    steps: Array
    count: Array
    moments: Array


@dataclass(frozen=True, eq=False)
class Frame:
    """The grains and bumps that touch something at one step."""

    step: int
    identity: Array
    is_bump: Array
    position: Array
    velocity: Array
    spin: Array | None


def read_layers(path: Path) -> Layers:
    """The blocks of layers.txt in order.

    Raises:
        InputError: for a file that is missing or none of these.
    """
    blocks: dict[int, Array] = {}
    lines = _lines(path)
    at = 0
    while at < len(lines):
        head = lines[at].split()
        if lines[at].startswith("#") or len(head) != 3:
            at += 1
            continue
        step, bins = int(head[0]), int(head[1])
        rows = lines[at + 1 : at + 1 + bins]
        if len(rows) == bins:
            block = np.array(" ".join(rows).split(), dtype=float)
            if block.size != bins * (3 + len(MOMENTS)):
                raise InputError(f"{path}: the block of step {step} is damaged")
            blocks[step] = block.reshape(bins, -1)
        at += 1 + bins
    if not blocks:
        raise InputError(f"{path}: it holds no block yet; the run has to go on for longer")
    steps = sorted(blocks)
    # The layers of a run that was made longer may reach up further than before.
    fewest = min(len(block) for block in blocks.values())
    whole = np.array([_with_layers(blocks[step], fewest) for step in steps])
    return Layers(np.array(steps), whole[:, :, 2], whole[:, :, 3:])


def _with_layers(block: Array, count: int) -> Array:
    """A block (k, columns) with the grains of layer ``count`` and of all above it in one, as the highest layer has."""
    above = block[count - 1 :]
    grains = above[:, 2].sum()
    block = block[:count].copy()
    if grains > 0.0:
        block[-1, 2] = grains
        block[-1, 3:] = above[:, 2] @ above[:, 3:] / grains
    return block


def read_totals(path: Path) -> tuple[Array, Array]:
    """Steps (n,) and sums (n, 6) of totals.txt in order, see :data:`chuteflow.dem.script.SUMS`.

    Raises:
        InputError: for a file that is missing or none of these.
    """
    return _series(path, len(SUMS))


def read_waves(path: Path) -> tuple[Array, Array]:
    """Steps (n,) and means (n, 8) of waves.txt in order, see :data:`chuteflow.dem.script.WAVE_PARTS`.

    Raises:
        InputError: for a file that is missing or none of these.
    """
    return _series(path, len(WAVE_PARTS))


def _series(path: Path, columns: int) -> tuple[Array, Array]:
    found: dict[int, list[float]] = {}
    for line in _lines(path):
        words = line.split()
        if len(words) == 1 + columns and not line.startswith("#"):
            found[int(words[0])] = [float(word) for word in words[1:]]
    steps = sorted(found)
    return np.array(steps), np.array([found[step] for step in steps]).reshape(-1, columns)


def read_frames(path: Path, after: int) -> Iterator[Frame]:
    """The frames of contacts.dump later than step ``after``, each step once, in order.

    Raises:
        InputError: for a file that is missing or damaged.
    """
    places: dict[int, tuple[int, int]] = {}
    lines = _lines(path)
    at = 0
    while at + _HEAD <= len(lines):
        if lines[at] != "ITEM: TIMESTEP":
            raise InputError(f"{path}: line {at + 1} should begin a frame")
        step, count = int(lines[at + 1]), int(lines[at + 3])
        if at + _HEAD + count <= len(lines):
            places[step] = (at + _HEAD, count)
        at += _HEAD + count
    for step in sorted(places):
        if step > after:
            first, count = places[step]
            yield _frame(path, step, lines[first : first + count])


def _frame(path: Path, step: int, rows: list[str]) -> Frame:
    values = np.array(" ".join(rows).split(), dtype=float)
    width = values.size // len(rows) if rows else _COLUMNS[0]
    if width not in _COLUMNS or values.size != width * len(rows):
        raise InputError(f"{path}: the frame of step {step} is damaged")
    values = values.reshape(-1, width)
    return Frame(
        step=step,
        identity=values[:, 0].astype(int),
        is_bump=values[:, 1] == 2.0,
        position=values[:, 2:5],
        velocity=values[:, 5:8],
        spin=values[:, 8:11] if width == _COLUMNS[1] else None,
    )


def trim(folder: Path, names: tuple[str, ...]) -> None:
    """Cut off what is incomplete at the end of files, so that a resumed run may append to them."""
    for name in names:
        path = folder / name
        if path.exists():
            with path.open("r+b") as file:
                file.truncate(_complete(path.read_bytes()))


def _complete(content: bytes) -> int:
    """The length of the records that are whole: lines, blocks of lines, or frames."""
    end = content.rfind(b"\n") + 1
    last = content.rfind(b"ITEM: TIMESTEP\n", 0, end)
    if last >= 0:
        lines = content[last:end].split(b"\n")
        whole = len(lines) > _HEAD and len(lines) - 1 >= _HEAD + int(lines[3])
        return end if whole else last
    # A block of layers.txt: the last line of three words, and as many lines as it says.
    start = max((at for at in _starts_of_blocks(content, end)), default=None)
    if start is not None:
        lines = content[start:end].split(b"\n")
        if len(lines) - 1 < 1 + int(lines[0].split()[1]):
            return start
    return end


def _starts_of_blocks(content: bytes, end: int) -> Iterator[int]:
    at = end
    while (found := content.rfind(b"\n", 0, at - 1) + 1 if at > 1 else -1) >= 0 and at > 0:
        words = content[found:at].split()
        if len(words) == 3 and not words[0].startswith(b"#"):
            yield found
            return
        if found == 0:
            return
        at = found


def _lines(path: Path) -> list[str]:
    """The lines that are whole."""
    try:
        return path.read_text(encoding="ascii", errors="replace").split("\n")[:-1]
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
