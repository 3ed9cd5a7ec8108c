#!/usr/bin/env bash
# The demonstration: a gyro with two hidden faults, free and forced, through the whole chain. `make run` calls it with the folder for the results.
set -eu
out=${1:?name the folder for the results}
rm -rf "$out"
mkdir -p "$out/recordings"
echo "simulating a gyro with two hidden faults (configs/demonstration_free.toml says which) ..."
hrg simulate configs/demonstration_free.toml -o "$out/recordings/free.h5" --seed 3 -q
hrg simulate configs/demonstration_forced.toml -o "$out/recordings/forced.h5" --seed 3 -q
hrg run "$out/recordings" -o "$out/results" --config configs/chain.toml
hrg export "$out/results/calibration.h5" -o "$out/results/calibration.h" -q
hrg report "$out/results/diagnosis.h5" --format png -o "$out/pictures" -q
cp "$out/pictures/diagnosis-answer.png" "$out/answer.png"
echo "the page to show: $out/results/report.html"
