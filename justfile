# Every command of the project. `just check` is what CI runs.

check:
    bash .ci/run

test:
    cargo test --workspace

# Slow studies as well.
verify-full:
    cargo run --release -- verify --full

bench:
    cargo run --release -- bench

format:
    cargo fmt --all
