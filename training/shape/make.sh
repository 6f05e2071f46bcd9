#!/bin/sh
# Makes crates/vehicle-gaussians/src/prior/shape/weights.bin from scratch: vehicles, training, parity data.
# Usage: training/shape/make.sh PYTHON
set -eu
python=${1:?the Python with training/shape/requirements.txt installed}
cd "$(dirname "$0")/../.."
work=target/shape
mkdir -p "$work" tests/data/shape
vehicles() {
    cargo run --release --locked --manifest-path training/vehicles/Cargo.toml -- data "$@"
}
vehicles --vehicles 3072 --seed 1 -o "$work/train.bin"
vehicles --vehicles 300 --seed 1000 -o "$work/check.bin"
PYTHONPATH=training/shape "$python" training/shape/train.py "$work/train.bin" --check "$work/check.bin" \
    -o crates/vehicle-gaussians/src/prior/shape/weights.bin
PYTHONPATH=training/shape "$python" training/shape/parity.py crates/vehicle-gaussians/src/prior/shape/weights.bin "$work/check.bin" \
    -o tests/data/shape/parity.bin
