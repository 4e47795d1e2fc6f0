"""Ground motions: read from the formats of the field, made by a seeded generator, scaled, cut, corrected."""

from mrwork.motions.baseline import baseline_corrected
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.processing import scaled, scaled_to_peak, time_scaled, trimmed
from mrwork.motions.read import read_motion, read_motions
from mrwork.motions.resampling import resampled, resampled_band_limited
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi
from mrwork.motions.spectrum import ResponseSpectrum, response_spectrum
from mrwork.motions.synthetic import synthetic_motion

__all__ = [
    "CloughPenzien",
    "GroundMotion",
    "KanaiTajimi",
    "ResponseSpectrum",
    "baseline_corrected",
    "read_motion",
    "read_motions",
    "resampled",
    "resampled_band_limited",
    "response_spectrum",
    "scaled",
    "scaled_to_peak",
    "synthetic_motion",
    "time_scaled",
    "trimmed",
]
