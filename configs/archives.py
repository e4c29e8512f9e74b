"""Untrusted archives, unpacked within bounds: zip files, and arrays in them."""

import io
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .errors import ConfigError
from .reading import MIB, parsing, read_bytes

ARCHIVE_BYTES = 64 * MIB
UNPACKED_BYTES = 128 * MIB
MEMBERS = 1000
_CHUNK = MIB
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENTRY = b"PK\1\2"  # begins every entry of a zip file's directory


class Archive:
    """A zip file whose members together are at most 128 MiB, as they declare and as they are.

    Args:
        data: the bytes of the file.
        source: its path, and the member that it is in another archive; errors begin with it.

    Raises:
        ConfigError: no zip file, one of more than 1000 members, or of another method than deflate,
            one that unpacks to more.
    """

    def __init__(self, data: bytes, source: str | Path):
        self.source = source
        if data.count(_ENTRY) > MEMBERS:  # before a directory of a million entries is read
            raise ConfigError(f"holds more than {MEMBERS} files", source=source)
        with parsing(source):
            self._zip = zipfile.ZipFile(io.BytesIO(data))
        self.names = tuple(self._zip.namelist())
        infos = self._zip.infolist()
        if any(info.compress_type not in _METHODS or info.flag_bits & 1 for info in infos):
            raise ConfigError("is packed by another method than deflate", source=source)
        if sum(info.file_size for info in infos) > UNPACKED_BYTES:
            raise ConfigError(f"unpacks to more than {UNPACKED_BYTES / MIB:g} MiB", source=source)

    def read(self, name: str) -> bytes:
        """A member, read in pieces, at most as many bytes as declared; raises ConfigError."""
        with parsing(self.source):
            size, pieces = self._zip.getinfo(name).file_size, []
            with self._zip.open(name) as member:
                while piece := member.read(_CHUNK):
                    pieces.append(piece)
                    size -= len(piece)
                    if size < 0:
                        raise ConfigError(f"{name} is larger than declared", source=self.source)
        return b"".join(pieces)


def read_archive(path: str | Path) -> Archive:
    """Return a zip file of at most 64 MiB; raises ConfigError as `Archive`."""
    return Archive(read_bytes(path, ARCHIVE_BYTES), path)


def read_arrays(path: str | Path, names: Sequence[str], kinds: str = "f") -> dict[str, np.ndarray]:
    """Arrays of 32- or 64-bit numbers from an .npz file, as 64-bit floats.

    Args:
        kinds: of numbers, as NumPy's dtypes name them: floats, or whole ones (``fiu``), too.

    Raises:
        ConfigError: no such file, no such array, one that is cut off, or one of another type.
    """
    archive = read_archive(path)
    arrays = {}
    for name in names:
        with parsing(path):
            arrays[name] = _array(archive.read(f"{name}.npy"), name, kinds)
    return arrays


def read_names(path: str | Path, name: str) -> tuple[str, ...]:
    """Return the texts of an array in an .npz file; () where it has none of that name.

    Raises ConfigError for an array of something else.
    """
    archive = read_archive(path)
    if f"{name}.npy" not in archive.names:
        return ()
    with parsing(path):
        values = np.load(io.BytesIO(archive.read(f"{name}.npy")), allow_pickle=False)
        if values.dtype.kind != "U" or values.ndim != 1:
            raise ValueError(f"{name} must be texts, not {values.dtype}")
        return tuple(map(str, values))


def _array(data: bytes, name: str, kinds: str) -> np.ndarray:
    """Return the array in an .npy file; raises ValueError for what is none of floats."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):  # what NumPy writes of plain arrays
        raise ValueError(f"{name} is of another version of .npy than 1.0")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    if dtype.kind not in kinds or dtype.itemsize not in (4, 8):
        what = "floats" if kinds == "f" else "numbers"
        raise ValueError(f"{name} must be of 32- or 64-bit {what}, not {dtype}")
    if any(length < 0 for length in shape):
        raise ValueError(f"{name} has the shape {shape}")
    values = np.frombuffer(data, dtype, offset=file.tell())
    return values.reshape(shape, order="F" if fortran else "C").astype(float)
