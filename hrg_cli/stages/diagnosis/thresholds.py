"""Diagnosis, every constant of the decision, once, with what it buys. Figures that only set the
pace of a search stand where it is made.

The rule: a cause enters by chance with probability `SIGNIFICANT` at most and must be worth `WORTH`;
the words "adequate" and "explained" are then a matter of the closing checks alone (`closing.py`),
at the noise that the windows state.
"""

SIGNIFICANT = 1e-3
"""Chance of a false alarm a step of the selection, corrected for the number tried (Šidák)."""
WORTH = 10.0
"""ΔBIC an effect must earn, and by which it must beat a rival to be told from it: posterior odds of
e⁵ = 148 at equal prior odds."""
CLEARLY = 16.0
"""ΔBIC by which an open description must beat catalogued causes: odds of e⁸ = 3000, since the
catalogue is the smaller claim."""
FURTHER = 7.0
"""ΔBIC that every cause after the first owes more against one open term in the place of all: a
given one of some thirty is there with odds of 1 : 30, and one simple form is a smaller claim than
three that make it up."""
INADEQUATE = 1e-4
"""Chance at which a clean model would be called inadequate by the residual's smooth part, and again
by the open terms."""
GROSS = 10.0
"""χ² per degree of freedom above which the model is so far from the data that scores mislead: more
causes are refitted before one is chosen, and what the misfit could bend (the second order's scale)
is held where physics has it."""
FAR = 1e4
"""χ² per degree of freedom, beside all that loops may have answered, from which a cause is looked
for without that: what they answer is a thousand, and each fit beside it takes ten times as long."""
NEARLY_ALL = 100.0
"""Times that one cause brings a gross misfit's χ² down from which no open term outdoes it: nine
tenths of the misfit's size, which another cause shows of it only where the two correlate by
0.995."""
OUTDONE = 4.0
"""Times the χ² of a part of a cause that the cause itself must leave for the part to stand first
beside a gross misfit, and of two causes at once what one by one must leave: the misfit's size is
halved once more, where scores err by as much as they promise."""
FREQUENCIES_APART = 0.02
"""Relative difference of two runs' frequencies that no temperature makes (85 ppm/K: 235 K): a run
so far from the others is doubted whatever χ² is."""
CLOCKS_APART = 1e-5
"""Relative difference of one run's frequency from the others' from which its clock is asked whether
it mends all else of that run, where χ² is more than the noise."""
NEVER_LESS = 1.2
"""Variance over that of white noise from which a slow residual counts as wandering noise rather
than as the noise itself."""
BESIDE_MISFIT = 1e-2
"""Chance, for all causes tried, that a misfit which nothing explains would lend a cause what it
takes of it away."""
MOST_RIVALS = 2
"""Other causes that explain the runs as well, beyond which none of them is an explanation, and
beside a misfit none is named: a group of three."""
TOGETHER = 0.999
"""Canonical correlation from which two causes are one to these data, whatever the fit says."""
SAME = 0.995
"""Canonical correlation from which an open term is another spelling of a catalogued effect."""
SMALL_IN_MOTION = 0.1
"""Largest |du/dt| of a cause over ω|u|: beyond it the motion is no slowly changing oscillation."""
SMALL_IN_READOUT = 1.0
"""Largest change of what is seen, over the signal, that a read-out's cause may make."""
MOST_TYPICAL = 1e3
"""Times its typical size that no pure number of a cause exceeds."""
OWN_SIGMA = 3.0
"""σ that a named cause must stand off zero on its own, in the final fit."""
NOISE_LEVEL = 1.15
"""Noise over the stated one that the windows' own estimate may miss."""
BOUND_COST = 16.0
"""χ² that the bound of a passive resonator may cost before it is a finding: 4 σ."""
FREQUENCIES = 4.9
"""σ by which the runs' own frequencies may differ where nothing known makes them: chance 1e-6."""
SAME_FREQUENCY = 1e-9
"""Part of the frequency by which runs may always differ: that of a second of time stamps in whole
nanoseconds. Models and simulated samples agree to 1e-12."""
LEAST_INFORMATION = 1e-4
"""Part of all information on a combination of numbers that the other folds, runs or stretches of
time, must hold to predict it at all."""
UNSETTLED_BASE = 0.02
"""Part of what the causes take of χ² that the base fit, which they replace, may promise to fall
yet: a model far from its data may turn about its optimum for long. Likewise of what a cause takes
of a gross misfit of driven runs, whose loops' answers are laid anew beside it."""
RUN_PREDICTED = 1.5
"""rms of a run's errors over σ when it is predicted by the others, beyond which the run is not of
the same device."""
WRITTEN = 1.1
"""Misfit of the simulated extended model over that of the fit."""
SCALE_FACTORS = (0.05, 3.0)
"""Range of K, in parts of the nominal one, that the mode shape of a shell, a ring or a pendulum
allows."""
WHOLE = 2e-3
"""Distance from a whole number of samples that a loss may have where sampling is even, beside four
of its σ."""
