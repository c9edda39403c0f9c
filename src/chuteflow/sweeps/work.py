"""What a worker does: one chunk, computed and written."""

from __future__ import annotations

import time
from contextlib import suppress

from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.store import DamageError, Marker, Store


def work(path: str, chunk: int) -> Marker:
    """Compute chunk number ``chunk`` of the store at ``path`` and write it; nothing, where it is done and sound."""
    store = Store.opened(path)
    with suppress(DamageError):
        return store.checked(chunk)
    begin = time.perf_counter()
    solved = solve_chunk(store.study, chunk)
    marker = Marker(
        chunk=chunk,
        points=len(solved.status),
        flows=int(solved.n_flows.sum()),
        singly=solved.singly,
        seconds=round(time.perf_counter() - begin, 3),
        failures=dict(solved.failures),
    )
    return store.put(chunk, solved.arrays(), marker)
