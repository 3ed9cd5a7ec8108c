"""Effects that no catalogue holds: never called adequate, never blamed on a catalogued cause alone,
described by what they are."""

import itertools
import re
from dataclasses import dataclass, field

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.effects import Effect, Parameter, dry_friction

IDENTITY = np.eye(2)


@dataclass(frozen=True)
class Stranger:
    """Where it acts, its size, and what the first open term must say: place, covariate, a piece of
    the formula, size, harmonic of θ."""

    hooks: dict
    size: float
    place: str
    covariate: str
    formula: str
    printed: float = np.nan
    harmonic: int | None = None
    same: str = ""
    """A catalogued effect that does the same as a part of it."""
    programme: dict = field(default_factory=dict)


def reflected(angle):
    return np.array([[np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)]])


def damped(plant, course, matrix=IDENTITY):
    plant.damping = plant.damping + np.asarray(course)[:, None, None] * matrix


def stiffened(plant, course, matrix=IDENTITY):
    plant.stiffness = (
        plant.stiffness
        + (2 * plant.mechanics.omega_rad_s * np.asarray(course))[:, None, None] * matrix
    )


def stiffness_step(p, plant, env):
    stiffened(plant, p["size"] * (env.time_s > 0.7))


def split_step(p, plant, env):
    stiffened(plant, p["size"] * (env.time_s > 1.2), reflected(0.6))


def damping_by_rate(p, plant, env):
    damped(plant, p["size"] * env.rate_rad_s**2)


def warming_up(p, plant, env):
    stiffened(plant, p["size"] * np.exp(-env.time_s / 0.4))


def rippling_rate(p, env):
    env.rate_rad_s = env.rate_rad_s + p["size"] * np.sin(2 * np.pi * 1.7 * env.time_s)


def warm_channel(p, readout):
    """The gain of C alone follows temperature."""
    readout.steps.append(
        lambda block, y: (
            y
            * np.stack([1 + p["size"] * (block.temperature_degc - 22), np.ones_like(block.time_s)])
        )
    )


class GainOfEveryRun:
    """An amplifier that is set anew before every run: one gain of S a run, in the order of four
    runs."""

    def __init__(self):
        self.gains = itertools.cycle((1.0, -2.0, 0.0, 0.5))

    def __call__(self, p, readout):
        gain = 1 + p["size"] * next(self.gains)
        readout.steps.append(lambda block, y: y * np.array([[1.0], [gain]]))


def warm_phase(p, readout):
    """S lags by an angle that follows temperature; what of it both channels share stands in the
    runs' own phases and frequencies."""

    def step(block, y):
        lag = p["size"] * (block.temperature_degc - 22)
        return y + np.stack([np.zeros_like(lag), lag * block.v_over_omega[1]])

    readout.steps.append(step)


def late_leakage(p, readout):
    """The drive leaks into both channels 50 ms late."""
    kept = []

    def step(block, y):
        late = round(0.05 / (block.time_s[1] - block.time_s[0]))
        whole = np.concatenate(
            [kept[-1] if kept else np.zeros((2, late), complex), block.drive], axis=1
        )
        kept.append(whole[:, -late:])
        return y + p["size"] * whole[:, : y.shape[1]].real

    readout.steps.append(step)


def absolute_damping(p, plant, env):
    """Damping proportional to the amplitude itself."""
    omega, size = plant.mechanics.omega_rad_s, p["size"]

    def extra(t, x, y, vx, vy):
        a = (x * x + y * y + (vx * vx + vy * vy) / omega / omega) ** 0.5
        return -2 * size * a * vx, -2 * size * a * vy

    plant.extra = extra


def absolute_frequency(p, plant, env):
    """A frequency that follows the amplitude itself."""
    omega, size = plant.mechanics.omega_rad_s, p["size"]

    def extra(t, x, y, vx, vy):
        a = (x * x + y * y + (vx * vx + vy * vy) / omega / omega) ** 0.5
        return -2 * omega * size * a * x, -2 * omega * size * a * y

    plant.extra = extra


