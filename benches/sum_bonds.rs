//! `cargo bench --bench sum_bonds`: the time of each sum over bonds, on one thread and the widest instructions.

mod kernels;

use bondwise::execution::Instructions;
use divan::Bencher;
use divan::counter::ItemsCount;
use kernels::{Edges, KERNELS, kernel};

/// A few million bonds each: milliseconds.
const EDGES: Edges = Edges { plate: [400, 200], solid: [80, 24, 24], cloud: [24, 24, 24] };

/// Items are directed bonds.
#[divan::bench(args = KERNELS.map(|k| k.0), sample_count = 20)]
fn sum(bencher: Bencher, name: &str) {
    let instructions = *Instructions::available().last().expect("the baseline is everywhere");
    let mut kernel = kernel(name, EDGES, instructions).expect("the name is of the list");
    bencher.counter(ItemsCount::new(kernel.bonds)).bench_local(|| (kernel.evaluate)());
}

fn main() {
    // Bodies large enough to be shared out would otherwise measure the pool as well.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().expect("the first pool");
    divan::main();
}
