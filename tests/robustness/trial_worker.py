"""A process that tries damaged files: one line of JSON in ({task, path}), one out ({result, says,
peak_mb}).

Apart from the test, so that a crash or a hang of a library ends this process and not the tests.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import traceback
from pathlib import Path

import numpy as np

from hrg_cli import pipeline, settings, store
from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log, read_table
from hrg_cli.records import Record, Recording, collect
from hrg_cli.stages.simulation_file import list_runs

ADDRESS_SPACE = 8 << 30


def use_record(path: Path) -> None:
    """Read a file every way the commands do."""
    kind = store.find_kind(path)
    store.read(path, kind)
    with store.open_record(path, kind) as record:
        for block in first_blocks(record):
            assert isinstance(block, Record)
        if isinstance(record, Recording):
            record.times(0, 100)
            record.physical(max(0, len(record) - 100), len(record))


def first_blocks(record: Record):
    """At most a few blocks of a lazily opened record."""
    for count, block in enumerate(record.blocks(1 << 12)):
        if count == 8:
            return
        yield block


def run_chain(path: Path) -> None:
    """Demodulate and estimate; whatever happens, only whole outputs may be there."""
    with tempfile.TemporaryDirectory() as folder:
        periods, wave = Path(folder, "periods.h5"), Path(folder, "wave.h5")
        try:
            pipeline.run_stage(
                "demodulate",
                [path],
                periods,
                settings.check_settings(pipeline.STAGES["demodulate"].load_function(), {}),
            )
            pipeline.run_stage(
                "estimate",
                [periods],
                wave,
                settings.check_settings(pipeline.STAGES["estimate"].load_function(), {}),
            )
        finally:
            for left in Path(folder).iterdir():
                assert left in (periods, wave), f"a part was left: {left.name}"
                store.read_any(left)


def use_toml(path: Path) -> None:
    """A settings file, then the same as a simulation file."""
    tree = settings.load_toml(path)
    settings.to_toml(tree)
    list_runs(tree, str(path))


def use_log(path: Path) -> None:
    """A foreign log as a table and as a recording."""
    read_table(path)
    collect(import_log(path))


TASKS = {"record": use_record, "chain": run_chain, "toml": use_toml, "log": use_log}


def attempt(task: str, path: Path) -> dict[str, object]:
    """What came of one file."""
    try:
        with np.errstate(all="ignore"):
            TASKS[task](path)
        return {"result": "read"}
    except HrgError as error:
        text = str(error)
        sentence = "\n" not in text.strip() and len(text) < 2000
        return {"result": "refused" if sentence else "bad words", "says": text[:300]}
    except BaseException as error:
        return {
            "result": "defect",
            "says": f"{type(error).__name__}: {error}"[:200],
            "where": traceback.format_exc()[-1500:],
        }


def main() -> None:
    """Try files until the input ends."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    print(
        json.dumps(
            {
                "result": "ready",
                "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        ),
        flush=True,
    )
    for line in sys.stdin:
        asked = json.loads(line)
        answer = attempt(asked["task"], Path(asked["path"]))
        answer["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
