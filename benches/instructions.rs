//! Runs one sum over bonds a given number of times, for a tool that counts instructions; see `instructions.py`.
//!
//! `instructions KERNEL EVALUATIONS` prints the bond updates of one evaluation; without arguments, the names of all
//! kernels. The loops are those for AVX2, which the counting tool knows, on every machine.

mod kernels;

use bondwise::execution::Instructions;
use kernels::{Edges, KERNELS, kernel};

/// Small bodies: a counting tool is slow.
const EDGES: Edges = Edges { plate: [160, 80], solid: [64, 16, 16], cloud: [12, 12, 12] };

fn main() {
    // No other thread, which would wait in instructions of its own.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().expect("the first pool");
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [name, evaluations] = &arguments[..] else {
        KERNELS.iter().for_each(|(name, _)| println!("{name}"));
        return;
    };
    let evaluations: u32 = evaluations.parse().expect("a number of evaluations");
    #[cfg(target_arch = "x86_64")]
    let instructions = Instructions::Avx2;
    #[cfg(not(target_arch = "x86_64"))]
    let instructions = Instructions::Baseline;
    let mut kernel = kernel(name, EDGES, instructions).unwrap_or_else(|| panic!("no kernel {name}"));
    for _ in 0..evaluations {
        (kernel.evaluate)();
    }
    println!("{}", kernel.bonds);
}
