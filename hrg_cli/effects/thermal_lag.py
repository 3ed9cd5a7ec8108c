"""Thermometer that lags behind the resonator.

Physics: the sensor follows the resonator's temperature with a time constant τ_s: T = T_s + τ_s
dT_s/dt.
Equation: every temperature dependence y(T) is off by y′ τ_s dT/dt with the same τ_s   (PHYSICS E5). Without a temperature dependence
(thermal_frequency, thermal_damping, split_temperature) it does nothing. Size: 10 … 600 s. Mistaken
for: thermal gradient (own ratio a channel), hysteresis, ageing on one ramp. What separates it: soak
steps, two ramp rates; the resonator's own frequency is the thermometer without lag.
"""

import dataclasses

import numpy as np

from ..physics.plant import Environment, SlowState
from .effect import Effect, Parameter, Values


def environment(p: Values, env: Environment) -> None:
    """The log is the true temperature through a first-order lag, exact for straight lines between
    rows; it starts in balance."""
    tau = p["time_constant_s"]
    if tau <= 0:
        return
    true = env.temperature_degc
    slope = np.gradient(true, env.time_s)
    logged = np.empty_like(true)
    logged[0] = true[0] - tau * slope[0]
    for k, h in enumerate(np.diff(env.time_s)):
        ramp = (true[k + 1] - true[k]) / h
        decay = np.exp(-h / tau)
        logged[k + 1] = true[k + 1] - tau * ramp + (logged[k] - true[k] + tau * ramp) * decay
    env.logged_temperature_degc = env.logged_temperature_degc + logged - true


def slow_environment(p: Values, state: SlowState) -> SlowState:
    """True temperature = logged + τ d(logged)/dt."""
    true = state.temperature_degc + p["time_constant_s"] * state.temperature_rate_degc_s
    return dataclasses.replace(state, temperature_degc=true)


EFFECT = Effect(
    name="thermal_lag",
    family="bench",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("time_constant_s", "s", 1.0, "time constant τ_s of the thermometer", minimum=0.0),
    ),
    mistaken_for=("thermal_gradient", "thermal_hysteresis"),
    next_experiment=(
        "temperature in soak steps, or ramps at two speeds: a lag is one time constant for every"
        " dependence, a gradient is not"
    ),
    environment=environment,
    slow_environment=slow_environment,
    shown_by=("temperature cycle",),
    beside="thermal_frequency",
)
