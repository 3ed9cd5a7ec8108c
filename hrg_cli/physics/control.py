"""The loops and the drive seen by the envelopes, for the slow engine; the fast engine has its own
form at the sample.

Force drive, resonant with the main wave (seed A (7), PHYSICS §1(c)):
    f = D e^{jφ}(a_ΦA e^{−jΔφ_A} e_A − j a_ΦB e^{−jΔφ_B} e_B) + f_parasitic e^{jφ}
Parametric drive of one ring electrode (PHYSICS M3p, C8): f = D p e^{−jΔφ_A} e^{2jφ} u*, so ȧ_A = +p
a_A and ȧ_B = −p a_B. Electric spring: jσR(2mθ + 90°) u, so ṙ = −σ and neither φ nor θ moves at r =
0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ellipse import compute_stokes
from .plant import Control
from .resonator import make_reflection

Array = np.ndarray


@dataclass
class Drive:
    """What the loops do at one instant: du/dt, the commanded force and (a_ΦA, a_ΦB), and the change
    of the two integrals."""

    du: Array
    """(2,) everything the control adds to du/dt: drive with its defects, and the spring."""
    force: Array
    """(2,) force on the envelopes before `drive_matrix` and parasitic force."""
    command: Array
    """(2,) a_ΦA, a_ΦB; with the spring a_ΦB = −σ a_A."""
    integral_rate: Array
    """(2,)"""


def is_on(control: Control, time_s: float) -> bool:
    """Whether the drive acts at a time.

    Parameters
    ----------
    control
        The loops, and when they are switched off.
    time_s
        The time [s].

    Returns
    -------
    bool
        False in a free run, and from the start of an interval `on_off` to before its end.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.control import is_on
    >>> from hrg_cli.physics.plant import Control
    >>> control = Control(forced=True, on_off=np.array([[1.0, 2.0]]))
    >>> [is_on(control, t) for t in (0.5, 1.0, 2.0)]
    [True, False, True]
    """
    off = np.asarray(control.on_off, float).reshape(-1, 2)
    return control.forced and not bool(np.any((time_s >= off[:, 0]) & (time_s < off[:, 1])))


def find_axes(u: Array, near: Array) -> tuple[float, float, Array, Array, complex]:
    """The axes of one wave: (a_A, a_B, e_A, e_B, e^{jφ}).

    Parameters
    ----------
    u
        Envelopes (2,), complex, not 0.
    near
        The last e_A (2,): (mθ, φ) and (mθ + π, φ + π) are the same wave, and the one nearer to it
        is taken.

    Returns
    -------
    tuple
        a_A and a_B in the signals' unit, unit vectors e_A and e_B (2,), and e^{jφ}.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.control import find_axes
    >>> a_A, a_B, e_A, e_B, turn = find_axes(np.array([1.0, 0.5j]), np.array([-1.0, 0.0]))
    >>> round(a_A, 9), round(a_B, 9), e_A.tolist(), turn
    (1.0, -0.5, [-1.0, -0.0], (-1+0j))
    """
    s0, s1, s2, s3 = compute_stokes(u)
    a_A = np.sqrt((s0 + np.hypot(s1, s2)) / 2)
    # Half of an angle known modulo 2π: mθ modulo π, its side chosen by `near`.
    electrical = np.arctan2(s2, s1) / 2
    e_A = np.array([np.cos(electrical), np.sin(electrical)])
    if e_A @ near < 0:
        e_A = -e_A
    return (
        float(a_A),
        float(s3 / (2 * a_A)),
        e_A,
        np.array([-e_A[1], e_A[0]]),
        complex(e_A @ u / a_A),
    )


def compute_drive(
    control: Control,
    feed_forward_1_s: float,
    u: Array,
    integral: Array,
    near: Array,
    time_s: float = 0.0,
) -> Drive:
    """The control's action on one wave at one instant (seed A (7), PHYSICS §1).

    Parameters
    ----------
    control
        The loops.
    feed_forward_1_s
        ν at the reference temperature: what holds the set amplitude without an error.
    u
        Envelopes (2,), complex.
    integral
        State of the amplitude and of the quadrature loop's integral, (2,).
    near
        The last e_A (2,).
    time_s
        That of a log's row [s].

    Returns
    -------
    Drive
        du/dt with the drive's defects, the commanded force, (a_ΦA, a_ΦB), and how the integrals
        move.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.control import compute_drive
    >>> from hrg_cli.physics.plant import Control
    >>> control = Control(forced=True, amplitude_gain_1_s=5.0)
    >>> acted = compute_drive(control, 0.2, np.array([0.9, 0j]), np.zeros(2), np.array([1.0, 0.0]))
    >>> acted.command.round(9).tolist()
    [0.7, 0.0]
    """
    a_A, a_B, e_A, e_B, turn = find_axes(u, near)
    error = control.main_amplitude - a_A
    main = (
        feed_forward_1_s * control.main_amplitude + control.amplitude_gain_1_s * error + integral[0]
    )
    rate = np.array([control.amplitude_integral_1_s2 * error, 0.0])
    logged = control.interpolate_log(np.array([time_s]))
    if len(logged):
        # No loop acts beside a log: its integrals stand still.
        main, rate = logged[0, 0], np.zeros(2)
    late = np.exp(-1j * control.main_phase_error_rad)
    force = (
        main / a_A * late * turn**2 * np.conj(u)
        if control.drive == "parametric"
        else main * late * turn * e_A
    )
    spring = np.zeros(2, complex)
    quadrature = 0.0
    if control.quadrature_loop == "finite":
        if len(logged):
            quadrature = logged[0, 1]
        else:
            quadrature = -control.quadrature_gain_1_s * a_B - integral[1]
            rate[1] = control.quadrature_integral_1_s2 * a_B
        force = (
            force - 1j * turn * np.exp(-1j * control.quadrature_phase_error_rad) * quadrature * e_B
        )
    elif control.quadrature_loop == "spring":
        if len(logged):
            sigma = -logged[0, 1] / a_A
        else:
            sigma = control.quadrature_gain_1_s * a_B / a_A + integral[1]
            rate[1] = control.quadrature_integral_1_s2 * a_B / a_A
        # What a force loop of the same effect would command, so that logs of both read alike.
        quadrature = -sigma * a_A
        spring = 1j * sigma * make_reflection(2 * np.arctan2(e_A[1], e_A[0]) + np.pi / 2) @ u
    du = control.drive_matrix @ force + control.parasitic_force * turn + spring
    return Drive(du, force, np.array([main, quadrature]), rate)
