"""Mistakes that a person could make, as data: file below hrg_cli, tests that should notice, and the
changes (old text, new text).

Each changes one thing: a sign, a factor of two, a dropped term, a swapped channel, a wrong σ, a
moved threshold, a missing guard.
"""

Change = tuple[str, str]

MUTATIONS: dict[str, tuple[str, tuple[Change, ...]]] = {
    "stages/diagnosis/samples/tone_size.py": (
        "tests/stages/diagnosis/samples/test_tone_size.py",
        (
            ("own = fit.basis.project_out(own.reshape(len(columns), -1))", "own = own.reshape(len(columns), -1)"),
            ("vector = size[..., 0] - 1j * size[..., 1]", "vector = size[..., 0] + 1j * size[..., 1]"),
            ("NEAREST_CYCLES = 1.0", "NEAREST_CYCLES = 0.1"),
            ("(below - above) / (2 * bend)", "(above - below) / (2 * bend)"),
        ),
    ),
    "fitting/samples/stillness.py": (
        "tests/fitting/samples/test_stillness.py",
        (
            ("same = (c[1:] == c[:-1]) & (s[1:] == s[:-1])", "same = c[1:] != c[:-1]"),
            ("stretches[:, 1] - stretches[:, 0] + 1 >= least", "stretches[:, 1] - stretches[:, 0] + 1 >= 2"),
        ),
    ),
    "fitting/samples/neighbours.py": (
        "tests/fitting/samples/test_gaps_of_looks.py",
        (("known = finite if sure is None else finite & sure", "known = finite"),),
    ),
    "fitting/samples/oscillation_search.py": (
        "tests/fitting/samples/test_gaps_of_looks.py",
        (("look = whole if spectra else keep_together(whole)", "look = whole"),),
    ),
    "physics/drift.py": (
        "tests/physics/test_drift.py",
        (
            ("damping = mechanics.damping_split_1_s * np.sin(chi) * (1 + r**2)", "damping = mechanics.damping_split_1_s * np.sin(chi)"),
            ("(damping - 2 * r * mechanics", "(damping - r * mechanics"),
            ("- quadrature_force + r * main_force) / (1 - r**2)", "- quadrature_force - r * main_force) / (1 - r**2)"),
            ("- 2 * r * mechanics.frequency_split_rad_s * np.cos(zeta)", "+ 2 * r * mechanics.frequency_split_rad_s * np.cos(zeta)"),
            ("np.abs(mechanics.damping_split_1_s) + split", "np.abs(mechanics.damping_split_1_s) - split"),
            ("along * (1 + r**2) + 2 * friction * r", "along * (1 + r**2) - 2 * friction * r"),
            ("along / (nu - mechanics.damping_split_1_s * np.cos(chi)", "along / (nu + mechanics.damping_split_1_s * np.cos(chi)"),
            ("split * np.sin(2 * zeta)", "split * np.sin(zeta)"),
            ('(2 if drive == "parametric" else 1)', "1"),
            ("efolds = 2 * mechanics.damping_split_1_s", "efolds = mechanics.damping_split_1_s"),
            ("turns = np.round(offset / np.pi)", "turns = 0 * offset"),
            ("m2 = 2 * mechanics.mode_number", "m2 = mechanics.mode_number"),
        ),
    ),
    "physics/ellipse.py": (
        "tests/physics/test_ellipse.py tests/fitting/ellipse/test_closed_form.py tests/fitting/ellipse/test_continuity.py",
        (
            ("(main_amplitude * sin - 1j * quadrature_amplitude * cos)", "(main_amplitude * sin + 1j * quadrature_amplitude * cos)"),
            ("2 * cross.real, 2 * cross.imag", "2 * cross.real, -2 * cross.imag"),
            ("a_A = np.sqrt((s0 + np.hypot(s1, s2)) / 2)", "a_A = np.sqrt((s0 - np.hypot(s1, s2)) / 2)"),
            ("np.divide(s3, 2 * a_A,", "np.divide(s3, a_A,"),
            ("electrical = np.arctan2(s2, s1) / 2", "electrical = np.arctan2(s2, s1)"),
            ("np.cos(electrical) * u[..., 0] + np.sin", "np.cos(electrical) * u[..., 0] - np.sin"),
            ("return a_A, a_B, electrical / mode_number, phase", "return a_A, a_B, electrical, phase"),
            ("np.unwrap(phase[good] + turned * np.pi)", "np.unwrap(phase[good])"),
        ),
    ),
    "physics/resonator.py": (
        "tests/physics/test_resonator.py tests/physics/test_axes.py tests/fitting/envelopes/test_likelihood.py",
        (
            ("J = np.array([[0.0, 1.0], [-1.0, 0.0]])", "J = np.array([[0.0, -1.0], [1.0, 0.0]])"),
            ("make_reflection(2 * self.mode_number * self.damping_axis_rad)", "make_reflection(self.mode_number * self.damping_axis_rad)"),
            ("(omega**2 + split**2) * IDENTITY", "omega**2 * IDENTITY"),
            ("+ 2 * omega * split * make_reflection", "- 2 * omega * split * make_reflection"),
            ("np.stack([sin, -cos], -1)", "np.stack([sin, cos], -1)"),
            ("damping = mechanics.build_damping_matrix() - turning", "damping = mechanics.build_damping_matrix() + turning"),
            ("1j * (root - omega_r * IDENTITY)", "1j * (omega_r * IDENTITY - root)"),
            ("(L @ L + 2 * damping @ L)", "(L @ L + damping @ L)"),
            ("1 + x**2 / 6", "1 - x**2 / 6"),
            ("half = (L[..., 0, 0] + L[..., 1, 1])[..., None, None] / 2", "half = (L[..., 0, 0] + L[..., 1, 1])[..., None, None]"),
        ),
    ),
    "physics/signals.py": (
        "tests/physics/test_signals.py tests/fitting/ellipse/test_closed_form.py",
        (
            ("lower = -z[..., 2::4] + 1j * z[..., 0::4]", "lower = -z[..., 2::4] - 1j * z[..., 0::4]"),
            ("upper = -z[..., 3::4] - 1j * z[..., 1::4]", "upper = z[..., 3::4] - 1j * z[..., 1::4]"),
            ("lower.imag, -upper.imag", "lower.imag, upper.imag"),
            ("four[..., 0::2] - 1j * four[..., 1::2]", "four[..., 0::2] + 1j * four[..., 1::2]"),
            ("np.sin(phi - psi), np.cos(phi + psi)", "np.sin(phi + psi), np.cos(phi + psi)"),
        ),
    ),
    "physics/readout.py": (
        "tests/stages/test_simulate.py",
        (
            ("-2 * np.sin(2 * np.pi * turns", "-np.sin(2 * np.pi * turns"),
            ("-top, top - 1)", "-top, top)"),
            ("return 2 * readout.full_scale / 2**readout.adc_bits", "return readout.full_scale / 2**readout.adc_bits"),
        ),
    ),
    "physics/electrodes.py": (
        "tests/physics/test_electrodes.py tests/stages/simulation/test_simulate_electronics.py tests/stages/test_simulate.py",
        (
            ("gap * moved * (1 + c**2) / (1 - c**2) ** 2", "gap * moved * (1 + c**2) / (1 - c**2)"),
            ("if reach >= 1:", "if False:"),
            ("gap / 4 * SIGNS[k]", "gap / 2 * SIGNS[k]"),
            ("moved / gaps[k] / near**2", "moved / near**2"),
            ("return 3.0 if law", "return 1.0 if law"),
        ),
    ),
    "physics/environment.py": (
        "tests/stages/test_simulate.py tests/stages/test_simulation_file.py",
        (
            ("np.interp(x, t, v)", "np.interp(x, t, v[::-1])"),
            ("omega = 2 * np.pi * frequency_hz", "omega = np.pi * frequency_hz"),
            ("EARTH_RATE_RAD_S * np.sin(latitude_rad)", "EARTH_RATE_RAD_S * np.cos(latitude_rad)"),
            ("if count > _MOST_ROWS:", "if False:"),
            ("np.array([0.0, 1.0, 0.0, -1.0])[corner % 4]", "np.array([0.0, 1.0, 0.0, 1.0])[corner % 4]"),
        ),
    ),
    "physics/coefficients.py": (
        "tests/stages/test_simulate.py",
        (
            ("if len(wrong):", "if False:"),
        ),
    ),
    "stages/simulation/blocks.py": (
        "tests/stages/test_simulate.py",
        (
            ("if not len(wrong):", "if True:"),
        ),
    ),
    "stages/simulation_file.py": (
        "tests/stages/test_simulate.py tests/stages/test_simulation_file.py",
        (
            ("not SMALLEST <= size <= LARGEST:", "size > LARGEST:"),
            ("not SMALLEST <= size <= LARGEST:", "size < SMALLEST:"),
        ),
    ),
    "commands/simulate.py": (
        "tests/test_bad_inputs.py",
        (
            ("if need > free:", "if need > 1e12 * free:"),
        ),
    ),
    "formats/matlab_child.py": (
        "tests/formats/test_lab_formats.py",
        (
            ("os.read(0, 1)", "threading.Event().wait()"),
        ),
    ),
    "fitting/ellipse/closed_form.py": (
        "tests/fitting/ellipse/test_closed_form.py",
        (
            ("np.angle(cross[..., 0] + cross[..., 1]) / 2", "np.angle(cross[..., 0] + cross[..., 1])"),
            ("half_difference = (from_upper - from_lower) / 2", "half_difference = from_upper - from_lower"),
            ("(from_lower + from_upper) / 2, psi", "(from_lower - from_upper) / 2, psi"),
            ("half_turns = np.ceil(psi / np.pi - 0.5)", "half_turns = np.ceil(psi / np.pi + 0.5)"),
        ),
    ),
    "fitting/ellipse/gauss_newton.py": (
        "tests/fitting/ellipse/test_gauss_newton.py",
        (
            ("z5 * ssm - z6 * ssp - z7 * scm", "z5 * ssm + z6 * ssp - z7 * scm"),
            ("(A * P - B * Q) / determinant, (A * Q - B * P) / determinant", "(A * P + B * Q) / determinant, (A * Q + B * P) / determinant"),
            ("determinant, power = A**2 - B**2", "determinant, power = A**2 + B**2"),
            ("psi_step = np.zeros_like(A) if carrier_known else", "psi_step ="),
        ),
    ),
    "fitting/ellipse/uncertainty.py": (
        "tests/fitting/ellipse/test_uncertainty.py",
        (
            ("np.pi / np.sqrt(12), np.pi / np.sqrt(3), np.pi / np.sqrt(12)", "np.pi / np.sqrt(12), np.pi / np.sqrt(12), np.pi / np.sqrt(12)"),
            ("np.pi / np.sqrt(12), np.pi / np.sqrt(3)", "np.pi / np.sqrt(3), np.pi / np.sqrt(3)"),
            ("np.abs(A2 - B2)", "np.abs(A2 + B2)"),
            ("_limited(both - mixed", "_limited(both"),
            ("np.ascontiguousarray(variances.T) / 8", "np.ascontiguousarray(variances.T) / 4"),
            ("cos, sin = _double_angle(psi)", "cos, sin = _double_angle(psi / 2)"),
            ("_root(sin2 * less[0] + cos2", "_root(sin2 * more[0] + cos2"),
        ),
    ),
    "fitting/ellipse/continuity.py": (
        "tests/fitting/ellipse/test_continuity.py",
        (
            ("phase = phase + np.pi * np.round((carrier - carrier_phase) / np.pi)", "phase = phase + 0.0"),
            ("phase = phase + np.pi * np.round((electrical - angle) / np.pi)", "phase = phase + 0.0"),
            ("phase = phase + np.pi * (carrier_turns + turns)", "phase = phase + np.pi * turns"),
            ("np.round((steps[gaps] - predicted) / period)", "np.round(steps[gaps] / period)"),
            ("intervals > 1.5 * max(", "intervals > 1e9 * max("),
            ("if length & size:", "if True:"),
            ("electrical + np.pi * turns, phase", "electrical, phase"),
        ),
    ),
    "fitting/tables/allan.py": (
        "tests/fitting/tables/test_allan.py",
        (
            ("** 2) / 2) / (n * interval_s)", "** 2)) / (n * interval_s)"),
            ("angle[2 * n :] - 2 * angle[n:-n]", "angle[2 * n :] - angle[n:-n]"),
            ("1 / np.sqrt(2 * np.maximum(count / size - 1, 1))", "1 / np.sqrt(np.maximum(count / size - 1, 1))"),
            ("np.asarray(rate, dtype=float) - np.mean(rate))]) * interval_s", "np.asarray(rate, dtype=float) - np.mean(rate))])"),
        ),
    ),
    "fourier.py": (
        "tests/test_fourier.py",
        (
            ("columns[:, 1::2] = np.cos(angle[:, None] * n) * loss", "columns[:, 1::2] = np.sin(angle[:, None] * n) * loss"),
            ("n = 2 * mode_number * np.arange", "n = mode_number * np.arange"),
            ("np.sinc(np.asarray(travel_rad)[..., None] * n / (2 * np.pi))", "np.sinc(np.asarray(travel_rad)[..., None] * n / np.pi)"),
            ("weights[rows, left] = 1 - part", "weights[rows, left] = part"),
        ),
    ),
    "fitting/tables/increments.py": (
        "tests/fitting/tables/test_increments.py",
        (
            ("self.mode_number * np.diff(self.angle_rad)", "np.diff(self.angle_rad)"),
            ("(values[1:] + values[:-1]) / 2", "values[1:] + values[:-1]"),
            ("integral = turned + integral[start", "integral = integral[start"),
            ("2 * np.pi * (joined[\"frequency_hz\"] - wave.reference_frequency_hz)", "2 * np.pi * joined[\"frequency_hz\"]"),
            ("** 2, power=2", "** 2, power=1"),
            ("if standing.any():", "if False:"),
        ),
    ),
    "fitting/noise/increment_noise.py": (
        "tests/fitting/tables/test_increments.py",
        (
            ("(width[1:] + width[:-1]) / 6, 0)", "(width[1:] + width[:-1]) / 2, 0)"),
            ("-white[1:-1] + noise.walk", "white[1:-1] + noise.walk"),
            ("white[1:] + white[:-1] + noise.walk", "white[1:] + noise.walk"),
            ("NEEDED_GAIN = 6.0", "NEEDED_GAIN = 0.0"),
        ),
    ),
    "fitting/samples/basis.py": (
        "tests/fitting/samples/test_basis.py tests/stages/test_demodulate.py",
        (
            ("(np.arange(samples) - (samples - 1) / 2)", "(np.arange(samples) - samples / 2)"),
            ("phase = 2 * np.pi * np.multiply.outer", "phase = np.pi * np.multiply.outer"),
            ("1j * (m01 - m10)) / 2", "1j * (m01 - m10))"),
            ("self.orthonormal.shape[0] - self.orthonormal.shape[1]", "self.orthonormal.shape[0]"),
        ),
    ),
    "fitting/samples/course.py": (
        "tests/fitting/samples/test_course.py",
        (
            ("(x - h) * (self.alpha[k] + self.beta[k] * x)", "(x - h) * self.alpha[k]"),
            ("self.alpha / 6 + self.beta * h / 12", "self.alpha / 12 + self.beta * h / 12"),
            ("(self.value[1:] + self.value[:-1]) / 2 - bent", "(self.value[1:] + self.value[:-1]) / 2 + bent"),
        ),
    ),
    "fitting/samples/windows.py": (
        "tests/stages/test_demodulate.py",
        (
            ("np.tile([1.0, -1.0]", "np.tile([1.0, 1.0]"),
        ),
    ),
    "fitting/samples/envelope_motion.py": (
        "tests/stages/test_demodulate.py",
        (
            ("/ (2 * h * window_s)", "/ (h * window_s)"),
        ),
    ),
    "fitting/samples/demodulator.py": (
        "tests/stages/test_demodulate.py",
        (
            ("return max(least, self.find_scale(k) ** 2 / 12)", "return max(least, self.find_scale(k) ** 2)"),
            ("self.survey.least_count[k] ** 2 / 12", "self.survey.least_count[k] ** 2"),
            ("self.recording.c_scale_factor if k == 0 else self.recording.s_scale_factor", "self.recording.s_scale_factor if k == 0 else self.recording.c_scale_factor"),
        ),
    ),
    "fitting/causes/evidence.py": (
        "tests/fitting/causes/test_evidence.py tests/stages/diagnosis/search/test_gain.py",
        (
            ("return each + min(by_chance, (count - 1) * each)", "return each"),
            ("return each + min(by_chance, (count - 1) * each)", "return count * each"),
            ("each = float(np.log(rows))", "each = 2.0"),
        ),
    ),
    "fitting/causes/left_out_folds.py": (
        "tests/fitting/causes/test_evidence.py tests/stages/diagnosis/search/test_gain.py",
        (
            ("logs.std(ddof=1) / np.sqrt(len(logs))", "logs.std(ddof=1)"),
            ("0.5 * np.log(np.maximum(self.before", "np.log(np.maximum(self.before"),
        ),
    ),
    "fitting/tables/allan_terms.py": (
        "tests/fitting/tables/test_allan_terms.py",
        (
            ("2 * np.log(2) / np.pi), time / 3]", "np.log(2) / np.pi), time / 3]"),
            ("b / (2 * np.pi * f)", "b / (np.pi * f)"),
            ("3 / time**2, 1 / time", "1 / time**2, 1 / time"),
            ("time / 3], axis=1", "time / 6], axis=1"),
            ("h2 * (2 * two_sided)", "h2 * two_sided"),
            ("NORMAL_95 * std / square / 2", "NORMAL_95 * std / square / 20"),
        ),
    ),
    "fitting/tables/common_walk.py": (
        "tests/stages/test_calibrate.py",
        (
            ("2 * self.white + q * (self.interval_s - self.width_s / 3)", "2 * self.white"),
            ("+ float(np.linalg.slogdet(A)[1])", ""),
        ),
    ),
    "fitting/tables/shrinkage.py": (
        "tests/fitting/tables/test_shrinkage.py",
        (
            ("    b = A @ flat\n", ""),
        ),
    ),
    "stages/calibration/frequency_split.py": (
        "tests/stages/calibration/test_frequency_split.py",
        (
            ("np.ptp(path.frequency_hz) > 0", "True"),
            ("return KnownCoefficients(-2 * found, 4 * spread)", "return KnownCoefficients(-2 * found, spread / 4)"),
            ("return KnownCoefficients(-2 * found, ", "return KnownCoefficients(2 * found, "),
        ),
    ),
    "stages/rehearsing/rehearsed_figures.py": (
        "tests/stages/test_rehearse.py",
        (
            ("doubted=bool(unseen and settings.get(limit) is None)", "doubted=False"),
        ),
    ),
    "stages/calibration/variant_average.py": (
        "tests/stages/calibration/test_variant_average.py",
        (
            ("np.exp(-(chi2 - chi2.min()) / 2)", "np.exp((chi2 - chi2.min()) / 2)"),
            ("mixed[rest, rest] = solution.covariance[rest, rest]", "pass"),
            ("[tables, tables] + np.outer(step, step)", "[tables, tables]"),
        ),
    ),
    "stages/calibration/programme.py": (
        "tests/stages/calibration/test_programme_nodes.py",
        (
            ("spans[away[-1]] <= SWEEPING * spans[kept].max()", "spans[away[-1]] < 0"),
            ("parts = round((b - a) / spacing) if b - a > WIDE * spacing and turning else 1", "parts = 1"),
            ("np.ptp(here) > TWO_RATES", "np.ptp(here) >= 0 * TWO_RATES"),
        ),
    ),
    "fitting/tables/normal_pieces.py": (
        "tests/stages/test_calibrate.py",
        (
            ("others = solve(A - A_f, b - b_f, model, penalty)", "others = solve(A, b, model, penalty)"),
        ),
    ),
    "fitting/tables/joint.py": (
        "tests/stages/test_calibrate.py",
        (
            ("max(n.walk, walk)", "n.walk"),
        ),
    ),
    "fitting/checks.py": (
        "tests/fitting/test_checks.py",
        (
            ("bool(value <= limit)", "not value > limit"),
            ("bool(value >= limit)", "not value < limit"),
            ("chdtri(dof, CHANCE) / dof", "2 * chdtri(dof, CHANCE) / dof"),
            ("/ dof + NOISE_KNOWN", "/ dof"),
            ("count * power / variance / (1 + allowed)", "count * power / variance / (1 + allowed) / 1.2"),
            ("float(np.mean(sums**2)) / length", "float(np.mean(sums**2)) / 2"),
            ("len(chances) * min(chances)", "min(chances)"),
            ("or np.any(variance < 0)", ""),
            ("* (1 - np.eye(len(matrix)))", ""),
            ("float(np.mean(sums**2)) / length", "float(np.mean(sums**2))"),
        ),
    ),
    "stages/diagnosis/search/gain.py": (
        "tests/stages/diagnosis/search/test_gain.py",
        (
            ("squares.std(ddof=1) / np.sqrt(len(squares))", "squares.std(ddof=1)"),
            ("spread / (2 * rms)", "spread / rms"),
            ("if len(runs) >= fewest_runs:", "if len(runs) > fewest_runs:"),
            ("TIME_BLOCKS, TIME_BLOCKS - 1", "TIME_BLOCKS, TIME_BLOCKS - 2"),
        ),
    ),
    "memory.py": (
        "tests/lots/test_batch.py",
        (
            ("noted[\"key\"] == key and", ""),
            ("store.compute_sha256(folder / name) == digest for name", "True for name"),
        ),
    ),
    "stages/demodulation/judge.py": (
        "tests/stages/test_demodulate.py tests/stages/demodulation/test_demodulate_uneven.py tests/test_bad_inputs.py",
        (
            ("(suspect if clipped > CLIPPED_SHARE * self.rows", "(suspect if clipped > 20 * CLIPPED_SHARE * self.rows"),
            ("(suspect if bad > NOT_FINITE_SHARE * self.rows", "(suspect if bad > 20 * NOT_FINITE_SHARE * self.rows"),
            ("(suspect if gaps > GAPS_SHARE * self.rows", "(suspect if gaps > 9 * GAPS_SHARE * self.rows"),
            ("if self.flagged.get(FLAG_NOT_FINITE, 0) == self.rows:", "if False:"),
            ("rows[\"flags\"][:stop][far[:stop]] |= FLAG_SETTLING", "pass"),
        ),
    ),
    "stages/demodulation/auxiliary_log.py": (
        "tests/stages/test_demodulate.py tests/stages/demodulation/test_demodulate_uneven.py tests/test_bad_inputs.py tests/stages/demodulation/test_demodulate_log_rows.py",
        (("series[outside] = np.nan", "pass"),),
    ),
    "stages/compensate.py": (
        "tests/stages/test_compensate.py",
        (
            ("abs(seen / scale_factor - 1) > 0.05", "abs(seen / scale_factor - 1) > 0.5"),
            ("if strong and seen * scale_factor < 0:", "if False:"),
            ("if wave.mode_number != calibration.mode_number:", "if False:"),
            ("if calibration.correction != CORRECTION:", "if False:"),
            ("if wave.gyro_id and calibration.gyro_id and wave.gyro_id != calibration.gyro_id:", "if False:"),
            ("if calibration.status == \"refused\":", "if False:"),
            ("rate_max_rad_s + 0.1 * span", "rate_max_rad_s + 10 * span"),
        ),
    ),
    "stages/compensation/run_sums.py": (
        "tests/stages/test_compensate.py",
        (
            ("middles.interpolate(angle_rad)[rows]", "angle_rad[1:][rows]"),
            ("self.angle_rad = float(angle_rad[rows.stop])", "self.angle_rad = 0.0"),
        ),
    ),
    "stages/compensation/block_rates.py": (
        "tests/stages/test_compensate.py",
        (
            ("(drift - path.turn / path.interval_s) / scale", "(drift + path.turn / path.interval_s) / scale"),
            ("if windows == 1:", "if windows:"),
        ),
    ),
    "stages/compensation/middles.py": (
        "tests/stages/compensation/test_middles.py",
        (
            ("half = path.blur_s[blocks] / size / 2", "half = 0 * path.blur_s[blocks]"),
            ("- 2 * shared)", "- 0 * shared)"),
        ),
    ),
    "stages/calibration/interpolation.py": (
        "tests/stages/test_calibrate.py tests/stages/test_compensate.py tests/stages/calibration/test_calibrate_variants.py",
        (
            ("slack = 0.02 * (calibration.node_max", "slack = 2.0 * (calibration.node_max"),
            ("np.asarray(-2 * path.average_neighbours(path.ratio)", "np.asarray(2 * path.average_neighbours(path.ratio)"),
            ("np.sum((rows @ block) * rows, axis=1) +", "np.sum((rows @ block) * rows, axis=1) / 4 +"),
        ),
    ),
    "stages/figures_of_merit.py": (
        "tests/stages/test_figures_of_merit.py",
        (
            ("np.ptp(bias, axis=1).max() / 2", "np.ptp(bias, axis=1).max()"),
            ("/ 2 / mean * 1e6),\n        \"scale_factor_temperature_ppm\"", "/ mean * 1e6),\n        \"scale_factor_temperature_ppm\""),
        ),
    ),
    "store/validity.py": (
        "tests/store/test_validity_bounds.py tests/store/test_validity.py tests/test_bad_inputs.py",
        (
            ("\"raw\": \"iuf\", \"f8\": \"iuf\"", "\"raw\": \"iufb\", \"f8\": \"iuf\""),
            ("\"u1\": \"iu\"", "\"u1\": \"iuf\""),
            ("(values < limits.min) | (values > limits.max)", "values > np.inf"),
            ("else values <= valid.above", "else values < valid.above"),
            ("else values < valid.at_least", "else values < valid.at_least - 10"),
            ("else values > valid.at_most", "else values > 10 * valid.at_most"),
            ("np.diff(np.asarray(values), axis=0) <= 0", "np.diff(np.asarray(values), axis=0) < 0"),
            ("place = _find_first(np.isinf(values))", "place = None"),
            ("missing = missing & ~rows.reshape", "missing = missing & rows.reshape"),
            ("if np.isinf(value) and not valid.infinite:", "if False:"),
            ("if valid.above is not None and not value > valid.above:", "if False:"),
            ("if valid.at_least is not None and not value >= valid.at_least:", "if False:"),
            ("if valid.at_most is not None and not value <= valid.at_most:", "if False:"),
            ("return None if isinstance(value, kind) else", "return None if True else"),
            ("if count != wanted:", "if False:"),
            ("if getattr(record, name) == 0:", "if False:"),
            ("if len(record.covariance) != coefficients:", "if False:"),
            ("if record.node_min > record.node_max or", "if"),
            ("            if not values.flat[0] > before:", "            if False:"),
            ("if count % 2 == 0:", "if False:"),
        ),
    ),
    "store/lazy.py": (
        "tests/store/test_validity.py tests/test_bad_inputs.py tests/store/test_store.py",
        (
            ("if end == first and not values.flat[0] > last:", "if False:"),
            ("return values.astype(spec.dtype, copy=False)", "return values"),
            ("problem = find_values_problem(", "problem = None and find_values_problem("),
        ),
    ),
    "store/handles.py": (
        "tests/store/test_validity.py tests/store/test_store.py tests/test_bad_inputs.py tests/store/test_unreadable_parts.py",
        (
            ("at = max(USER_BLOCK, 2 * at)", "break"),
            ("at = max(USER_BLOCK, 2 * at)", "at += USER_BLOCK"),
            ("while len(_in_use) >= MOST_OPEN:", "while False:"),
            ("if self._stamp not in (None,", "if self._stamp in ((0, 0),"),
            ("if path.stat().st_size == 0:", "if False:"),
            ("check_heaps(path)\n", "pass\n"),
        ),
    ),
    "store/heaps.py": (
        "tests/store/test_store.py tests/store/test_unreadable_parts.py",
        (
            ("if step <= 0:", "if False:"),
            ("[0] if size <= SCANNED_BYTES else [0, size - SCANNED_BYTES]", "[0]"),
            ("PIECE_BYTES + len(SIGNATURE) - 1", "PIECE_BYTES"),
            ("return os.pread(self.handle, length, place)", "return self.content[first : first + length]"),
        ),
    ),
    "store/reading.py": (
        "tests/store/test_store.py tests/store/test_validity.py tests/robustness/test_nothing_lost.py tests/test_bad_inputs.py",
        (
            ("if status not in (\"valid\", \"suspect\", \"refused\"):", "if False:"),
        ),
    ),
    "store/headings.py": (
        "tests/store/test_store.py tests/store/test_validity.py tests/robustness/test_nothing_lost.py tests/test_bad_inputs.py",
        (
            ("if found is not kind:", "if False:"),
            ("if kind not in BY_NAME:", "if False:"),
            ("version.split(\".\")[0] != FORMAT_VERSION.split(\".\")[0]", "False"),
            ("if number != int(number):", "if False:"),
        ),
    ),
    "store/dataset_checks.py": (
        "tests/store/test_store.py tests/store/test_validity.py tests/store/test_unreadable_parts.py tests/robustness/test_nothing_lost.py tests/test_bad_inputs.py",
        (
            ("return holder[place] if place in holder else None", "return holder.get(place)"),
            ("claimed - stored > LARGEST_GAP_BYTES", "False"),
            ("dataset.is_virtual or layout.get_external_count()", "dataset.is_virtual"),
            ("if known != size:", "if False:"),
            ("to_file_unit(decode_text(units)) != spec.units", "False"),
            ("if claimed > UNPACKED_BYTES and", "if False and"),
        ),
    ),
    "store/covariance_checks.py": (
        "tests/store/test_validity_bounds.py",
        (
            ("if np.any(variances < 0):", "if False:"),
            ("np.abs(correlations - correlations.T) > ROUNDING", "np.abs(correlations) > 2"),
            ("abs(worst) > 1 + ROUNDING", "worst > 1 + ROUNDING"),
            ("ROUNDING = 1e-6", "ROUNDING = 0.0"),
        ),
    ),
    "store/report_checks.py": (
        "tests/store/test_validity_bounds.py",
        (
            ("or not all(isinstance(row, dict) for row in rows)", ""),
            ("or isinstance(row[key], bool)", ""),
            ("if wrong is None else", "if True else"),
        ),
    ),
    "store/writing.py": (
        "tests/store/test_store.py tests/store/test_validity.py tests/test_verification.py",
        (
            ("            if spec.dtype == \"raw\":\n                options[\"fletcher32\"] = True", "            if spec.dtype == \"raw\":\n                pass"),
            ("elif spec.dims[0] == \"row\" or array.nbytes > 4096:\n                options[\"fletcher32\"] = True", "elif spec.dims[0] == \"row\" or array.nbytes > 4096:\n                options[\"fletcher32\"] = False"),
            ("promised.check(block)", "pass"),
            ("seal(file, running)", "pass"),
            ("dataset[start:] = array", "dataset[start:] = array[::-1]"),
            ("running[place].add(array)\n        dataset.attrs", "pass\n        dataset.attrs"),
            ("return len(zlib.compress(shuffled, 1)) < 0.67", "return len(zlib.compress(shuffled, 1)) < 0"),
        ),
    ),
    "store/atomic.py": (
        "tests/store/test_store.py tests/commands/test_commands.py tests/test_outputs.py tests/commands/test_places.py",
        (
            ("if os.path.lexists(path) and not force:", "if False:"),
            ("_keep_rights(path, temporary)\n", "pass\n"),
            ("if os.path.lexists(path) and not force:", "if path.exists() and not force:"),
            ("path.exists() and not path.is_file()", "False"),
            ("_rename_to_new(temporary, path)", "os.replace(temporary, path)"),
            ("            temporary.unlink()", "            pass"),
            ("if match[1] == name_host() and", "if"),
            ("> ABANDONED_S", "< ABANDONED_S"),
            ("if str(path) == \"-\":", "if False:"),
            ("any(len(os.fsencode(part)) > LONGEST_NAME for part in path.parts)", "False"),
        ),
    ),
    "store/checksums.py": (
        "tests/test_verification.py",
        (
            ("return [] if digest() == kept else", "return [] if True else"),
            ("if kept is not None and kept.split(\" \")[0] != _form(dataset):", "if False:"),
            ("gone = sorted({place.removesuffix(\"@\") for place in left})", "gone = []"),
            ("        kept[f\"{path}@\"] = digest_attributes(item)", "        pass"),
            ("return [f\"{what} were added\"]", "return []"),
            ("return [\"the checksums were changed\"]", "return None"),
            ("and not dataset.id.get_storage_size()", ""),
            ("for place in _links(file)]", "for place in ()]"),
        ),
    ),
    "origins.py": (
        "tests/store/test_unreadable_parts.py tests/test_inputs_of_many.py",
        (
            ("except NotHrgError:", "except Exception:"),
            ("return a < d and c < b", "return a <= d and c <= b"),
            ("(fingerprint(recording) + part,)", "(fingerprint(recording),)"),
        ),
    ),
    "ledger/database.py": (
        "tests/ledger/test_database.py",
        (
            ("timeout=STEP_S", "timeout=WAIT_S"),
            ("if not _is_busy(error) or", "if"),
            ("if said != \"ok\":", "if False:"),
            ("if version != VERSION:", "if False:"),
            ("        parse_time(time_text)", "        pass"),
            ("if not math.isfinite(figure.value):", "if False:"),
            ("\" ON CONFLICT (sha256) DO NOTHING\"", "\"\""),
        ),
    ),
    "formats/unpacked.py": (
        "tests/formats/test_packed_logs.py",
        (
            ("if self.tell() > self._room:", "if False:"),
            ("max(LARGEST_BYTES, LARGEST_RATIO * path.stat().st_size)", "LARGEST_BYTES"),
        ),
    ),
    "streams.py": (
        "tests/test_streams.py",
        (
            ("drop(self.fileno())\n            raise HrgError", "raise HrgError"),
            ("with contextlib.suppress(OSError):\n            return super().write(data)", "return super().write(data)"),
            ("for handle in (INPUT, OUTPUT, ERROR):", "for handle in ():"),
        ),
    ),
    "verification.py": (
        "tests/test_verification.py",
        (
            ("if match is None and named.is_file():", "if False:"),
            ("if found != digest:", "if False:"),
            ("if found is None:", "if False:"),
            ("if line not in own.history", "if False"),
            ("own.created < made.created", "False"),
            ("record.kind != Recording.kind", "False"),
            ("match != named and named.is_file()", "False"),
            ("and self._digest(named) is None", "and False"),
            ("if not output.is_file():", "if False:"),
            ("if len(by_settings) > 1:", "if False:"),
            ("self._digest(p) == source.sha256", "p == named"),
            ("            if place in self.verdicts:\n                continue", "            if False:\n                continue"),
        ),
    ),
    "limits.py": (
        "tests/test_limits.py",
        (
            ("inside = value is not None and math.isfinite(value)", "inside = value is not None"),
            ("value >= minimum)", "value > minimum - 1)"),
            ("value <= maximum)", "value < maximum + 1)"),
            ("float(allowed), worst <= allowed,", "float(allowed), True,"),
            ("if len(table) > MOST_LIMITS:", "if False:"),
            ("return None, limit_value(name, limit)", "return limit_value(name, limit), None"),
        ),
    ),
    "settings.py": (
        "tests/test_settings.py tests/test_outputs.py",
        (
            ("if isinstance(value, int) and not -LARGEST_INTEGER <= value < LARGEST_INTEGER:", "if False:"),
            ("if count > MOST_KEYS:", "if False:"),
            ("found[:MOST_TOLD]]", "found]"),
            ("return check_settings(stage, from_file | given, usage=True)", "return check_settings(stage, given | from_file, usage=True)"),
            ("kind = UsageError if usage else HrgError", "kind = HrgError"),
            ("extra=\"forbid\", frozen=True", "frozen=True"),
        ),
    ),
    "exporting_records.py": (
        "tests/test_outputs.py",
        (
            ("[escape_for_spreadsheet(value) for value in values.tolist()]", "values.tolist()"),
            ("return escape_for_spreadsheet(value)[:LONGEST_CELL]", "return value[:LONGEST_CELL]"),
        ),
    ),
    "exporting/table_files.py": (
        "tests/exporting/test_exporting.py tests/exporting/test_exporting_variants.py tests/test_outputs.py",
        (
            ("if calibration.status == \"refused\":", "if False:"),
        ),
    ),
    "exporting/c_grid.py": (
        "tests/exporting/test_exporting.py tests/exporting/test_exporting_variants.py tests/test_outputs.py",
        (
            ("top = 2 ** (bits - 1) - 1", "top = 2**bits - 1"),
            ("(k + 1) % angles\n    low", "k\n    low"),
            ("(over_nodes + over_angles) / PLACES", "over_nodes / PLACES / 4"),
        ),
    ),
    "exporting/c_header.py": (
        "tests/exporting/test_exporting.py tests/exporting/test_exporting_variants.py tests/test_outputs.py",
        (
            ("gyro=escape_c_comment(calibration.gyro_id)", "gyro=calibration.gyro_id"),
            ("correction=escape_c_comment(calibration.correction)", "correction=calibration.correction"),
            ("+ errors[\"drift_rad_s_rounding\"]", ""),
            ("+ errors[\"scale_factor_rounding\"]", ""),
            ("(int64_t)(u * 32768.0), k", "(int64_t)(u * 16384.0), k"),
        ),
    ),
    "reporting/text.py": (
        "tests/test_outputs.py tests/reporting/test_page.py",
        (
            ("return f\"'{text}\" if", "return text if"),
            ("return UNREADABLE.sub(\"\\ufffd\", str(value))", "return str(value)"),
            (".replace(\"*/\", \"* /\")", ""),
        ),
    ),
    "executors.py": (
        "tests/lots/test_batch.py tests/lots/test_batch_interrupts.py",
        (
            ("(ready if losses[index] < ROUNDS else alone).appendleft(index)", "ended(index, None)"),
            ("ready.extendleft(reversed(range(len(every), len(every) + len(following))))", "ready.extend(range(len(every), len(every) + len(following)))"),
            ("and len(running) < _room(executor)", ""),
            ("                child.kill()", "                pass"),
            (", initializer=_end_with_parent", ""),
        ),
    ),
    "lots/lot_table.py": (
        "tests/lots/test_batch.py",
        (
            ("spread = max(MAD * median", "spread = max(median"),
            ("lot.outlier_rate / len(compared)", "lot.outlier_rate * 20"),
            ("if abs(row[\"distances\"].get(name, 0.0)) > limit:", "if row[\"distances\"].get(name, 0.0) < -limit:"),
            ("len(values) < FEWEST", "len(values) < 2"),
            ("ROUNDING * abs(middle)", "0.0"),
            ("\"passed\": not why", "\"passed\": True"),
        ),
    ),
    "lots/pooling.py": (
        "tests/lots/test_pooling.py",
        (
            ("used &= ~find_outliers(x, std, used)", "pass"),
            ("1 / total + (exact * typical) ** 2", "1 / total"),
            ("dof = (count - 2) * (known + at_most) / at_most", "dof = 1e9 + 0 * count"),
            ("squares.sum(axis=0) - wanted", "squares.sum(axis=0) - 2 * wanted"),
            ("* count / (count - 0.8)", "* 0.6"),
        ),
    ),
    "lots/common_causes.py": (
        "tests/lots/test_common_causes.py",
        (
            ("price = count_tests(known, groups)", "price = 0 * count_tests(known, groups) + 1"),
            ("- WORTH * group.depth", "+ 0 * group.depth"),
            ("(z[own] - rho * z[own, cause][:, None]) / safe", "z[own] / safe"),
            ("explained[members, cause] += tables[place].value[cause]", "pass"),
        ),
    ),
    "lots/identity.py": (
        "tests/lots/test_identity.py",
        (
            ("(?<![A-Za-z0-9]){re.escape(gyro)}(?![A-Za-z0-9])", "{re.escape(gyro)}"),
            ("if len(siblings) == 1:", "if siblings:"),
        ),
    ),
    "fitting/envelopes/condensed.py": (
        "tests/stages/identification/test_identify_valid.py",
        (("p.select_rows(np.arange(-start % every, len(p), every))", "p.select_rows(slice(-start % every, None, every))"),),
    ),
    "lots/lot_course.py": (
        "tests/lots/test_batch.py",
        (
            ("if all((one.gyro_id, one.name) in", "if any((one.gyro_id, one.name) in"),
            ("result or killed | {", "killed | {"),
        ),
    ),
    "lots/lot_tasks.py": (
        "tests/lots/test_batch.py tests/lots/test_identity.py",
        (
            ("task.foreign or is_readable(Path(task.source))", "True"),
            ("BY_LOT if named else _tell_origin(said)", "_tell_origin(said)"),
        ),
    ),
    "fitting/samples/stretches.py": (
        "tests/fitting/samples/test_stretches.py",
        (
            ("int(np.count_nonzero(starts))", "len(starts)"),
            ("int(starts[-1]) if piece[-1] else None", "None"),
            ("[[open_before], piece]", "[[False], piece]"),
        ),
    ),
    "fitting/envelopes/frozen.py": (
        "tests/fitting/envelopes/test_frozen.py",
        (
            ("[last.get(name, v[:0]), v]", "[v]"),
            ("begun = found.begun - (found.longest[0] > 0)", "begun = found.begun"),
            ("rows[::every]", "rows[0]"),
            ("found.count * chance**pairs > CHANCE", "chance**pairs > CHANCE"),
        ),
    ),
    "lots/lot_work.py": (
        "tests/lots/test_batch.py tests/lots/test_batch_interrupts.py",
        (
            ("    except DiskFullError:  # no verdict on the gyro: the whole lot stops\n        raise\n", ""),
        ),
    ),
    "fitting/samples/wild.py": (
        "tests/stages/demodulation/test_demodulate_wild.py",
        (
            ("_count_about(places, places) <= MOST_TOGETHER", "_count_about(places, places) <= 10**9"),
            ("alone &= _count_about(", "_count_about("),
            ("measure_tame(_drop_lonely(off))", "measure_tame(off)"),
            ("out[places - first] = np.nan", "pass"),
            ("WILD = 10.0", "WILD = 1e9"),
            ("raw * rate[k] + offset[k]", "raw"),
        ),
    ),
    "fitting/samples/twin_channels.py": (
        "tests/fitting/samples/test_twin_channels.py",
        (
            ("(share * NOISY > 1).any() or ", ""),
            ("LEAST**2 * strength2", "0.0"),
            ("own > max(EXACT, limit)", "own > EXACT"),
        ),
    ),
    "fitting/samples/overflow.py": (
        "tests/fitting/samples/test_overflow.py",
        (
            ("if abs(whole) > FAR * size:", "if True:"),
            (" & within[2:] & within[1:-1] & within[:-2]", ""),
            ("max(FEWEST, EXPLAINED * off)", "FEWEST"),
        ),
    ),
    "fitting/envelopes/amplitude_course.py": (
        "tests/stages/diagnosis/suspects/test_backward_runs.py tests/stages/diagnosis/suspects/test_mislabelled.py",
        (
            ("return all(_measure_rate", "return any(_measure_rate"),
            ("bool(np.any(np.nan_to_num(part.drive_main)))", "False"),
        ),
    ),
    "fitting/envelopes/growing.py": (
        "tests/stages/diagnosis/suspects/test_backward_runs.py",
        (
            ("        and course.change > least\n", ""),
            ("        and rate < ALIKE * usual\n", ""),
        ),
    ),
    "stages/shared_noise.py": (
        "tests/stages/test_shared_noise.py",
        (
            ("abs(np.log(one.std[0] / other.std[0] / factor)) > abs(np.log(factor)) / 2", "False"),
            ("a - factor * b", "a - b"),
        ),
    ),
    "fitting/envelopes/wild_rows.py": (
        "tests/fitting/envelopes/test_wild_rows.py",
        (
            ("flags[one.rows] |= FLAG_NOT_FINITE", "pass"),
            ("abs(middle))", "0.0)"),
        ),
    ),
    "formats/decimal_commas.py": (
        "tests/formats/test_text_logs.py",
        (
            ("if 2 * titles != count and not _are_decimals(rows):", "if 2 * titles != count:"),
            ("zeros >= 2 or any(\"-0\" in column for column in whole)", "True"),
        ),
    ),
    "formats/taken.py": (
        "tests/formats/test_taken.py",
        (
            ("if self.gaps == 1:", "if False:"),
        ),
    ),
    "limit_values.py": (
        "tests/commands/test_checking.py",
        (
            ("and known[unit] != 1.0 and not is_relative(name)", "and False"),
            ("return known[unit] / size", "return known[unit]"),
            ("_scale_units(FREQUENCIES, TURN / 2)", "_scale_units(FREQUENCIES, TURN)"),
        ),
    ),
    "comparing.py": (
        "tests/commands/test_checking.py",
        (
            ("if gyro and other:", "if False:"),
            ("change = (change + period / 2) % period - period / 2", "pass"),
        ),
    ),
}  # fmt: skip
