"""What LAMMPS does with the input that is written for it: collisions, energy, forces, balances, and whole runs."""

import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from chuteflow.cli.program import main
from chuteflow.dem import averages, output, script
from chuteflow.dem.contacts import MASS, PAIR_MASS, Bounds, Contacts
from chuteflow.dem.measured import measure
from chuteflow.dem.output import Frame
from chuteflow.dem.run import go_on, prepare
from chuteflow.dem.scene import Scene
from chuteflow.dem.script import Schedule, contact_lines
from chuteflow.steady.chute import Chute

from .conftest import CHUTE_WORDS

HEAD = """units lj
atom_style sphere
atom_modify map array
boundary {boundary}
newton off
comm_modify vel yes
"""


def simulate(lammps, folder, lines):
    """Run the input of ``lines``; what LAMMPS printed."""
    (folder / "test.in").write_text("\n".join(lines) + "\n")
    command = [*lammps.command, "-in", "test.in", "-log", "none"]
    done = subprocess.run(command, cwd=folder, env=lammps.environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    return done.stdout


@pytest.mark.parametrize("bump", [False, True], ids=["grains", "bump"])
@pytest.mark.parametrize("e", [0.8, 0.9, 0.95, 1.0])
def test_a_collision_of_two_grains_has_its_restitution(lammps, tmp_path, e, bump):
    contacts = Contacts(5e4, e, e)
    step, speed = contacts.time_step, 1.3
    lines = [
        HEAD.format(boundary="f f f"),
        "region box block -5 5 -5 5 -5 5",
        "create_box 2 box",
        # Where within a time step the contact begins is changed from one pair to the next.
        *(f"create_atoms {2 if bump else 1} single -0.5 0 {4 * k - 4}" for k in range(3)),
        *(f"create_atoms 1 single {0.505 + 0.31 * k * speed * step!r} 0 {4 * k - 4}" for k in range(3)),
        "set group all diameter 1 density 1",
        "group base type 2",
        "group grains type 1",
        "neighbor 0.3 bin",
        "neigh_modify every 1 delay 0 check yes",
        *contact_lines(contacts),
        f"timestep {step!r}",
        *(["fix base base freeze"] if bump else []),
        "fix motion grains nve",
        *(f"set atom {4 + k} vx {-speed}" for k in range(3)),
        "thermo 100000",
        f"run {math.ceil(0.01 / (speed * step)) + 4 * round(contacts.duration / step)}",
        *(f'print "PARTED $(vx[{4 + k}]-vx[{1 + k}])"' for k in range(3)),
    ]
    out = simulate(lammps, tmp_path, lines)
    parted = [float(line.split()[1]) / speed for line in out.splitlines() if line.startswith("PARTED")]
    assert len(parted) == 3
    assert max(abs(value - e) for value in parted) < 1e-3


def gas(count, size, seed):
    """Grains that do not touch, at rest in the mean."""
    random = np.random.default_rng(seed)
    side = math.ceil(count ** (1 / 3))
    sites = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:count]
    velocity = random.normal(size=(count, 3))
    return (sites + 0.5) * size / side, velocity - velocity.mean(axis=0)


def test_an_elastic_box_keeps_its_energy(lammps, tmp_path):
    size, count = 6.5, 125
    contacts = Contacts(2e4, 1.0, 1.0)
    position, velocity = gas(count, size, 1)
    lines = [
        HEAD.format(boundary="p p p"),
        f"region box block 0 {size} 0 {size} 0 {size}",
        "create_box 2 box",
        *(f"create_atoms 1 single {x!r} {y!r} {z!r}" for x, y, z in position.tolist()),
        "set group all diameter 1 density 1",
        *(f"set atom {i} vx {u!r} vy {v!r} vz {w!r}" for i, (u, v, w) in enumerate(velocity.tolist(), 1)),
        "neighbor 0.3 bin",
        "neigh_modify every 1 delay 0 check yes",
        *contact_lines(contacts),
        f"timestep {contacts.time_step!r}",
        "fix motion all nve",
        "thermo 100000",
        f"dump states all custom 10000 {script.CONTACTS} id type x y z vx vy vz",
        "dump_modify states sort id format float %.15g",
        "run 100000",
    ]
    simulate(lammps, tmp_path, lines)
    energies = []
    frames = list(output.read_frames(tmp_path / script.CONTACTS, -1))
    for frame in frames:
        away = frame.position[:, None] - frame.position[None]
        away -= size * np.round(away / size)
        distance = np.sqrt((away**2).sum(axis=2))[np.triu_indices(count, 1)]
        overlap = np.maximum(1.0 - distance, 0.0)
        energies.append(0.5 * MASS * (frame.velocity**2).sum() + 0.5 * contacts.stiffness * (overlap**2).sum())
    assert len(energies) == 11
    moved = np.linalg.norm(frames[-1].velocity - velocity) / np.linalg.norm(velocity)
    assert moved > 0.5
    assert np.abs(np.array(energies) / energies[0] - 1.0).max() < 1e-4


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_forces_are_those_of_lammps(lammps, tmp_path, friction):
    random = np.random.default_rng(5)
    scene = Scene(Chute(0.2, 0.9, 0.7, 0.6), 1.0, box=(6.0, 6.0), friction=friction, stiffness=1e4)
    position = random.uniform([0, 0, 0.4], [*scene.size, 3.0], (60, 3))
    velocity, spin = random.normal(scale=3.0, size=(2, 60, 3))
    bumps = [(1.0, 1.0), (2.5, 4.0), (4.0, 2.0), (5.0, 5.0)]
    lines = [
        HEAD.format(boundary="p p f"),
        f"region box block 0 {scene.size[0]!r} 0 {scene.size[1]!r} -2 6",
        "create_box 2 box",
        *(f"create_atoms 1 single {x!r} {y!r} {z!r}" for x, y, z in position.tolist()),
        *(f"create_atoms 2 single {x} {y} 0" for x, y in bumps),
        "set group all diameter 1 density 1",
        "group base type 2",
        "group grains type 1",
        *(
            f"set atom {i} vx {u[0]!r} vy {u[1]!r} vz {u[2]!r} omega {w[0]!r} {w[1]!r} {w[2]!r}"
            for i, (u, w) in enumerate(zip(velocity.tolist(), spin.tolist(), strict=True), 1)
        ),
        "neighbor 0.3 bin",
        "neigh_modify every 1 delay 0 exclude group base base",
        *contact_lines(scene.contacts),
        # With the ghosts of the fix that freezes bumps, their mass does not count.
        "fix base base freeze",
        "dump forces all custom 1 forces.dump id fx fy fz",
        "dump_modify forces sort id format float %.15g",
        "run 0",
    ]
    simulate(lammps, tmp_path, lines)
    rows = (tmp_path / "forces.dump").read_text().splitlines()[9:]
    theirs = np.array([row.split()[1:] for row in rows], dtype=float)[:60]
    place = np.vstack([position, [(*bump, 0.0) for bump in bumps]])
    frame = Frame(
        0,
        np.arange(64),
        np.arange(64) >= 60,
        place,
        np.vstack([velocity, np.zeros((4, 3))]),
        np.vstack([spin, np.zeros((4, 3))]),
    )
    found = averages.pair_contacts(scene, frame)
    # By heights, the forces that each contact gives its grains.
    ours = np.zeros((64, 3))
    for force, low, high in zip(found.force, found.low, found.high, strict=True):
        ours[np.argmin(np.abs(place[:, 2] - high))] += force
        if low != 0.0:
            ours[np.argmin(np.abs(place[:, 2] - low))] -= force
    assert np.abs(theirs).max() > 100.0
    np.testing.assert_allclose(ours[:60], theirs, rtol=1e-6, atol=1e-5 * np.abs(theirs).max())


