# Every command of the project. `just check` is what CI runs.

check:
    bash .ci/run

# The gate, and what takes long.
check-full:
    bash .ci/full

test:
    cargo test --workspace

# Slow studies as well.
verify-full:
    cargo run --release -- verify --full

bench:
    cargo run --release -- bench
    cargo bench --bench sum_bonds

# Instructions a bond; `just instructions --bless` after a change that was meant.
instructions *options:
    python3 benches/instructions.py {{options}}

format:
    cargo fmt --all
