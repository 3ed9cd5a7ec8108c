#!/usr/bin/env bash
# Makes sample_data/ from configs/sample_data.toml: four free run-downs, and one of them as a laboratory's text log.
set -eu
cd "$(dirname "$0")/.."
hrg simulate configs/sample_data.toml -o sample_data/free.h5 --force --seed 7
python - <<'PY'
import numpy as np

from hrg_cli import Recording, store

recording = store.read("sample_data/free-2.h5", Recording)
c, s = recording.physical(0, 4000)
temperature = 24.0 + 0.05 * recording.times(0, 4000)
table = np.column_stack([recording.times(0, 4000), c, s, temperature])
np.savetxt("sample_data/lab_log.csv", table, fmt=["%.6f", "%.6f", "%.6f", "%.3f"], delimiter=",", header="time [s],C [V],S [V],T [degC]", comments="")
PY
