"""Records of arrays that belong together entry by entry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class AlignedArrays:
    """Arrays whose first axis counts the same entries; those named in ``BY_COLUMN`` have them second, (rows, k)."""

    BY_COLUMN: ClassVar[tuple[str, ...]] = ()

    def take(self, which: NDArray[Any]) -> Self:
        """The entries ``which``, by a mask or by indices."""
        return self._made({name: of[:, which] if axis else of[which] for name, axis, of in self._arrays()})

    def and_all(self, others: Sequence[AlignedArrays]) -> Self:
        """These entries, and after them those of the ``others``."""
        return self._made(
            {
                name: np.concatenate([of, *(getattr(other, name) for other in others)], axis=axis)
                for name, axis, of in self._arrays()
            }
        )

    def _arrays(self) -> list[tuple[str, int, NDArray[Any]]]:
        return [(f.name, int(f.name in self.BY_COLUMN), getattr(self, f.name)) for f in fields(self)]

    def _made(self, arrays: dict[str, Any]) -> Self:
        return replace(self, **arrays)
