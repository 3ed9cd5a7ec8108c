"""Diagnosis, every constant of the decision, once, with what it buys. Figures that only set the
pace of a search stand where it is made.

The rule: a cause enters by chance with probability `SIGNIFICANT` at most and must be worth `WORTH`;
the words "adequate" and "explained" are then a matter of the closing checks alone (`closing.py`),
at the noise that the windows state.
"""

SIGNIFICANT = 1e-3
"""Chance of a false alarm a step of the selection, corrected for the number tried (Šidák)."""
TONE = 2e-5
"""Chance of a false tone near the resonance a search, corrected for the frequencies looked at: one
of some forty causes, `SIGNIFICANT` in all."""
WORTH = 10.0
"""ΔBIC an effect must earn, and by which it must beat a rival to be told from it: posterior odds of
e⁵ = 148 at equal prior odds."""
CLEARLY = 16.0
"""ΔBIC by which an open description must beat catalogued causes: odds of e⁸ = 3000, since the
catalogue is the smaller claim."""
OUTDONE = 6.0
"""ΔBIC by which an open description does better than causes that explain all, before these are in
doubt: it is so much ahead of a true cause by chance in 0.7 % at worst (z√(1 − r²) = √6)."""
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
GYROS_APART = 10.0
"""Times what the frequencies of two groups of runs differ by within them, by which the groups must
be apart to be two gyros'."""
NEVER_LESS = 1.2
"""Variance over that of white noise from which a slow residual counts as wandering noise rather
than as the noise itself."""
BESIDE_MISFIT = 1e-2
"""Chance, for all causes tried, that a misfit which nothing explains would lend a cause what it
takes of it away."""
MOST_RIVALS = 2
"""Other causes that explain the runs as well, beyond which none of them is an explanation, and
beside a misfit none is named: a group of three."""
INSEPARABLE = 0.999
"""Cosine from which two causes, or one and a part of the other, do the same in these runs: one of
70 σ stands 3 σ off what the other makes of it."""
FAINT = 0.02
"""Independence beside the base model below which a cause is told from it only by what no model is
exact enough for: 150 σ of it leave 3."""
SLOWER_NOISE = 5.0
"""Excess of the slower noise over the neighbours', times the root of the number of second
differences, that chance does not make: their median scatters by 1.6, so that it is one of a
thousand."""
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

# What is left between runs, and the form of a term.

BESIDE_NOISE = 1e-2
"""Chance of a false alarm, corrected for the number tried, of what the runs' frequencies follow
where what it leaves of their scatter is their own noise."""
MOVES_WITH_STARTS = 1e-3
"""Part of the scatter of the runs' frequencies that a line through the times at which they began
may leave, for them to go with these."""
EXCLUDED = 4.0
"""σ by which the runs must exclude the size that the offsets' scatter asks for."""
FORBIDDEN_DAMPING = 2.0
"""σ by which the linear damping must be beyond the passive bound to count as forbidden."""
ANOTHER_POWER = 4.0
"""σ by which a fitted power must differ from the catalogue's."""
READOUT_BETTER = 0.03
"""Part of its gain in χ² by which a term of the read-out may do better than the same of the motion
that is named in its place."""
SIGNS_TURNED = 30.0
"""χ² that turned signs must gain, beyond the choice among 2^(R − 1) of them."""
WRONG_VALUE = 4.0
"""σ from which a value of the base that was believed beforehand counts as wrong."""

# What was held out.

UNTAUGHT = 3.0
"""Times its σ from all data beyond which a cause is not known from a part of them, so that what it
predicts there says nothing of it."""
WORSE_TAUGHT = 2.0
"""Times χ² per degree of freedom of all data beyond which the training is not fitted: of driven
runs what a log may have missed is said of all of them together, and a part of them is without
it."""
ASTRAY = 4.0
"""Surprise a value held out, 1 where σ is right, from which a forecast is wrong by what nobody
taught."""
SHOWN_AS_SUM = 3.0
"""Times what runs show a coordinate to by which the doubt in a cause moves it, from which they show
their sum rather than the coordinate."""

# A wrong run.

