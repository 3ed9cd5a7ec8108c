"""One pick-off that was recorded as both channels of one run: no physics is asked for."""

from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose


def test_the_run_is_named():
    """It was looked for among causes and other mistakes for minutes, and nothing was named."""
    records = recordings(programme(4, runs=4, noise=3e-4), 4)
    records[2] = records[2].replace(s=records[2].c)
    waves = estimated(records)
    assert [wave.status for wave in waves] == ["valid", "valid", "suspect", "valid"]
    found = diagnose(waves)
    assert found.status == "refused"
    assert [(one["run_id"], one["what"]) for one in found.told("suspect_runs")] == [
        (waves[2].run_id, "one pick-off recorded as both channels")
    ]
