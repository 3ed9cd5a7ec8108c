"""Runs of one name: told apart by numbers, and said so."""

from synthetic_waves import run_down

from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.identify import identify

CASES = ((0.0, 0.0), (0.4, 1.5), (0.1, 2.0))


def test_both_commands_number_them_and_say_it():
    """Results named three runs "x" without a word."""
    waves = [
        run_down(theta, rate, seconds=2.0, seed=i, window=8e-3).replace(run_id="x")
        for i, (theta, rate) in enumerate(CASES)
    ]
    for found in (identify(waves), diagnose(waves, most_effects=0)):
        said = [why for why in found.status_reasons if "3 runs have the run_id 'x'" in why]
        assert len(said) == 1 and "give each its own" in said[0]
    assert identify(waves).run.tolist() == ["x", "x (2)", "x (3)"]
    named = [wave.replace(run_id=f"x{k}") for k, wave in enumerate(waves)]
    assert not any("run_id" in why for why in identify(named).status_reasons)
