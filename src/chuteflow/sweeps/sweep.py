"""A study on disk from Python: what ``chuteflow sweep`` does."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from chuteflow.processes import available_cores
from chuteflow.progress import report_progress
from chuteflow.sweeps.runner import local_workers, run
from chuteflow.sweeps.store import Store
from chuteflow.sweeps.study import Study, from_dict, read


def sweep(
    study: str | os.PathLike[str] | Mapping[str, Any] | Study,
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Compute what is left of a study into the Zarr store ``out``, whose path is returned: xarray opens it.

    What was interrupted goes on where it was with the same call. In a script, call it under
    ``if __name__ == "__main__":``, since its processes read the script again.

    Args:
        study: a TOML file, its table as a dictionary, or a study.
        out: the store to create or continue.
        workers: processes; one for each core by default.
        progress: called with the fraction that is done; without it, a terminal or notebook shows a line.

    Raises:
        InputError: for a study that is none, or a store that is of another one.
        StoreError: where the store cannot be written.
    """
    if isinstance(study, Mapping):
        study = from_dict(study, Path())
    elif not isinstance(study, Study):
        study = read(study)
    store = Store.made(out, study)
    with store.held(alone=True):
        left = [chunk for chunk in range(study.chunks) if not store.is_done(chunk)]
        store.mend()
        done = study.chunks - len(left)
        with report_progress("sweep", progress) as tell:
            for _ in run(store, left, local_workers(available_cores() if workers is None else workers)):
                done += 1
                tell(done / study.chunks)
    return store.path
