"""Motions of a study by record and intensity, as incremental dynamic analysis has them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mrwork.base.summary import list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.motions.spectrum import Intensity

# Intensities of one level agree to so many decimals [m/s^2].
_DECIMALS = 9


@array_dataclass()
class RecordLevels:
    """Records with rising levels of intensity.

    Parameters
    ----------
    records, measures
        Names of the records, and what intensities are measures of, in words; of levels that compare it is one.
    levels
        Levels [m/s^2], shape (n_levels,).
    places
        Index of the motion of each record at each level, -1 where there is none, shape (n_records, n_levels).
    """

    records: tuple[str, ...]
    measures: tuple[str, ...]
    levels: Floats
    places: NDArray[np.int64]

    @staticmethod
    def of(motions: Mapping[int, tuple[str, Intensity]]) -> RecordLevels:
        """Those of motions by their index, each given by its record and its intensity."""
        records = tuple(dict.fromkeys(record for record, _ in motions.values()))
        values = [round(intensity.value, _DECIMALS) for _, intensity in motions.values()]
        levels, columns = np.unique(values, return_inverse=True)
        places = np.full((len(records), levels.size), -1, dtype=np.int64)
        for (motion, (record, _)), column in zip(motions.items(), columns, strict=True):
            places[records.index(record), column] = motion
        measures = tuple(dict.fromkeys(intensity.name for _, intensity in motions.values()))
        return RecordLevels(records=records, measures=measures, levels=levels, places=places)

    @property
    def is_full(self) -> bool:
        """Whether every record has every level of one measure, of which there are several."""
        return len(self.measures) == 1 and self.levels.size > 1 and bool((self.places >= 0).all())

    @property
    def measure(self) -> str:
        """The one measure of all intensities, refused where there are several."""
        if len(self.measures) > 1:
            raise SettingError(
                f"the motions have intensities of several measures, {list_names(self.measures)}; scale all to a pga, "
                "or all to an sa of one sa_period and sa_damping"
            )
        return self.measures[0]
