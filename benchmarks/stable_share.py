"""How many of a random sample of flows are stable, and what grows where they are not.

Run as ``python benchmarks/stable_share.py``; about two seconds for each flow. Chutes and surface temperatures are drawn
with a fixed seed, so that the sample is the same each time; the hottest two flows of each are examined.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

import numpy as np

from chuteflow import Chute, Flow, flows, stability_of


def drawn(seed: int, draws: int) -> Iterator[Flow]:
    """Flows of chutes with parameters spread evenly, and ln T_surface too."""
    random = np.random.default_rng(seed)
    for _ in range(draws):
        e, ew, roughness = random.uniform(0.6, 0.95), random.uniform(0.5, 0.95), random.uniform(0.5, 0.866)
        slope, temperature = random.uniform(0.2, 0.55), 10.0 ** random.uniform(-1.0, 1.0)
        slope, e, ew, roughness = (round(float(value), 3) for value in (slope, e, ew, roughness))
        yield from flows(Chute(slope, e, ew, roughness), T_surface=round(float(temperature), 3))[:2]


def kind(flow: Flow) -> str:
    """ "stable", the direction of what grows fastest, or "unknown"."""
    found = stability_of(flow)
    if found.stable is None:
        return "unknown"
    return "stable" if found.stable or found.mode is None else found.mode.direction


def main() -> None:
    options = argparse.ArgumentParser(description="Share of stable flows in a random sample.")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--draws", type=int, default=82)
    given = options.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    for flow in drawn(given.seed, given.draws):
        counts[flow.density, kind(flow)] += 1
    for (density, label), count in sorted(counts.items()):
        print(f"{density:10} {label:10} {count}")


if __name__ == "__main__":
    main()
