"""A run whose signals are clipped while the others', larger ones among them, are not."""

import re

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.effects.effect import Effect, Parameter
from hrg_cli.stages.diagnose import diagnose, summarise

RUN, LEVEL = 3, 0.63


def clip(p, readout):
    """Before the converter's noise, so that no samples repeat."""
    readout.steps.append(lambda block, y: np.clip(y, -p["level"], p["level"]))


CLIPPING = Effect(
    "clipping", "read-out", "Clips.", (Parameter("level", "1", 1.0, "level"),), readout=clip
)


def one_clipped(seed, level):
    """Five runs, the fourth, of amplitude 0.7, behind an amplifier that clips at a level."""
    sound = programme(seed, runs=5, duration_s=1.5)
    one = sound | {"effects": {"clipping": {"level": level}}, "run": [sound["run"][RUN]]}
    before, after = (
        sound | {"run": runs} for runs in (sound["run"][:RUN], sound["run"][RUN + 1 :])
    )
    return [*waves(before), *waves(one, (CLIPPING,)), *waves(after)]


def test_a_clipped_run_is_named_with_its_level():
    """It was "unexplained", with no word of the run that clips."""
    report = summarise(diagnose(one_clipped(2, LEVEL)))
    (run,) = report["suspect_runs"]
    assert (run["run_id"], run["what"]) == (f"run{RUN}", "signals clipped")
    told = float(re.search(r"clipped at ([\d.]+)", run["evidence"])[1])
    assert told == pytest.approx(LEVEL, rel=2e-3)