ONE_MORE_RUN = 1.4
"""Times by which χ² must fall for one more run to be doubted, for runs beside causes of their own,
and, where a gross misfit stays, for a mistake with more numbers."""
PHYSICS_RIVAL = 3.0
"""χ² per degree of freedom that causes of the catalogue may leave over that of the best mistake:
then no run is blamed."""
UNLIKE_RIVAL = 10.0
"""The same beside a run of which no mistake is found: with all of its motion its own something must
fall."""
FREQUENCY_RIVAL = 1.05
"""Times by which causes of the catalogue must leave less than a run of strange frequency,
undone."""
AS_GOOD_WITHOUT = 3.0
"""Times χ² per degree of freedom of the best runs without one, up to which leaving out another is
as good."""
MISTAKES_REMOVE = 0.9
"""Part of the excess of χ² that the mistakes undone must remove together."""
MISTAKE_PRICE = 20.0
"""Δ(χ² + k ln N), at the noise that is left, by which a mistake with more freedom must beat one
with less."""
WORTHWHILE = 0.3
"""Part of χ² that a cause's score must promise to be refitted as a rival of a wrong run: less
leaves a misfit of which the mistake is the simpler account."""
TAKES_NEARLY_ALL = 0.9
"""The same of a third cause and further ones: what a wrong run does, no third cause takes up so
well."""
MATTERS = 0.7
"""Part of χ² that a temperature dependence may leave for the thermometers to be looked at: a wrong
one leaves it nothing to follow."""
UNUSUAL_SCALE_FACTOR = 1e3
"""Δχ² by which mistakes that leave a usual scale factor go before those that do not."""
INSTEAD_OF_CAUSES = 0.9
"""Part of what causes take of χ² that a number of one run's own must promise to be held against
them."""
SURE_LATENESS = 6.0
"""Standard deviations, of the misfit that is left, from which a lateness is told."""
LEAK_PARTS = 0.5
"""Part of the dampings' range that a gap among them fills where one leak parts the runs in two."""
SURE_LEAK = 5.0
"""Standard deviations by which a damping must stand off the least, where no gap parts the runs."""
SURE_OF_K = 5.0
"""σ from which K is known; σ of a misfit counts."""
USUAL_RANGE = 2.5
"""Times above and below its usual value that a scale factor may be."""
SURE_ROTATION = 3.0
"""σ from which a run's rate is known from its wave."""
ANOTHER_PLACE = 3.0
"""Standard deviations of a smoothed course of temperature by which the log of a thermometer in
another place must differ from it."""
PLAUSIBLE_DEGC = 200.0
"""Distance from the other runs' temperatures that a run may have had."""
THINKABLE_LATENESS = 4.0
"""Standard deviations beforehand beyond which a lateness must leave nothing but noise to be one."""
ONE_NOISE = 0.999
"""Correlation of the channels' noise from which they are one: what two pick-offs' electronics have
in common leaves each a twentieth of noise of its own at least."""
GROWN = 0.1
"""ln of a free run's growth from which nothing makes it but time that runs backwards or a drive:
gains differ by a few hundredths from one wave angle to another, and noise by less."""
FALLEN = 0.1
"""ln of the fall of a run whose drive nobody logged from which its amplitude was not held: loops
hold it to a few parts in a thousand, and a few hundredths of gain mismatch bend what is seen."""
CONTRADICTION = 1e3
"""χ² per degree of freedom from which it is asked whether the runs are of one gyro."""

# The waveform and the samples.

LINE_RATIO = 8.0
"""Power of a line over the floor from which it counts, in a good part of the runs."""
BY_CHANCE = 1e-6
"""Chance at which so many lines may meet odd multiples of the oscillation, or the odd windows of a
programme be just those of the largest signal."""
ODD_WINDOW = 1.9
"""σ over the neighbours' from which a window is odd: pooled ones differ by a few hundredths, one of
four samples beside those of five by half, and one that keeps its own noise has twice theirs or
more."""
BENT_WINDOW = 1.3
"""Times the doubt about its motion's bend, as the demodulation has it, up to which what a window's
σ holds beside the neighbours' is that: it is 0.6 to 1.0 of it where waves turn by 0.15 to 0.5 rad a
window, Q 300 to 1e4 and 1 to 20 periods a window."""
FOLLOWS_WAVE = 9.0
"""Δχ² by which a line's size must follow the wave's better than stay the same to be the wave's
own."""
ONE_SIDED_TONE = 6.0
"""Power of a tone over its mirror's beside the resonance, less the floor in both: a modulation has
that only where amplitude and phase swing in step and alike to a factor of 2.4."""
MIRRORED = 2.0
"""σ of the mirror's noise that are allowed beside: one tone of forty is lost to it."""
DIES = 0.7
"""Part of its power that a tone has in the second half of the runs at least: the wave itself, and
what follows it, dies."""
SURE_TO_DIE = 4.0
"""σ by which a tone's power must be less than that: chance 3e-5 to lose one that stays."""
ISOLATED = 10.0
"""Power of a tone beside a gross misfit over all that stands in the cells on either side of it: a
misfit of the motion is no line alone, and beside eleven cells of noise one is that by a chance of
3e-6 at most."""
SKEWED = 3.0
"""Condition of the two directions of motion beyond which a jump does not tell them apart: the σ of
one is then three times the other's."""
JUMP_SIGMA = 8.0
"""σ from which a jump is one: 1e-15 a row of white noise, and room for what is not white."""
SCATTER_COUNTS = 0.3
"""Standard deviations of a run's mean by which the scatter of commands must move the wave within it
to count: less makes σ of the mean larger by under a
twentieth."""
SCATTER_TOLD = 1.0
"""The same from which it is told: σ is 1.4 times that of the windows."""
MOST_SCATTER = 1.2
"""Largest part of the commands' scatter that a motor follows; more than 1 where the scatter itself
is measured too small."""
SMALLER_BY_CHANCE = 3.0
"""σ by which a cause may be smaller than it came out."""
UNHEARD = 2.0
"""Times the power in the samples that the least of a cause must make to be excluded."""
UNCLIPPED = 1.02
"""Largest amplitude that was not clipped, over the least that was in another run, from which the
two have no level in common."""
WHOLE_SIGMA = 4.0
"""Standard deviations within which a time is one of whole samples."""
