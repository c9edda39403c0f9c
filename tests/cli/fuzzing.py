"""Command lines and damaged files at random, from a seed: what the fuzz tests try, and what they count as a fault."""

import os
import random
import signal
import struct
import traceback
from collections import Counter
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO

from chuteflow import InputError, load
from chuteflow.cli.program import main

#: Seconds of a processor that one command line, and the loading of one file, may take, and how busy it may be.
LIMIT, LOADING = 20, 5
_BUSY = 10

CHUTE = {"--slope": "0.3", "--e": "0.8", "--ew": "0.8", "--roughness": "0.6"}
#: Values that are of no use to most options.
STRANGE: tuple[str, ...] = (
    "", " ", "nan", "-nan", "inf", "-inf", "1e400", "-1e400", "1e-400", "0", "-0", "-1", "1" * 400, "9" * 5000, "0x10",
    "1_0", "1,5", "½", "٣", "3j", "True", "None", "[]", "{}", "--", "-", ":", "1:", ":1", "1:2:3", "2:1", "nan:nan",
    "0:inf", "1e-30:1e30", "x", "3x3x3", "x3", "0x0", "-1x4", "1e9x1", "1 m", "1 furlong", "1e400 m", "m", "1 kg/m/s",
    "1 m^99", "\x00", "a\x00b", "\udcff", "\ufeff1", "\u202e", "\n", "'; rm", "%s", "$HOME", "/", ".", "..",
    "/dev/null", "/dev/full/x.nc", "nowhere/x.csv", "x.nc/y.nc", "~", "x" * 300 + ".nc", ".nc", "x.NC", "x.zarr", "*",
    "ünï.csv",
)  # fmt: skip
NUMBERS = ("0.29", "0.36", "0.05", "0.7", "1", "0.5", "0.866", "3", "25", "1e-3", "1e3", "12.5", "0.9999999", "1e-9")
RANGES = ("0.29:0.31", "0.5:0.6", "0.7:0.8", "0.01:500", "0.1:1", "1e-3:1e5", "0.3:0.3", "0:0.05")
NAMES = ("free", "interface", "lun", "lun-fourier", "fold-Q", "fold-M", "density-inversion", "slope,Q", "e,h", "along")
FILES = ("a.nc", "a.csv", "a.json", "a.png", "a.svg", "a.pdf", "a.txt", "sub/a.nc", "a")
COUNTS = ("1", "2", "3", "4", "5", "10", "0", "-3", "1000000", "99999999999999999999")
SIZES = ("4x4", "2x2", "5x4", "1x1", "0x4", "99999x99999")
#: Options of each command, with what they are given most; those of use are kept cheap.
MATERIAL = {"--slope": NUMBERS, "--e": NUMBERS, "--ew": NUMBERS, "--roughness": NUMBERS, "--angle": NUMBERS}
LAW = {"--surface": NAMES, "--closure": NAMES}
CONDITION = {"--flux": NUMBERS, "--holdup": NUMBERS, "--depth": NUMBERS, "--temperature": NUMBERS}
SEARCH = {"--tolerance": ("1e-8", "1e-10", "1", "0"), "--search-temperature": RANGES, "--largest-holdup": NUMBERS}
OUTPUT = {"--json": None, "--plot": FILES, "--save": FILES}
SCALES = {"--diameter": ("1 mm", "0.001", "1"), "--density": ("2500", "2.5 g/cm^3"), "--gravity": NUMBERS}
COMMANDS = {
    "solve": MATERIAL | LAW | CONDITION | SEARCH | OUTPUT | SCALES,
    "curve": MATERIAL | LAW | SEARCH | OUTPUT | SCALES | {"--points": COUNTS[:6], "--samples": COUNTS},
    "hot": MATERIAL | LAW | {"--json": None},
    "boundary": {"--of": NAMES, "--in": NAMES, "--samples": ("2", "0", "-1"), "--slope": RANGES}
    | dict.fromkeys(("--e", "--ew", "--roughness"), NUMBERS) | LAW | OUTPUT,
    "domain": {"--size": SIZES, "--temperature": NUMBERS, "--tolerance": ("0.1", "0", "1"), "--processes": ("1", "0")}
    | dict.fromkeys(("--ew", "--roughness"), (*RANGES, *NUMBERS)) | OUTPUT,
    "stability": MATERIAL | CONDITION | {"--kx": NUMBERS, "--ky": NUMBERS, "--modes": COUNTS} | OUTPUT,
    "growth": MATERIAL | CONDITION | {"--kx": RANGES, "--ky": RANGES, "--size": SIZES, "--flow": COUNTS} | OUTPUT,
    "neutral": MATERIAL | {"--waves": NAMES, "--kh": RANGES, "--size": SIZES} | OUTPUT,
    "relax": MATERIAL | CONDITION
    | {"--flow": COUNTS, "--heat": NUMBERS, "--push": NUMBERS, "--duration": ("1", "20", "0", "-1")} | OUTPUT,
    "claims": {"--only": ("moderate-density", "99"), "--section": NUMBERS, "--list": None, "--json": None}
    | {"--out": FILES},
    "figures": {"--only": ("99", "0", "2,,3", "-1"), "--out": FILES, "--format": NAMES, "--method": NAMES},
    "report": {"--only": ("99", "x"), "--method": NAMES, "--no-claims": None},
    "sweep": {"--out": FILES, "--workers": ("0", "-1"), "--chunks": RANGES, "--dry-run": None, "--status": None},
    "explore": MATERIAL | LAW | SCALES | {"--flux": NUMBERS, "--export": FILES, "--search-temperature": RANGES}
    | {"--port": ("-1", "99999", "x"), "--host": ("", "no such host", "\x00")},
}  # fmt: skip
#: Commands that take seconds where their input is good: they are given something bad, most of the time.
SLOW = [name for name in COMMANDS if name not in ("solve", "curve", "hot")]
#: What keeps commands from work of minutes, or from serving a page.
INSTEAD = {
    "figures": ("--only", ("99", "0", "2,,3", "-1", "x")),
    "report": ("--only", ("99", "0", "2,,3", "-1", "x")),
    "claims": ("--only", ("moderate-density", "99", "?")),
    "explore": ("--port", ("-1", "99999", "x")),
    "growth": ("--size", SIZES),
    "neutral": ("--size", SIZES),
}


