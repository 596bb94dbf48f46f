"""WAV: sound, read by scipy; each channel is a column of plain numbers, full scale is 1."""

from __future__ import annotations

import io
import warnings

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Column, Table


def _tables(path: str, data: bytes) -> list[Table]:
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings(action="ignore", category=wavfile.WavFileWarning):  # chunks of other programs
            rate_hz, samples = wavfile.read(io.BytesIO(data))
    except Exception as error:
        # A damaged file may raise any exception in scipy's parser.
        problem = f"scipy cannot read the sound ({' '.join(str(error).split())[:200] or type(error).__name__})"
        raise FormatError(path, problem, "export it as WAV with PCM of 16 bits") from error
    if not rate_hz > 0 or not samples.size:
        raise FormatError(path, "expected a sound with samples and a rate, got none", "export it again")
    whole = samples.dtype.kind in "iu"
    numbers = samples.astype(np.float64).reshape(samples.shape[0], -1)
    if samples.dtype == np.uint8:
        numbers -= 128.0
    if whole:
        numbers /= 2.0 ** (8 * samples.dtype.itemsize - 1)
    columns = tuple(Column(f"channel {at}", "1", column) for at, column in enumerate(numbers.T, 1))
    return [Table(columns, formula=Formula(0.0, 1.0 / rate_hz), beside=columns)]


FORMAT = ColumnFormat(
    "wav",
    "WAV: sound, each channel a column of plain numbers",
    lambda head: "it begins with the bytes of a WAV file" if head[:4] == b"RIFF" and head[8:12] == b"WAVE" else "",
    _tables,
)
