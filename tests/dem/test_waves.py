"""Waves in simulations: rate and frequency of what is known, and of the run of the study that has one."""

from pathlib import Path

import numpy as np
import pytest

from chuteflow import Chute, flows, stability_of
from chuteflow.cli.program import main
from chuteflow.dem import script
from chuteflow.dem.run import prepare
from chuteflow.dem.script import Schedule
from chuteflow.dem.waves import Amplitudes, amplitudes, format_csv, growth, read_amplitudes
from chuteflow.errors import InputError

DATA = Path(__file__).resolve().parents[2] / "docs" / "measured" / "waves"


def made(rate, frequency, noise=0.0, times=None):
    """A wave that runs to both sides, one side stronger, and noise."""
    t = np.arange(40.0, 140.0) if times is None else times
    random = np.random.default_rng(1)
    right, left = np.exp((rate + 1j * frequency) * t), np.exp((rate - 1j * frequency) * t)
    scatter = noise * random.normal(size=(4, t.size)) * np.exp(rate * t.mean())
    density = 0.02 * (right + 0.4j * left + scatter[0] + 1j * scatter[1])
    return Amplitudes(t, density, 3.0 * (0.2 * right - left + scatter[2] + 1j * scatter[3]), 0.13)


@pytest.mark.parametrize(("rate", "frequency"), [(0.02, 0.11), (-0.01, 0.2), (0.0, 0.07)])
def test_rate_and_frequency_of_a_wave_come_back(rate, frequency):
    found = growth(made(rate, frequency))
    assert (found.rate, found.frequency) == pytest.approx((rate, frequency), abs=1e-8)
    assert found.explained == pytest.approx(1.0)
    found = growth(made(rate, frequency, noise=0.3))
    assert (found.rate, found.frequency) == pytest.approx((rate, frequency), abs=4e-3)
    assert 0.7 < found.explained < 0.98


def driven(rate, frequency, seed):
    """A wave that runs to both sides, driven by noise, as one reads it off grains."""
    random = np.random.default_rng(seed)
    times = np.arange(80.0)
    factors = np.exp([rate + 1j * frequency, rate - 1j * frequency])
    noise = 0.02 * random.normal(size=(80, 2, 2)).view(complex)[..., 0]
    states = [0.3 * random.normal(size=(2, 2)).view(complex)[..., 0]]
    for one in noise[1:]:
        states.append(factors * states[-1] + one)
    right, left = np.array(states).T
    return Amplitudes(times, right + left, 3.0 * (0.2 * right - left), 0.13)


def test_errors_of_rates_count_the_noise_that_drives_the_wave():
    found = [growth(driven(0.02, 0.11, seed)) for seed in range(12)]
    off = np.array([[one.rate - 0.02, one.frequency - 0.11] for one in found])
    errors = np.array([[one.rate_error, one.frequency_error] for one in found])
    # 95 of 100 within two errors, with room for chance; and errors are no larger than it takes.
    assert (np.abs(off) < 2.0 * errors).mean() > 0.75
    assert (np.sqrt(np.mean(off**2, axis=0)) > 0.5 * errors.mean(axis=0)).all()


def test_a_wave_of_a_run_is_that_of_its_box(small, tmp_path):
    run = prepare(tmp_path / "run", small, Schedule(settle=2.0, measure=50.0, block=1.0))
    t = np.arange(1, 41) * run.steps.line
    wave = made(0.03, 0.4, times=t * run.steps.step)
    rows = [
        f"{step} 9 9 9 9 {a.real!r} {-a.imag!r} {b.real!r} {-b.imag!r}"
        for step, a, b in zip(t, wave.density.tolist(), wave.momentum.tolist(), strict=True)
    ]
    (run.folder / script.WAVES).write_text("# averages\n" + "\n".join(rows) + "\n")
    found = amplitudes(run, "across")
    assert found.wavenumber == pytest.approx(2.0 * np.pi / small.size[1])
    assert growth(found).rate == pytest.approx(0.03, abs=1e-6)
    assert np.abs(amplitudes(run, "along").density - (9 - 9j)).max() == 0.0
    with pytest.raises(InputError, match="choose one of along, across"):
        amplitudes(run, "up")


def test_the_command_tells_writes_and_reads_waves(tmp_path, capsys):
    path = tmp_path / "waves.csv"
    path.write_text(format_csv(made(0.02, 0.11)))
    assert main(["dem", "waves", str(path), "--from", "60", "--save", str(tmp_path / "again.csv")]) == 0
    out = capsys.readouterr().out
    assert "rate 0.02 ± " in out
    assert "frequency 0.11 ± " in out
    np.testing.assert_allclose(read_amplitudes(tmp_path / "again.csv").density, made(0.02, 0.11).density, rtol=1e-4)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    for words, said in (
        ([str(path), "--from", "130"], "at least 20 are needed"),
        ([str(path), "--direction", "along"], "is for a folder"),
        ([str(tmp_path / "other.csv")], "holds no waves"),
        ([str(tmp_path / "missing.csv")], "cannot read"),
        ([str(tmp_path)], "holds no run"),
    ):
        assert main(["dem", "waves", *words]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the data of the study are part of the repository, not of the package")
@pytest.mark.parametrize(
    ("name", "chute", "velocity"),
    [
        # r is what gives the theory's flow the mean velocity that the particles have while the wave grows.
        ("wide-12", Chute(0.22, 0.93, 0.93, 0.6275, closure="garzo-dufty-fourier"), 17.3),
        ("wide-14", Chute(0.25, 0.9, 0.9, 0.6183, closure="garzo-dufty-fourier"), 14.45),
    ],
)
def test_waves_of_the_study_grow_as_the_theory_says_of_flows_of_their_flux(name, chute, velocity):
    waves = read_amplitudes(DATA / f"{name}.csv")
    flow = flows(chute, M=3.0)[0]
    assert flow.mass_flux / flow.mass_holdup == pytest.approx(velocity, rel=2e-3)
    mode = stability_of(flow, kx=0.0, ky=waves.wavenumber).mode
    assert mode is not None
    found = growth(waves.within(20.0, 100.0))
    # One wave of either, driven by the noise of the grains.
    assert found.rate == pytest.approx(mode.growth, abs=found.rate_error)
    assert 2e-3 < found.rate_error < 0.012
    assert found.frequency == pytest.approx(abs(mode.frequency), rel=0.05)
    # Then it is as large as it becomes.
    later = growth(waves.within(140.0, 400.0))
    assert later.rate < 0.2 * found.rate