def driving_friction(p, plant, env):
    """Dry friction of the wrong sign."""
    dry_friction.EFFECT.plant({"slope_1_s": -p["size"]}, plant, env)


def following_stiffness(p, plant, env):
    """A stiffness axis that goes with the wave, an electrical radian ahead."""
    omega = plant.mechanics.omega_rad_s
    size, cos, sin = 2 * omega * p["size"], float(np.cos(1.0)), float(np.sin(1.0))

    def extra(t, x, y, vx, vy):
        s1, s2 = (
            x * x - y * y + (vx * vx - vy * vy) / omega / omega,
            2 * (x * y + vx * vy / omega / omega),
        )
        q = (s1 * s1 + s2 * s2) ** 0.5 + 1e-300
        c, s = (s1 * cos - s2 * sin) / q, (s2 * cos + s1 * sin) / q
        return -size * (c * x + s * y), -size * (s * x - c * y)

    plant.extra = extra


def twelve_theta(p, plant, env):
    """Damping with the twelfth harmonic of the wave angle (m = 2)."""
    omega, size = plant.mechanics.omega_rad_s, p["size"]

    def extra(t, x, y, vx, vy):
        s1, s2 = (
            x * x - y * y + (vx * vx - vy * vy) / omega / omega,
            2 * (x * y + vx * vy / omega / omega),
        )
        c = s1 / ((s1 * s1 + s2 * s2) ** 0.5 + 1e-300)
        cubed = 4 * c * c * c - 3 * c
        return -2 * size * cubed * vx, -2 * size * cubed * vy

    plant.extra = extra


def damping_by_table_angle(p, plant, env):
    step = np.diff(env.time_s) * (env.rate_rad_s[1:] + env.rate_rad_s[:-1]) / 2
    damped(
        plant, p["size"] * np.cos(np.concatenate([[0.0], np.cumsum(step)])) * (env.rate_rad_s != 0)
    )


def frequency_by_root_of_time(p, plant, env):
    stiffened(plant, p["size"] * np.sqrt(env.time_s / 2.0))


def turning_axis(p, plant, env):
    """A frequency split whose axis turns in time."""
    turn = 3.0 * env.time_s
    rows = np.stack([np.cos(turn), np.sin(turn)], -1), np.stack([np.sin(turn), -np.cos(turn)], -1)
    stiffened(plant, np.full(len(turn), p["size"]), np.stack(rows, -2))


def damping_by_speed(p, plant, env):
    damped(plant, p["size"] * np.abs(env.rate_rad_s))


def split_modulated(p, plant, env):
    damped(plant, p["size"] * np.sin(2 * np.pi * 2.5 * env.time_s), reflected(0.6))


def split_settling(p, plant, env):
    stiffened(plant, p["size"] * np.exp(-env.time_s / 0.5), reflected(1.1))


def scale_of_one_sign(p, plant, env):
    """K differs for the two directions of rotation."""
    plant.scale_factor = plant.scale_factor * (1 + p["size"] * np.sign(env.rate_rad_s))


def scale_by_temperature(p, plant, env):
    """K follows temperature."""
    plant.scale_factor = plant.scale_factor * (1 + p["size"] * (env.temperature_degc - 22))


def scale_by_warming(p, plant, env):
    """K follows the temperature's rate."""
    rate = np.gradient(env.temperature_degc, env.time_s)
    plant.scale_factor = plant.scale_factor * (1 + p["size"] * rate)


def ageing_scale(p, plant, env):
    """K falls in time."""
    plant.scale_factor = plant.scale_factor * (1 - p["size"] * env.time_s)


def scale_by_amplitude(p, plant, env):
    """K follows the square of the amplitude; a run's rate is constant."""
    omega, K = plant.mechanics.omega_rad_s, plant.scale_factor
    size = p["size"] * float(np.mean(K * env.rate_rad_s))

    def extra(t, x, y, vx, vy):
        square = x * x + y * y + (vx * vx + vy * vy) / omega / omega
        return 2 * size * square * vy, -2 * size * square * vx

    plant.extra = extra


