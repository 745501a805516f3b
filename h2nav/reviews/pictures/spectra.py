"""Pictures of vibration by frequency: spectra, and their change over the flight."""

import numpy as np
from numpy.typing import NDArray

from h2nav.reviews.analysis import Analysis
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.picture import Curves, Heat, Picture, PictureMark, Section, Trace
from h2nav.reviews.tracks import Spectrum

# White is this much quieter than black.
RANGE_DB = 50.0
MAX_MARKS = 4


def spectra(analysis: Analysis) -> Section:
    """The first IMU's gyro and accelerometer at once, the others on demand."""
    first = min((spectrum.imu for spectrum in analysis.spectra), default=0)
    return Section(
        "spectra",
        "Vibration by frequency",
        _pictures([one for one in analysis.spectra if one.imu == first]),
        further=_pictures([one for one in analysis.spectra if one.imu != first]),
    )


def _pictures(spectra: list[Spectrum]) -> tuple[Picture, ...]:
    return (*(_over_time(one) for one in spectra), *(_mean(one) for one in spectra))


def _name(spectrum: Spectrum) -> str:
    return f"{spectrum.sensor} of IMU {spectrum.imu + 1}"


def _over_time(spectrum: Spectrum) -> Heat:
    source = "bursts at the sensor's own rate" if spectrum.is_burst else "samples as recorded"
    about = (
        f"Dark is strong. Motors and propellers are lines that follow the throttle. From {source}, "
        f"{spectrum.rate_hz:.0f} per second; what is above {0.5 * spectrum.rate_hz:.0f} Hz shows "
        "mirrored below it."
    )
    return Heat(
        f"Spectrogram: {_name(spectrum)}",
        about,
        spectrum.t_s,
        float(spectrum.frequency_hz[-1]) if len(spectrum.frequency_hz) else 1.0,
        shades(spectrum.levels),
    )


def shades(levels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(T, F) densities in decibels of their largest, 255 = the largest, 0 = 50 dB less or none."""
    if not np.isfinite(levels).any() or np.nanmax(levels) <= 0.0:
        return np.zeros(levels.shape, np.uint8)
    # A single column, such as a hard landing, must not turn the rest of the flight white.
    largest = np.nanpercentile(levels, 99.9)
    share = np.nan_to_num(levels / (largest or np.nanmax(levels)), nan=0.0)
    decibel = 20.0 * np.log10(np.maximum(share, 1e-12))
    shade: NDArray[np.float64] = np.clip(255.0 * (1.0 + decibel / RANGE_DB), 0.0, 255.0)
    return shade.astype(np.uint8)


def _mean(spectrum: Spectrum) -> Curves:
    traces = tuple(
        Trace(axis, colour, np.maximum(spectrum.density[:, k], 1e-9).astype(np.float32))
        for k, (axis, colour) in enumerate(
            zip(("forward", "right", "down"), colours.NUMBERED[:3], strict=True)
        )
    )
    marks = tuple(
        PictureMark(peak.frequency_hz, f"{peak.frequency_hz:.0f} Hz")
        for peak in spectrum.peaks[:MAX_MARKS]
    )
    return Curves(
        f"Mean spectrum: {_name(spectrum)}",
        "Peaks are frequencies at which the frame shakes, by axis of the body.",
        f"{spectrum.unit}/√Hz",
        "Hz",
        spectrum.frequency_hz,
        traces,
        marks,
        digits=5,
        is_logarithmic=True,
    )
