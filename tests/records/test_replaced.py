"""A linear resonator in doubt beside the diagnosis that explains it: `hrg run` and `hrg check` say
the same."""

from dataclasses import replace

import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.chain import Step
from hrg_cli.commands.run import _judge
from hrg_cli.records import REHEARSAL, Source
from hrg_cli.records.replaced import EXTENDED, find_replaced

WAVES = tuple(Source(f"{k}.wave.h5", "wave", str(k) * 64) for k in range(2))
LIMITS = (
    '[resonator]\nscale_factor = { minimum = 0.2, maximum = 0.3 }\n[diagnosis]\nstatus = "valid"'
)


def made_of(record, sources, **more):
    provenance = replace(record.provenance, sources=sources)
    return record.replace(provenance=provenance, gyro_id="A", **more)


def results(*, waves=WAVES, verdict="explained", reason="it leaves more than the noise"):
    linear = made_of(by_hand.resonator(), waves).judged([reason], "suspect")
    diagnosis = made_of(by_hand.diagnosis(), WAVES, verdict=verdict)
    extended = made_of(by_hand.resonator(), (), method=EXTENDED)
    return [linear, diagnosis, extended]


def test_a_resonator_that_a_diagnosis_explains_gives_way_to_the_diagnosis_own():
    assert find_replaced(results()) == [0]


@pytest.mark.parametrize(
    "records",
    [
        results()[:2],
        results()[::2],
        results(waves=(*WAVES, Source("c.wave.h5", "wave", "c" * 64))),
        results(waves=()),
        results(verdict="partly explained"),
        results(reason=f"{REHEARSAL}its errors are too small"),
    ],
    ids=["own not at hand", "no diagnosis", "other waves", "unknown waves", "open", "rehearsal"],
)
def test_any_other_one_stays(records):
    assert find_replaced(records) == []


def test_run_and_check_agree_on_it(tmp_path, hrg):
    """`hrg run` ended valid, and `hrg check` on its results with 3."""
    names = ["resonator.h5", "diagnosis.h5", "diagnosis.extended_resonator.h5"]
    for name, record in zip(names, results(), strict=True):
        store.write(tmp_path / name, record)
    (tmp_path / "limits.toml").write_text(LIMITS)
    files = [tmp_path / name for name in names]
    told = hrg("check", *files, "--limits", tmp_path / "limits.toml")
    assert told.status == 0
    assert "resonator.h5: suspect by itself, and not held" in told.out + told.err
    alone = hrg("check", files[0], "--limits", tmp_path / "limits.toml")
    assert alone.status == 3
    steps = [
        Step("identify", (), names[0], "suspect", ("it leaves more than the noise",)),
        Step("diagnose", (), names[1], "valid", (), {"verdict": "explained"}),
    ]
    run = _judge(steps, [])
    assert run["status"] == "valid"
    assert any("diagnosis.extended_resonator.h5" in reason for reason in run["status_reasons"])