def command_line(dice: random.Random) -> list[str]:
    """One command line: of a good one, options dropped, added, doubled, and given values of other kinds."""
    name = dice.choice([*COMMANDS, "solve", "solve", "curve"])
    options = COMMANDS[name]
    line = [name]
    if dice.random() < 0.03:
        line = [dice.choice(("", "-", "--help", "solv", "SOLVE", *STRANGE))]
    chosen: dict[str, str | None] = {}
    chosen |= {option: value for option, value in CHUTE.items() if option in options and dice.random() < 0.98}
    if "--flux" in options and dice.random() < 0.8:
        chosen["--flux"] = "3"
    for option in dice.sample(list(options), min(dice.randrange(4), len(options))):
        known = options[option]
        chosen[option] = (
            None if known is None else dice.choice(known if dice.random() < (0.6 if name in SLOW else 0.8) else STRANGE)
        )
    if name in SLOW and dice.random() < 0.97:
        chosen[dice.choice([option for option, known in options.items() if known is not None])] = dice.choice(STRANGE)
    if name in INSTEAD:
        option, values = INSTEAD[name]
        chosen[option] = dice.choice(values)
    for option, value in chosen.items():
        line += [option] if value is None else [f"{option}={value}"] if dice.random() < 0.3 else [option, value]
    if dice.random() < 0.05:
        line.insert(dice.randrange(len(line) + 1), dice.choice(STRANGE))
    if dice.random() < 0.05:
        line.insert(dice.randrange(len(line) + 1), dice.choice(line))
    return line


