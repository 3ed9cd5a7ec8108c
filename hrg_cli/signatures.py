"""Detached signatures of released files: Ed25519 over the file's bytes, raw in FILE.sig.

Checksums tell that a file was changed, a signature by whom it cannot have been: only who holds the
private key could make it. Keys are PEM files, as `openssl genpkey -algorithm ed25519` makes them,
and `openssl pkeyutl -verify -pubin -inkey KEY -rawin -in FILE -sigfile FILE.sig` checks the same.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from . import store
from .errors import HrgError

SIZE = 64
"""Bytes of a signature."""
LARGEST = 1 << 30
"""Bytes of a file that is signed: it is read whole, as the algorithm asks."""
LARGEST_KEY = 1 << 16


def place_signature(path: Path) -> Path:
    """Where the signature of a file lies: beside it.

    Parameters
    ----------
    path
        The file, FILE.

    Returns
    -------
    Path
        FILE.sig.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.signatures import place_signature
    >>> place_signature(Path("calibration.h")).name
    'calibration.h.sig'
    """
    return path.with_name(f"{path.name}.sig")


def read_private_key(path: Path) -> Any:
    """A private key, to sign with.

    Parameters
    ----------
    path
        A PEM file without a password.

    Returns
    -------
    Ed25519PrivateKey
        Of the library.

    Raises
    ------
    HrgError
        There is none in the file, or one under a password or of another algorithm.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.signatures import read_private_key
    >>> try:
    ...     read_private_key(Path("nowhere.pem"))
    ... except HrgError as error:
    ...     print(error)
    nowhere.pem: cannot be read (No such file or directory); name a file that is there and readable
    """
    from_pem = _library().load_pem_private_key
    key = _loaded(path, lambda text: from_pem(text, password=None), "private")
    return _of_kind(path, key, "sign", "private")


def read_public_key(path: Path) -> Any:
    """A public key, to check with.

    Parameters
    ----------
    path
        A PEM file.

    Returns
    -------
    Ed25519PublicKey
        Of the library.

    Raises
    ------
    HrgError
        There is none in the file, or one of another algorithm.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.signatures import read_public_key
    >>> try:
    ...     read_public_key(Path("nowhere.pem"))
    ... except HrgError as error:
    ...     print(error)
    nowhere.pem: cannot be read (No such file or directory); name a file that is there and readable
    """
    return _of_kind(
        path, _loaded(path, _library().load_pem_public_key, "public"), "verify", "public"
    )


def sign(path: Path, key: Any, force: bool = False) -> Path:
    """Write the signature of a file beside it.

    Parameters
    ----------
    path
        The file.
    key
        A private key.
    force
        A signature that is there may be replaced.

    Returns
    -------
    Path
        The signature.

    Raises
    ------
    HrgError
        The file is too large or cannot be read, or a signature is there.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    >>> from hrg_cli.signatures import sign
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "calibration.h"
    ...     _ = file.write_text("/* table */")
    ...     made = sign(file, Ed25519PrivateKey.generate())
    ...     print(made.name, made.stat().st_size)
    calibration.h.sig 64
    """
    made = place_signature(path)
    with store.write_whole(made, force) as temporary:
        temporary.write_bytes(key.sign(_content(path)))
    return made


def need_signed(path: Path, key: Any) -> None:
    """Refuse a file that the key's owner did not sign.

    Parameters
    ----------
    path
        The file, whose signature lies beside it.
    key
        A public key.

    Raises
    ------
    HrgError
        There is no signature, or another one.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.signatures import need_signed, sign
    >>> key = Ed25519PrivateKey.generate()
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "calibration.h"
    ...     _ = file.write_text("/* table */")
    ...     _ = sign(file, key)
    ...     need_signed(file, key.public_key())
    ...     _ = file.write_text("/* another */")
    ...     try:
    ...         need_signed(file, key.public_key())
    ...     except HrgError:
    ...         print("was changed")
    was changed
    """
    from cryptography.exceptions import InvalidSignature

    beside = place_signature(path)
    if not beside.is_file():
        raise HrgError(
            f"{path}: is not signed ({beside} is not there); get its signature from who released"
            " it, or export without --verify-with"
        )
    try:
        key.verify(_read(beside, SIZE), _content(path))
    except InvalidSignature as error:
        raise HrgError(
            f"{path}: the signature {beside} is not that of this file by this key; the file was"
            " changed after its release, or another key signed it"
        ) from error


def _library() -> Any:
    from cryptography.hazmat.primitives import serialization

    return serialization


def _loaded(path: Path, load: Any, kind: str) -> Any:
    try:
        return load(_read(path, LARGEST_KEY))
    except (ValueError, TypeError) as error:
        raise HrgError(
            f"{path}: holds no {kind} key that can be read (PEM without a password was expected);"
            " make one with: openssl genpkey -algorithm ed25519"
        ) from error
    except Exception as error:  # the library's own for an algorithm that it does not know
        if type(error).__name__ != "UnsupportedAlgorithm":
            raise
        raise HrgError(f"{path}: holds a key of an unknown algorithm; use Ed25519") from error


def _of_kind(path: Path, key: Any, does: str, kind: str) -> Any:
    if "Ed25519" not in type(key).__name__ or not hasattr(key, does):
        raise HrgError(
            f"{path}: holds a {kind} key of another algorithm; Ed25519 was expected: openssl"
            " genpkey -algorithm ed25519"
        )
    return key


def _content(path: Path) -> bytes:
    return _read(path, LARGEST)


def _read(path: Path, most: int) -> bytes:
    """The bytes of a file of at most this size. HrgError: larger, or not to be read."""
    try:
        size = path.stat().st_size
        if size > most:
            raise HrgError(
                f"{path}: has {size} bytes, at most {most} were expected; sign the table, not the"
                " recordings"
            )
        return path.read_bytes()
    except OSError as error:
        raise HrgError(
            f"{path}: cannot be read ({error.strerror}); name a file that is there and readable"
        ) from error
