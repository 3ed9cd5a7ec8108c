"""WAV and FLAC (libsndfile): raw integers stay integers, full scale is 1."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import HrgError
from .log import BLOCK_ROWS, Blocks, Channel, Log, Reader

SUBTYPES = {
    "PCM_16": ("int16", 2.0**-15, 0),
    "PCM_S8": ("int16", 2.0**-7, 8),
    "PCM_U8": ("int16", 2.0**-7, 8),
    "PCM_24": ("int32", 2.0**-23, 8),
    "PCM_32": ("int32", 2.0**-31, 0),
}
"""Sample format -> (type it is read as, value of a raw count, bits to shift down after libsndfile's
scaling up)."""


def _recognises(path: Path, head: bytes) -> bool:
    """RIFF/RF64 … WAVE, or fLaC (after an ID3 tag too)."""
    return (head[:4] in (b"RIFF", b"RF64", b"RIFX") and head[8:12] == b"WAVE") or head[
        :4
    ] == b"fLaC"


def _open_audio(path: Path) -> Log:
    """The channels of a sound file. HrgError: damaged, or fewer frames stored than its header
    claims."""
    import soundfile

    try:
        with soundfile.SoundFile(path) as sound:
            channels, rate, frames, subtype = (
                sound.channels,
                sound.samplerate,
                sound.frames,
                sound.subtype,
            )
    except (soundfile.LibsndfileError, RuntimeError, OSError) as error:
        raise _damaged(path, error) from error
    claimed = _claimed_frames(path)
    if claimed is not None and claimed > frames:
        raise HrgError(
            f"{path}: its header claims {claimed} frames, {frames} are stored; it is truncated:"
            " copy or record it again"
        )
    if frames <= 0 or channels <= 0 or rate <= 0:
        raise HrgError(
            f"{path}: holds no samples ({frames} frames, {channels} channels at {rate} Hz); record"
            " it again"
        )
    dtype, scale, shift = SUBTYPES.get(
        subtype, ("float32" if subtype == "FLOAT" else "float64", 1.0, 0)
    )
    rows = max(1024, BLOCK_ROWS // channels)
    names = ["left", "right"] if channels == 2 else [f"channel {i + 1}" for i in range(channels)]
    return Log(
        format="audio",
        channels=tuple(Channel(name, "1", scale_factor=scale) for name in names),
        read=lambda indexes: _read_frames(path, indexes, frames, rows, dtype, shift),
        rows=frames,
        sample_rate_hz=float(rate),
        where=lambda row: f"frame {row + 1}",
    )


def _read_frames(
    path: Path, indexes: Sequence[int], frames: int, rows: int, dtype: str, shift: int
) -> Blocks:
    """Blocks of so many rows, the asked channels of each. HrgError: damaged, or fewer frames than
    claimed."""
    import soundfile

    seen = 0
    try:
        with soundfile.SoundFile(path) as sound:
            while True:
                block = sound.read(rows, dtype=dtype, always_2d=True)
                if len(block) == 0:
                    break
                seen += len(block)
                if shift:  # libsndfile scales narrow samples up to their word
                    block = np.right_shift(block, shift)
                yield [np.ascontiguousarray(block[:, i]) for i in indexes]
    except (soundfile.LibsndfileError, RuntimeError, OSError) as error:
        raise _damaged(path, error) from error
    if seen != frames:
        raise HrgError(
            f"{path}: {frames} frames are claimed, {seen} could be read; it is truncated: copy"
            " or record it again"
        )


def _damaged(path: Path, error: Exception) -> HrgError:
    said = str(error).splitlines()[0].split(": ")[-1][:120] if str(error) else type(error).__name__
    return HrgError(
        f"{path}: cannot be read as WAV or FLAC ({said.rstrip('.')}); copy or record it again"
    )


def _claimed_frames(path: Path) -> int | None:
    """Frames a WAV's own header claims (libsndfile silently trusts the file's length instead); None
    where it does not say."""
    with open(path, "rb") as file:
        head = file.read(12)
        if head[:4] != b"RIFF":
            return None
        align = 0
        for _ in range(64):
            chunk = file.read(8)
            if len(chunk) < 8:
                return None
            size = int.from_bytes(chunk[4:], "little")
            if chunk[:4] == b"fmt ":
                fmt = file.read(min(size, 40))
                align = int.from_bytes(fmt[12:14], "little")
                file.seek(size + size % 2 - len(fmt), 1)
            elif chunk[:4] == b"data":
                return size // align if align and size not in (0, 0xFFFFFFFF, 0x7FFFFFFF) else None
            else:
                file.seek(size + size % 2, 1)
    return None


READER = Reader("audio", _recognises, _open_audio)