def precession_by_inverse_amplitude(p, plant, env):
    omega, size = plant.mechanics.omega_rad_s, p["size"]

    def extra(t, x, y, vx, vy):
        a = (x * x + y * y + (vx * vx + vy * vy) / omega / omega) ** 0.5 + 1e-9
        return 2 * size * vy / a, -2 * size * vx / a

    plant.extra = extra


def kicked(p, plant, env):
    """A blow of 25 µs at one second."""
    omega, size = plant.mechanics.omega_rad_s, p["size"]

    def extra(t, x, y, vx, vy):
        if t < 1.0 or t > 1.0 + 2.5e-5:
            return 0.0, 0.0
        return 0.6 * size * omega / 2.5e-5, 0.8 * size * omega / 2.5e-5

    plant.extra = extra


def gain_step_of_one_channel(p, readout):
    readout.steps.append(
        lambda block, y: (
            y * np.stack([1 + p["size"] * (block.time_s > 1.1), np.ones_like(block.time_s)])
        )
    )


def phase_by_amplitude(p, readout):
    """S lags by an angle that grows with the amplitude."""

    def step(block, y):
        lag = p["size"] * np.sqrt(np.sum(block.z**2 + block.v_over_omega**2, axis=0))
        return y + np.stack([np.zeros_like(lag), lag * block.v_over_omega[1]])

    readout.steps.append(step)


def angle_of_eight_theta(p, readout):
    """The pick-off's angle is off by cos 8θ (m = 2)."""

    def step(block, y):
        z, v = block.z, block.v_over_omega
        s1, s2 = z[0] ** 2 + v[0] ** 2 - z[1] ** 2 - v[1] ** 2, 2 * (z[0] * z[1] + v[0] * v[1])
        return y + p["size"] * np.cos(2 * np.arctan2(s2, s1)) * np.stack([-y[1], y[0]])

    readout.steps.append(step)


