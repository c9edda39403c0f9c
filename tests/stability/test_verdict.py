"""Which flows are stable, and what grows fastest."""

import pytest

from chuteflow import stability_of


@pytest.mark.parametrize(
    ("name", "direction", "growth", "wavenumber"),
    [
        ("A", "across", 3.969606e-3, 0.010051),
        ("B", "across", 1.02525e-3, 0.012621),
        ("C", "along", 7.27575e-3, 0.01109),
    ],
)
def test_the_fastest_growing_mode_of_the_three_flows_of_the_paper(three, name, direction, growth, wavenumber):
    found = stability_of(three[name])
    assert not found.stable
    assert found.mode.direction == direction
    assert found.mode.growth == pytest.approx(growth, rel=2e-5)
    assert max(found.mode.kx, found.mode.ky) == pytest.approx(wavenumber, rel=1e-2)
    assert found.searched[0] < found.mode.kx + found.mode.ky < found.searched[1]
