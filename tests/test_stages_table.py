"""The table of stages holds what it names: each has its function and the summary that its JSON,
limits and comparisons are made of."""

import importlib
import inspect

import numpy as np
import pytest

from hrg_cli.limits import list_figures
from hrg_cli.pipeline import STAGES
from hrg_cli.records import KINDS, Resonator


def resonator():
    return Resonator(
        name=np.array(["scale_factor"]),
        value=np.array([0.55]),
        std=np.array([1e-5]),
        units=np.array(["1"]),
        covariance=np.array([[1e-10]]),
    )


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_has_its_function_and_its_summary(name):
    stage = STAGES[name]
    module = importlib.import_module(f"hrg_cli.stages.{name}")
    assert inspect.isfunction(stage.load_function())
    assert len(inspect.signature(module.summarise).parameters) == 1


def test_every_kind_that_a_stage_makes_is_summed_up():
    made = {kind.kind: kind.made_by.removeprefix("hrg ") for kind in KINDS}
    del made["recording"]  # of a log or a simulation
    assert {kind: STAGES[stage].gives for kind, stage in made.items()} == {k: k for k in made}


def test_a_summary_that_moved_is_no_empty_one(monkeypatch):
    """The JSON without its figures would look like a result that has none."""
    module = importlib.import_module("hrg_cli.stages.identify")
    monkeypatch.delattr(module, "summarise")
    with pytest.raises(AttributeError, match="summarise"):
        STAGES["identify"].summarise(resonator())
    with pytest.raises(AttributeError, match="summarise"):
        list_figures(resonator())