STRANGERS = {
    "stiffness step": Stranger(
        {"plant": stiffness_step}, 1e-2, "frequency", "time", r"step at t = 0\.70", 1e-2
    ),
    "rippling rate": Stranger(
        {"environment": rippling_rate}, 1e-2, "turning", "time", r"tone of 1\.70"
    ),
    "split step": Stranger(
        {"plant": split_step}, 5e-3, "frequency split", "time", r"step at t = 1\.[12]", 5e-3
    ),
    "damping by rate": Stranger(
        {"plant": damping_by_rate},
        2e-3,
        "damping",
        "rate",
        r"\(Ω/Ω₀\)²",
        8e-3,
        programme={"runs": 8},
    ),
    "warming up": Stranger(
        {"plant": warming_up}, 2e-2, "frequency", "time", r"e\^\(−t/0\.[34]", 2e-2
    ),
    "warm phase": Stranger(
        {"readout": warm_phase}, 1e-3, "phase split", "temperature", r"\(T − T₀\)/ΔT", 1.25e-3
    ),
    "damping by |amplitude|": Stranger(
        {"plant": absolute_damping}, 1e-2, "damping", "amplitude", r"\(a/a₀\)"
    ),
    "following stiffness": Stranger(
        {"plant": following_stiffness}, 3e-3, "frequency split", "wave angle", "4θ", 3e-3, 4
    ),
    "twelve theta": Stranger(
        {"plant": twelve_theta}, 2e-3, "damping", "wave angle", "12θ", 2e-3, 12
    ),
    "table angle": Stranger(
        {"plant": damping_by_table_angle},
        4e-3,
        "damping",
        "table angle × 1",
        "table angle",
        4e-3,
        1,
        programme={"runs": 8},
    ),
    "root of time": Stranger(
        {"plant": frequency_by_root_of_time}, 2e-2, "frequency", "time", "√", 2e-2
    ),
    "turning axis": Stranger(
        {"plant": turning_axis}, 5e-3, "frequency split", "time", r"tone of 0\.4", 5e-3
    ),
    "damping by |rate|": Stranger(
        {"plant": damping_by_speed}, 3e-3, "damping", "rate", r"\|Ω\|", 6e-3, programme={"runs": 8}
    ),
    "damping split modulated": Stranger(
        {"plant": split_modulated}, 1e-2, "damping split", "time", r"tone of 2\.[45]", 1e-2
    ),
    "split that settles": Stranger(
        {"plant": split_settling}, 1e-2, "frequency split", "time", r"e\^\(−t/0\.[45]", 1e-2
    ),
    "scale of one sign": Stranger(
        {"plant": scale_of_one_sign}, 2e-3, "turning", "rate", r"\|Ω\|", programme={"runs": 8}
    ),
    "scale factor that ages": Stranger(
        {"plant": ageing_scale}, 2e-3, "turning", "rate and time", "× t/T", programme={"runs": 8}
    ),
    "scale by warming": Stranger(
        {"plant": scale_by_warming},
        2e-3,
        "turning",
        "rate and temperature rate",
        r"Ω/Ω₀ × Ṫ/Ṫ₀",
        programme={"runs": 8, "cycle": True},
    ),
    "scale by amplitude": Stranger(
        {"plant": scale_by_amplitude},
        2e-3,
        "turning",
        "rate and amplitude",
        r"Ω/Ω₀ × \(a/a₀\)²",
        programme={"runs": 8},
    ),
    "precession by 1/a": Stranger(
        {"plant": precession_by_inverse_amplitude}, 4e-3, "turning", "amplitude", "a₀/a"
    ),
    "gain step of C": Stranger(
        {"readout": gain_step_of_one_channel}, 1e-3, "gain of C", "time", r"step at t = 1\.", 1e-3
    ),
    # a gain alone is the start's; between the runs what moves as a split of gains is seen, and of
    # which channel it is, is not
    "gain of every run": Stranger(
        {"readout": GainOfEveryRun()},
        2e-3,
        "gain split",
        "run",
        "run by run",
        2.29e-3,
        programme={"runs": 4},
    ),
    "frequency by amplitude": Stranger(
        {"plant": absolute_frequency},
        1e-2,
        "frequency",
        "amplitude",
        r"\(a/a₀\)$",
        programme={"runs": 4},
    ),
    "phase by amplitude": Stranger(
        {"readout": phase_by_amplitude}, 2e-3, "phase of S", "amplitude", r"\(a/a₀\)"
    ),
    "angle of 8θ": Stranger(
        {"readout": angle_of_eight_theta}, 1e-3, "angle", "wave angle", "8θ", 1e-3, 8
    ),
}
QUICK = ("rippling rate", "angle of 8θ", "gain of every run", "frequency by amplitude")


def judged(name, hooks, size, seed, **settings):
    """The JSON's verdict on runs in which something acts that the diagnosis is not told of."""
    effect = Effect(
        name="stranger",
        family="test",
        page=name,
        parameters=(Parameter("size", "1", 1.0, name),),
        **hooks,
    )
    return verdict(programme(seed, {"stranger": {"size": size}}, **settings), (effect,))[1]


def check(name, seed):
    hidden = STRANGERS[name]
    out = judged(name, hidden.hooks, hidden.size, seed, **hidden.programme)
    assert out["verdict"] in ("unexplained", "partly explained")
    assert {e["name"] for e in out["effects"]} <= {hidden.same}
    first = out["remainder"]["terms"][0]
    assert first["place"].startswith(hidden.place) and first["covariate"] == hidden.covariate, first
    assert re.search(hidden.formula, first["formula"]), first["formula"]
    assert first["harmonic"] == hidden.harmonic
    if np.isfinite(hidden.printed):
        assert first["size"] == pytest.approx(hidden.printed, rel=0.05)
    return out


