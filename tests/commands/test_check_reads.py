"""What `hrg check` reads of a file."""

import h5py
import numpy as np

from hrg_cli import store
from hrg_cli.records import Recording


def test_a_check_reads_what_its_limits_ask_for(hrg, tmp_path, monkeypatch):
    """A recording's samples stay on disk: no slice of them is read for a limit on their number."""
    n = 2_000
    run = Recording(c=np.zeros(n), s=np.ones(n), sample_rate_hz=1e4, mode="free")
    store.write(tmp_path / "run.h5", run)
    read = []
    true_read = h5py.Dataset.__getitem__

    def counted(dataset, rows, **more):
        read.extend([dataset.name] if dataset.size == n else [])
        return true_read(dataset, rows, **more)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", counted)
    given = tmp_path / "limits.toml"
    given.write_text(f"[recording]\nrows = {n}\n")
    done = hrg("check", tmp_path / "run.h5", "--limits", given, "--json")
    assert done.status == 0 and done.json["passed"] and not read
    shown = hrg("check", tmp_path / "run.h5", "--baseline", tmp_path / "run.h5").out
    assert "run.h5: nothing moved from the baseline" in shown and not read
