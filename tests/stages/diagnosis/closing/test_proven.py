"""A cause that fails a check of its own is not named, whatever it was found by."""

from diagnosis_programme import programme, verdict

from hrg_cli.effects import Effect, Parameter
from hrg_cli.stages.diagnosis.closing.proven import OWN


def fifth_order(p, readout):
    readout.steps.append(lambda block, y: y + p["size"] * y**5)


STRANGER = Effect(
    name="stranger",
    family="test",
    page="a pick-off with a term of fifth order",
    parameters=(Parameter("size", "1", 1.0, "of the fifth power"),),
    readout=fifth_order,
)


def test_beside_what_no_cause_explains_every_cause_named_stands_by_itself():
    """Of a pick-off of fifth order that of third takes a part, with a size that moves by more than a
    third of itself once the rest is described; it was named, 48 σ, beside its own failing check."""
    table = programme(9, {"stranger": {"size": 2e-3}}, runs=4)
    table["recording"]["sample_rate_hz"] = 27011.0
    _, out = verdict(table, (STRANGER,))
    assert out["verdict"] in ("unexplained", "partly explained")
    own = {f"{cause['name']}_{told}" for cause in out["effects"] for told in OWN}
    assert not [one["name"] for one in out["checks"] if one["name"] in own and not one["passed"]]
    assert {cause["name"] for cause in out["effects"]} <= {"pickoff_nonlinearity"}
    assert "amplitude" in out["remainder"]["covariate"]