@pytest.mark.parametrize("name", QUICK)
def test_a_stranger_is_described(name):
    check(name, 9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [name for name in STRANGERS if name not in QUICK],
)
def test_every_stranger_is_described(name):
    check(name, 9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hooks", "runs", "sizes"),
    [
        ({"plant": scale_by_temperature}, 8, {"scale_factor_temperature": 1e-3}),
        # the gain of one channel: half of it is common to both
        (
            {"readout": warm_channel},
            6,
            {"mismatch_temperature": 1e-3, "gain_temperature": 5e-4, "gain_mismatch": None},
        ),
    ],
)
def test_what_causes_of_the_catalogue_make_together_is_named_with_its_sizes(hooks, runs, sizes):
    """1e-3 a kelvin from 22 °C, where the catalogue counts from the runs' own temperature."""
    out = judged("warm", hooks, 1e-3, 9, runs=runs)
    assert out["verdict"] == "explained"
    found = {e["name"]: e for e in out["effects"]}
    assert set(found) == set(sizes)
    for name, size in sizes.items():
        if size is None:
            reference = found["mismatch_temperature"]["held"]["reference_temperature_degc"]["value"]
            size = 1e-3 * (reference - 22)
        (value,) = found[name]["parameters"].values()
        assert abs(value["value"] - size) < 4 * value["std"]
        assert value["std"] < 0.03 * size


@pytest.mark.parametrize(
    ("hidden", "size", "seed", "runs"),
    [
        # "explained" before by a nonlinear damping beside a friction that drives, 13 σ
        pytest.param(absolute_damping, 1e-3, 20, 6, marks=pytest.mark.slow),
        # its form is that of a² to half a percent, which was 107 of χ²: another cause's shadow
        (absolute_damping, 3e-3, 9, 2),
        pytest.param(driving_friction, 1e-3, 20, 6, marks=pytest.mark.slow),
    ],
)
def test_a_cause_of_impossible_sign_is_none(hidden, size, seed, runs):
    """Friction takes energy and never gives any: what the catalogue would only hold with the wrong
    sign is said to be open."""
    out = judged("unnamed", {"plant": hidden}, size, seed, runs=runs)
    assert out["verdict"] == "unexplained" and not out["effects"]
    first = out["remainder"]["terms"][0]
    assert (first["place"], first["covariate"]) == ("damping", "amplitude")


@pytest.mark.slow
def test_a_blow_in_every_run_is_told_by_its_instant():
    """The catalogue's kick is one run's; six at once leave it unexplained, with the second of one."""
    out = judged("kick", {"plant": kicked}, 3e-3, 9)
    assert out["verdict"] in ("unexplained", "partly explained")
    (struck,) = (c for c in out["checks"] if c["name"] == "nothing_strikes")
    assert not struck["passed"]
    assert re.match(r"from (0\.99|1\.0)", struck["sentence"]), struck["sentence"]


@pytest.mark.slow
def test_leakage_that_comes_late_is_not_called_adequate():
    """Where the wave turns within the delay, it is near to several of the catalogue's causes, which
    may be named, but something is left."""
    effect = Effect(
        name="stranger",
        family="test",
        page="late leakage",
        parameters=(Parameter("size", "1", 1.0, "size"),),
        readout=late_leakage,
    )
    _, out = verdict(programme(9, {"stranger": {"size": 1e-2}}, forced=True), (effect,))
    assert out["verdict"] in ("unexplained", "partly explained")
    assert out["remainder"]["terms"][0]["z"] > 20


@pytest.mark.slow
def test_noise_that_depends_on_the_angle_is_no_cause():
    """Noise of one wave angle more than of another changes no mean: nothing may be blamed."""
    random = np.random.default_rng(5)

    def noisy(p, readout):
        def step(block, y):
            s1 = (
                block.z[0] ** 2
                + block.v_over_omega[0] ** 2
                - block.z[1] ** 2
                - block.v_over_omega[1] ** 2
            )
            size = np.sum(block.z**2 + block.v_over_omega**2, axis=0)
            return y + p["size"] * np.abs(s1 / size) * random.standard_normal(y.shape)

        readout.steps.append(step)

    effect = Effect(
        name="stranger",
        family="test",
        page="noise",
        parameters=(Parameter("size", "1", 1.0, "size"),),
        readout=noisy,
    )
    _, out = verdict(programme(9, {"stranger": {"size": 6e-4}}), (effect,))
    assert out["effects"] == [] and out["remainder"] is None
