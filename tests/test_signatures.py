"""Signatures of released files: only the key's owner can make them, any change breaks them, and
OpenSSL agrees."""

import shutil
import subprocess
import sys

import pytest
import records_by_hand
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519

from hrg_cli import store

PEM = serialization.Encoding.PEM


def write_keys(folder, name, key):
    private = key.private_bytes(
        PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    public = key.public_key().public_bytes(PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
    (folder / f"{name}.pem").write_bytes(private)
    (folder / f"{name}.pub").write_bytes(public)


@pytest.fixture
def release(tmp_path, hrg):
    """A table released with a signature, and the keys of two people."""
    for name in ("owner", "other"):
        write_keys(tmp_path, name, ed25519.Ed25519PrivateKey.generate())
    table = tmp_path / "calibration.h5"
    store.write(table, records_by_hand.calibration())
    signed = hrg("verify", table, "--sign-with", tmp_path / "owner.pem", "--json")
    assert signed.status == 0, signed.err
    return table


def test_a_released_table_is_exported_and_its_export_signed(release, hrg):
    folder, out = release.parent, release.parent / "table.h"
    keys = ("--verify-with", folder / "owner.pub", "--sign-with", folder / "owner.pem")
    assert hrg("export", release, "-o", out, *keys).status == 0
    assert len((folder / "table.h.sig").read_bytes()) == 64
    again = hrg("export", release, "-o", out, *keys)
    assert again.status == 1 and "exists already" in again.err
    assert hrg("export", release, "-o", out, *keys, "--force").status == 0


@pytest.mark.parametrize("change", ["file", "signature", "key", "none"])
def test_what_its_owner_did_not_release_is_not_exported(change, release, hrg):
    folder, beside = release.parent, release.with_name("calibration.h5.sig")
    if change == "file":
        store.write(release, records_by_hand.calibration(nodes=4), force=True)
    elif change == "signature":
        beside.write_bytes(bytes([beside.read_bytes()[0] ^ 1]) + beside.read_bytes()[1:])
    elif change == "none":
        beside.unlink()
    key = folder / ("other.pub" if change == "key" else "owner.pub")
    left = hrg("export", release, "-o", folder / "t.csv", "--verify-with", key)
    assert left.status == 1 and not (folder / "t.csv").exists()
    said = "is not signed" if change == "none" else "is not that of this file by this key"
    assert said in left.err and str(release) in left.err


def test_only_what_is_whole_is_signed(release, hrg):
    import h5py

    beside = release.with_name("calibration.h5.sig")
    beside.unlink()
    with h5py.File(release, "r+") as file:
        file["calibration/drift_rad_s"][0, 0] += 1e-9
    assert hrg("verify", release, "--sign-with", release.parent / "owner.pem").status == 3
    assert not beside.exists()


def test_keys_of_another_kind_are_refused_in_a_sentence(release, hrg):
    folder = release.parent
    write_keys(folder, "curve", ec.generate_private_key(ec.SECP256R1()))
    for flag, key, says in (
        ("--verify-with", "owner.pem", "no public key"),
        ("--verify-with", "curve.pub", "another algorithm"),
        ("--sign-with", "owner.pub", "no private key"),
        ("--sign-with", "curve.pem", "another algorithm"),
        ("--sign-with", "calibration.h5", "no private key"),
        ("--sign-with", "nothing.pem", "cannot be read"),
    ):
        left = hrg("export", release, "-o", folder / "t.csv", flag, folder / key)
        assert left.status == 1 and says in left.err and left.err.count("\n") == 1, left.err
        assert not (folder / "t.csv").exists()


def test_without_the_library_a_sentence_says_what_to_install(release, hrg, monkeypatch):
    monkeypatch.setitem(sys.modules, "cryptography.hazmat.primitives", None)
    key = release.parent / "owner.pub"
    left = hrg("export", release, "-o", release.parent / "t.csv", "--verify-with", key)
    assert left.status == 1 and "pip install 'hrg-cli[signing]'" in left.err


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")
def test_openssl_agrees(release):
    words = ["openssl", "pkeyutl", "-verify", "-pubin", "-inkey", "owner.pub", "-rawin"]
    files = ["-in", release.name, "-sigfile", f"{release.name}.sig"]
    done = subprocess.run([*words, *files], cwd=release.parent, capture_output=True, check=False)
    assert done.returncode == 0, done