WORDS = [*CHUTE_WORDS, *["--holdup", "0.6", "--box", "6x6", "--restitution-error", "0.01", "--block", "1"]]


def test_a_chute_is_simulated_from_its_options_to_the_comparison(lammps, tmp_path, capsys):
    del lammps
    folder = str(tmp_path / "run")
    assert main(["dem", "run", *WORDS, "--settle", "4", "--measure", "10", "--out", folder]) == 0
    told = capsys.readouterr().out
    assert "M = 0.6" in told
    assert main(["compare", f"{folder}/run.nc", "--with", "lun"]) == 0
    assert "equation of state g1" in capsys.readouterr().out


@pytest.mark.slow
def test_momentum_and_energy_balance(lammps, tmp_path):
    """In a run that has settled, stresses are the weight above, and what gravity brings is lost in collisions."""
    del lammps
    scene = Scene(
        Chute(0.18, 0.95, 0.95, 0.6),
        1.264,
        box=(8.0, 8.0),
        temperature=6.7,
        velocity=6.2,
        bounds=Bounds(restitution=5e-3),
    )
    run = prepare(tmp_path / "run", scene, Schedule(settle=300.0, measure=300.0))
    for _ in go_on(run):
        pass
    found = measure(run)
    inside = (found.fraction_above > 0.1) & (found.fraction_above < 0.9)
    p, slope = found.fields["overburden"], found.slope
    for name, weight in (("normal_stress", 1.0), ("shear_stress", slope)):
        off = found.fields[name] - weight * p
        within = 4.0 * np.hypot(found.errors[name], weight * found.errors["overburden"]) + 0.01 * weight * p
        assert (np.abs(off) < within)[inside].all(), name
    numbers, errors = found.numbers, found.number_errors
    gap = numbers["gravity_work"] - numbers["whole_dissipation"]
    assert abs(gap) < 4.0 * errors["whole_dissipation"] + 0.02 * numbers["gravity_work"]
    assert numbers["base_normal_stress"] == pytest.approx(found.holdup, abs=4.0 * errors["base_normal_stress"])
    assert found.notes["largest_overlap"] < 0.05


@pytest.mark.slow
def test_a_run_that_is_killed_goes_on_with_the_same_statistics(lammps, tmp_path):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    del lammps
    arguments = [*WORDS[:-2], "--settle", "20", "--measure", "60", "--block", "2"]
    assert main(["dem", "run", *arguments, "--out", str(whole)]) == 0
    started = subprocess.Popen([sys.executable, "-m", "chuteflow", "dem", "run", *arguments, "--out", str(parts)])
    totals = parts / script.TOTALS
    until = time.monotonic() + 60.0
    while time.monotonic() < until and not (totals.exists() and totals.read_text().count("\n") > 30):
        time.sleep(0.02)
    started.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
    started.wait()
    assert 30 < totals.read_text().count("\n") < 82
    assert main(["dem", "run", *arguments, "--out", str(parts)]) == 0
    from chuteflow.dem import records

    one, other = records.load(whole / "run.nc"), records.load(parts / "run.nc")
    assert other.notes["measured_time"] == one.notes["measured_time"]
    for name in ("mass_flux", "mean_temperature", "centre_of_mass"):
        error = math.hypot(one.number_errors[name], other.number_errors[name])
        assert abs(one.numbers[name] - other.numbers[name]) < 4.0 * error, name


def test_the_effective_mass_of_two_grains_is_half_of_one():
    assert pytest.approx(MASS / 2.0) == PAIR_MASS
