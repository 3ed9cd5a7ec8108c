"""What ages over a programme, by the times at which its runs began."""

from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise

HOURS = (0.0, 0.3, 0.9, 1.4, 2.0, 2.3)


def begin(table: dict, hours: tuple[float, ...] = HOURS) -> dict:
    """The programme with its runs begun at these hours."""
    for run, h in zip(table["run"], hours, strict=True):
        run["recording"] = {"start_time": f"2026-05-04T0{int(h)}:{round(60 * (h % 1)):02}:00Z"}
    return table


def test_what_ages_between_runs_is_named_by_the_times_at_which_they_began():
    """2e-11 a second moves the frequency by a tenth of its σ within a run, and by many between
    runs; so do splits."""
    hidden = {"frequency_1_s": 2e-11, "split_cos_1_s2": 2e-7}
    table = begin(programme(4, runs=6, duration_s=1.0))
    table["effects"] = {"ageing": {**hidden, "since_first_run": 1.0}}
    out = summarise(diagnose(waves(table)))
    (found,) = out["effects"]
    assert out["verdict"] == "explained" and found["name"] == "ageing"
    assert found["held"]["since_first_run"]["value"] == 1.0
    for name, told in found["parameters"].items():
        assert abs(told["value"] - hidden.get(name, 0.0)) < 4 * told["std"] < 1e-7


def test_a_programme_that_ages_is_told_from_runs_that_do_so_from_their_own_starts():
    """1e-8 a second is seen in every run; from where it counts, by the frequencies alone."""
    table = begin(programme(5, runs=6, duration_s=1.0))
    table["effects"] = {"ageing": {"frequency_1_s": 1e-8, "since_first_run": 1.0}}
    out = summarise(diagnose(waves(table)))
    assert [one["name"] for one in out["effects"]] == ["ageing"]
    assert out["effects"][0]["held"]["since_first_run"]["value"] == 1.0
    assert out["verdict"] == "explained"
