"""What a person reads after `hrg identify --method all`: every method with its errors, who refuses
and why, what the runs cannot tell."""

from synthetic_waves import programme

from hrg_cli.reporting import tables
from hrg_cli.stages.identify import identify, summarise


def test_methods_intervals_and_sentences_are_printed(capsys):
    record = identify(
        programme(std=1e-3, window=1e-2, runs=[(0.0, 0.0), (0.4, 0.0), (0.8, 0.0)]),
        method="all",
        profile=True,
    )
    tables.show(record, summarise(record))
    lines = capsys.readouterr().out.splitlines()
    start = [line.split()[0] for line in lines if line.split()]
    assert {
        "likelihood",
        "propagator",
        "stokes",
        "products",
        "fixed-axes-weighted",
        "rotation-integrals",
    } <= set(start)
    assert any(line.startswith("stokes") and line.count("(") == 5 for line in lines)
    assert any(line.startswith("rotation-integrals:") and "full period" in line for line in lines)
    assert any(line.startswith("profile interval") for line in lines)
    assert any("no run was rotated" in line for line in lines)
