#!/usr/bin/env bash
# The whole chain on the sample data and on simulated forced runs: `make run` calls it with the folder for the results.
set -eu
out=${1:?name the folder for the results}
rm -rf "$out"
mkdir -p "$out"
hrg import sample_data/lab_log.csv -o "$out/lab.h5" --time 1 --c 2 --s 3 --temperature 4
hrg run sample_data/free-*.h5 "$out/lab.h5" -o "$out/free" --config configs/chain.toml
hrg simulate configs/forced_temperature.toml -o "$out/forced.h5" --seed 3 -q
hrg run "$out"/forced-*.h5 -o "$out/forced" --config configs/chain.toml
hrg export "$out/forced/calibration.h5" -o "$out/calibration.csv"
hrg report "$out"/free/resonator.h5 "$out"/forced/calibration.h5 -o "$out/report.html"
echo "results in $out; open $out/report.html"
