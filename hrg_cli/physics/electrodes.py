"""The capacitive pick-off of seed B: eight electrodes, four a channel, derived from their currents.

Electrode k of a mode m stands at kπ/2m, so it sees ±C or ±S: the sign and the channel of `SIGNS`.
Its gap is d_k − x_k with x_k the displacement towards it, its capacitance C_k = C₀(d/d_k)/(1 −
x_k/d_k). The resonator is at the voltage U; an electrode at virtual ground carries i_k = d(C_k
U)/dt, amplified g_k times; a channel is the sum of its electrodes with their signs.

Equal gaps, c = x/d: 1/(1 − c) − 1/(1 + c) = 2c/(1 − c²).
- *alternating* U of constant amplitude: the current is d/dt[U·2c/(1 − c²)], whose demodulated
  envelope is that of c/(1 − c²) = c + c³ + …, so the cubic factor of c(1 + γc²) is γ = 1.
- *constant* U: i = U d/dt[2c/(1 − c²)] = 2Uċ(1 + c²)/(1 − c²)²: a velocity. The differentiated
  cubic ċ(1 + 3c²) has the fundamental ωa(1 + ¾a²), as the derivative of c + c³ must: γ = 1 again, a
  quarter period later.
- *printed*: the formula 2cU(1 + c²)/(1 − c²)² of seed B read with its dots lost, c as a
  displacement: γ = 3. No circuit does this; it is kept for comparison with results that used it.
A buffer of high impedance (constant charge) reads the voltage Q/C_k, linear in the gap: γ = 0, the
`linear` model.
"""

from __future__ import annotations

import numpy as np

from ..errors import HrgError

Array = np.ndarray
LAWS = ("alternating", "constant-voltage", "printed")
SIGNS = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
"""Of electrodes 1 … 8; odd ones (first, third …) see C, even ones S."""


def compute_cubic_factor(law: str) -> float:
    """γ of the fundamental, amplitude a → a(1 + ¾γa²), with equal gaps and a in gap units.

    Parameters
    ----------
    law
        One of `LAWS`.

    Returns
    -------
    float
        γ, derived in this module's head and in docs/explanation/electrode-law.md.

    Examples
    --------
    >>> from hrg_cli.physics.electrodes import LAWS, compute_cubic_factor
    >>> [compute_cubic_factor(law) for law in LAWS]
    [1.0, 1.0, 3.0]
    """
    return 3.0 if law == "printed" else 1.0


def pick_off(
    law: str, gap: float, gaps: Array, gains: Array, displacement: Array, velocity_over_omega: Array
) -> Array:
    """What the channels give for displacements: a small wave and equal electrodes are unchanged.

    The sum of eight electrodes with their signs; seed B's law and its two readings stand in this
    module's head.

    Parameters
    ----------
    law
        One of `LAWS`.
    gap
        Mean gap d, in displacement units.
    gaps, gains
        Each electrode's gap and gain relative to the mean, (8,).
    displacement
        C and S, (2, n).
    velocity_over_omega
        Their velocities over ω, (2, n), which a constant voltage shows.

    Returns
    -------
    ndarray
        (2, n), in displacement units.

    Raises
    ------
    HrgError
        The wave reaches a gap.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.electrodes import pick_off
    >>> alike, wave = np.ones(8), np.array([[0.1], [0.0]])
    >>> pick_off("alternating", 1.0, alike, alike, wave, wave).round(6).ravel().tolist()
    [0.10101, 0.0]
    """
    c = displacement / gap
    reach = float(np.abs(c).max()) / float(gaps.min()) if c.size else 0.0
    if reach >= 1:
        raise HrgError(
            f"readout.gap = {gap:g}: the displacement reaches {np.abs(displacement).max():g},"
            f" {reach:.3g} of the narrowest gap; it must stay below the gap"
        )
    # Equal electrodes: the closed form loses no digits to eight terms that nearly cancel.
    if np.all(gaps == 1) and np.all(gains == 1):
        if law == "alternating":
            return np.asarray(gap * c / (1 - c**2))
        moved = c if law == "printed" else velocity_over_omega / gap
        return np.asarray(gap * moved * (1 + c**2) / (1 - c**2) ** 2)
    y = np.zeros_like(c)
    for k in range(8):
        near = 1 - SIGNS[k] * c[k % 2] / gaps[k]
        weight = gap / 4 * SIGNS[k] * gains[k] / gaps[k]
        if law == "alternating":
            y[k % 2] += weight / near
        else:
            moved = c[k % 2] if law == "printed" else velocity_over_omega[k % 2] / gap
            y[k % 2] += weight * SIGNS[k] * moved / gaps[k] / near**2
    return y