def damaged(whole: bytes, dice: random.Random) -> bytes:
    """The bytes of a file with some damage: bits flipped, parts cut, doubled, moved or overwritten."""
    data = bytearray(whole)
    kind = dice.randrange(9)
    place = dice.randrange(len(data))
    length = min(1 << dice.randrange(12), len(data) - place)
    if kind == 0:
        for _ in range(1 << dice.randrange(6)):
            data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    elif kind == 1:
        del data[place:]
    elif kind == 2:
        del data[place : place + length]
    elif kind == 3:
        data[place:place] = data[place : place + length]
    elif kind == 4:
        data[place : place + length] = bytes(length)
    elif kind == 5:
        data[place : place + length] = dice.randbytes(length)
    elif kind == 6:
        data[place : place + 8] = struct.pack("<q", dice.choice((-1, 2**31, 2**62, 2**63 - 1)))
    elif kind == 7:
        data[place:place] = dice.choice(
            (b"[" * 10**5, b'{"a":' * 10**4, b"9" * 6000, b"NaN", b"-", b"\0", b'"', b"1e999")
        )
    else:
        lines = whole.split(b"\n")
        dice.shuffle(lines)
        return b"\n".join(lines)
    return bytes(data)


class TooSlow(BaseException):
    """Something took longer than it may."""


@contextmanager
def time_limit(seconds: int):
    """End the block after so many seconds of this process, or after many more of the clock, on a busy machine too."""

    def late(*_):
        raise TooSlow

    before = signal.signal(signal.SIGPROF, late), signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.alarm(_BUSY * seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before[0])
        signal.signal(signal.SIGALRM, before[1])


def fault_of_command(line: list[str]) -> tuple[str, int | None]:
    """What is wrong with how the command line ended, or nothing, and its exit code."""
    out, err = StringIO(), StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err), time_limit(LIMIT):
            code = main(line)
    except TooSlow:
        return "slow", None
    except BaseException as error:  # noqa: BLE001 - whatever comes out is what is looked for
        return "".join(traceback.format_exception_only(error)) + last_line(error), None
    said = err.getvalue()
    if code not in (0, 1, 2):
        return f"exit code {code}", code
    if code and len(said.splitlines()) != 1 and "%" not in said:
        return f"{len(said.splitlines())} lines: {said[:300]!r}", code
    if "Traceback" in said or "Warning" in said:
        return said, code
    if "nan" in out.getvalue().split() and "--json" in line:
        return "nan", code
    return "", code


def fault_of_file(path, same) -> tuple[str, str]:
    """What is wrong with how a damaged file is loaded, or nothing, and how it ended; ``same`` is for what it holds."""
    try:
        with time_limit(LOADING):
            found = load(path)
    except InputError as error:
        message = str(error)
        return ("" if len(message.splitlines()) == 1 else f"several lines: {message}"), "refused"
    except TooSlow:
        return "slow", ""
    except BaseException as error:  # noqa: BLE001 - whatever comes out is what is looked for
        return "".join(traceback.format_exception_only(error)) + last_line(error), ""
    return ("" if same(found) else "damage that was not noticed"), "loaded"


def last_line(error: BaseException) -> str:
    """Where in the package an error came from."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "chuteflow" in frame.filename]
    return f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno} {frames[-1].line}" if frames else ""


def try_command_lines(count: int, seed: int) -> tuple[list[str], Counter]:
    """Faults of ``count`` command lines, and how often each exit code came."""
    dice = random.Random(seed)
    faults, codes = [], Counter()
    for _ in range(count):
        line = command_line(dice)
        fault, code = fault_of_command(line)
        codes["slow" if fault == "slow" else code] += 1
        if fault:
            faults.append(f"{line}: {fault}")
    return faults, codes


def try_files(wholes, same, folder, count: int, seed: int) -> tuple[list[str], Counter]:
    """Faults of ``count`` damaged copies of the files ``wholes``, made in ``folder``, and how often each end came.

    ``same(whole, found)`` is whether what was loaded is what the whole file holds.
    """
    dice = random.Random(seed)
    faults, ends = [], Counter()
    contents = [path.read_bytes() for path in wholes]
    for i in range(count):
        k = i % len(wholes)
        path = folder / f"damaged{wholes[k].suffix}"
        path.write_bytes(damaged(contents[k], dice))
        fault, end = fault_of_file(path, lambda found, k=k: same(wholes[k], found))
        ends[end or fault] += 1
        if fault:
            kept = folder / f"fault_{i}{path.suffix}"
            path.replace(kept)
            faults.append(f"{kept}: {fault}")
    return faults, ends
