//! How much a step has to do: floating-point operations and bytes, counted from the source.
//!
//! A fused multiply-add is two operations; a square root, a division, a comparison of the watch one each. Equal
//! subexpressions count once, and so does a bond that is visited again (exactly, or after one broke): fractions of the
//! peak are of the work that had to be done. D is the dimension.
//!
//! Operations per bond update, on a lattice (`physics::elasticity::bond_based`, `execution::lattice`):
//!
//! | what | large displacements | linearised |
//! |---|---|---|
//! | η = u′ − u | D | D |
//! | strain: η·(2ξ + η)/│ξ│², or η·ξ/│ξ│² | 2 + 1, then D − 1 times 2 + 2; × 1/│ξ│²: 4 D | 2 D |
//! | watch: max(│strain│) | 1 | 1 |
//! | spring × strain | 1 | 1 |
//! | polynomial of degree 6 (double) or 3 (single), and × it | 12 + 1 or 6 + 1 | – |
//! | sum + factor (ξ + η), with ξ + η known; or sum + factor ξ | 2 D | 2 D |
//! | **in all** | 7 D + 15 (double), 7 D + 9 (single) | 5 D + 2 |
//! | **3D** | 36, 30 | 17 |
//!
//! Rows take the bonds along ξ and −ξ together (`execution::rows`): u(x + ξ) + u(x − ξ) − 2 u(x), 2 D, and a matrix
//! times it, 2 D²: D + D² a bond, 12 in 3D. Blocks at the surface are summed bond by bond, but counted alike.
//!
//! A cloud has to find each bond first (`execution::cloud`, `Pack::inverse_root`):
//!
//! | what | double | single |
//! |---|---|---|
//! | ξ = x′ − x, or in whole units and × unit | D | D |
//! | │ξ│² | 2 D | 2 D |
//! | 1/│ξ│: −│ξ│²; a round of fourth or third order; a round of second or first order | 1 + 12 + 8 | 1 + 10 + 6 |
//! | weight, 1/│ξ│², weight/│ξ│ | 3 | 3 |
//! | **in all** | 3 D + 24 | 3 D + 20 |
//!
//! A state-based solid (`physics::elasticity::linear_solid`) takes two passes. The first has η, strain and watch, 5 D + 1, s by
//! a polynomial, 11 (7 in single), the sum, 2; the second η, strain and watch again, p + p′ and q + q′, 2, a polynomial, 11 (7),
//! p + (q − p) g and × spring, 4, sum + factor (ξ + η), 2 D: 12 D + 32 (24), 68 (60) in 3D, and on a cloud the bond twice. A point
//! takes one operation more, p = h S, and its passes read and write S, h, p and q once more each: 6 numbers.
//!
//! Beside its bonds, a component of a point takes 11 operations a step: kick and drift 5, kick 3, kinetic energy and
//! momentum 3 (`solver::velocity_verlet`, `Problem::motion`); comparisons with negligible numbers are not counted.
//!
//! Bytes per point and step, for numbers of B bytes, if nothing stays in the cache from one pass to the next and
//! neighbours are found there within a pass:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | kick and drift | u, v, f: 3 D B | u, v: 2 D B |
//! | forces | u: D B; states: 1/8 a bond | f: D B |
//! | kick | v, f: 2 D B | v: D B |
//! | energy | v: D B | |
//! | **lattice, in all** | | 11 D B + bonds/8 |
//! | records of displacements (cloud) | in the place of u: D B | 4 B, read again by the forces: 4 B |
//! | forces (cloud) | 4 numbers of a site (8 or 4 bytes each), first group 8; index 4 a bond | |
//! | energy (cloud) | volume 8 | |
//!
//! That a line is read before it is written is not counted, as the triad does not count it.

use super::problems::{Path, Problem};

/// The work of one step of a whole body.
#[derive(Debug, Clone, Copy)]
pub struct Work {
    pub operations: f64,
    pub bytes: f64,
}

/// Sizes that the work follows from.
#[derive(Debug, Clone, Copy)]
pub struct Sizes {
    pub dimension: usize,
    pub points: usize,
    /// Directed.
    pub bonds: u64,
}

impl Work {
    pub fn of_step(problem: &Problem, precision: &str, sizes: Sizes) -> Work {
        let (points, bonds) = (sizes.points as f64, sizes.bonds as f64);
        let per_bond = operations(problem, sizes.dimension, precision != "double") as f64;
        let components = sizes.dimension as f64;
        let number = if precision == "single" { 4.0 } else { 8.0 };
        let mut bytes = 11.0 * components * number * points + bonds / 8.0;
        if problem.solid {
            bytes += (components + 6.0) * number * points + bonds / 8.0;
        }
        if problem.path == Path::Cloud {
            let site = if precision == "double" { 4.0 * 8.0 } else { 4.0 * 4.0 };
            bytes += (8.0 * number + site + 16.0) * points + 4.0 * bonds;
        }
        Work { operations: per_bond * bonds + 11.0 * components * points, bytes }
    }
}

/// Operations of one bond update.
fn operations(problem: &Problem, dimension: usize, single: bool) -> usize {
    let law = match (problem.linear, single) {
        (true, _) => 5 * dimension + 2,
        (false, false) => 7 * dimension + 15,
        (false, true) => 7 * dimension + 9,
    };
    if problem.solid {
        let (polynomials, bond) = if single { (14, 20) } else { (22, 24) };
        let bonds = if problem.path == Path::Cloud { 3 * dimension + bond } else { 0 };
        return 12 * dimension + 10 + polynomials + 2 * bonds;
    }
    match (problem.path, single) {
        (Path::Lattice, _) => law,
        (Path::Rows, _) => dimension + dimension * dimension,
        (Path::Cloud, false) => law + 3 * dimension + 24,
        (Path::Cloud, true) => law + 3 * dimension + 20,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_of_the_cube() {
        for (name, double, single) in
            [("block3d", 36, 30), ("block3d-linear", 17, 17), ("rows3d", 12, 12), ("cloud3d", 69, 59)]
        {
            let problem = Problem::named(name).unwrap();
            assert_eq!([false, true].map(|s| operations(problem, 3, s)), [double, single], "{name}");
        }
        let solid = Problem::named("lps3d").unwrap();
        assert_eq!([false, true].map(|s| operations(solid, 3, s)), [68, 60]);
    }
}
