//! The problems that are timed: their names, and the cases that they stand for.

use bondwise::case::bundled;

/// Which loop sums the bonds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Path {
    /// One list of offsets, one bit a bond.
    Lattice,
    /// A list of neighbours for each point, one bit a bond.
    Cloud,
    /// One row of numbers for all points: a linear law whose bonds never break.
    Rows,
}

impl Path {
    pub fn name(self) -> &'static str {
        match self {
            Path::Lattice => "lattice",
            Path::Cloud => "cloud",
            Path::Rows => "rows",
        }
    }
}

/// What a problem is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// A cube of n³ points.
    Cube,
    /// The plate of the bundled case `crack_branching`.
    Plate,
}

/// How many materials a cube is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parts {
    One,
    /// Two, on either side of its middle.
    Halves,
    /// Two, cell by cell.
    Grains,
}

/// A problem to be timed.
#[derive(Debug, Clone, Copy)]
pub struct Problem {
    pub name: &'static str,
    pub about: &'static str,
    pub body: Body,
    pub path: Path,
    /// Whether the law is linearised.
    pub linear: bool,
    /// Whether the body is a state-based solid, which takes two passes over the bonds.
    pub solid: bool,
    /// Whether bonds break while it is timed.
    pub breaking: bool,
    pub parts: Parts,
}

/// All of them, in the order of the table.
#[rustfmt::skip] // a table
pub const PROBLEMS: [Problem; 15] = {
    use {Body::*, Parts::*, Path::*};
    const fn problem(
        name: &'static str, body: Body, path: Path, linear: bool, breaking: bool, about: &'static str,
    ) -> Problem {
        Problem { name, about, body, path, linear, solid: false, breaking, parts: One }
    }
    [
        problem("block3d", Cube, Lattice, false, false,
            "cube of n³ points on a lattice, horizon 3.015 spacings, no bond breaks"),
        problem("block3d-breaking", Cube, Lattice, false, true,
            "the same cube with a crack that runs: bonds break in every step"),
        problem("block3d-linear", Cube, Lattice, true, false,
            "the cube with the linearised law; bonds may break, none does"),
        problem("block3d-linear-breaking", Cube, Lattice, true, true,
            "the cube with the linearised law and a crack that runs"),
        problem("rows3d", Cube, Rows, true, false,
            "the cube with the linearised law, without failure"),
        problem("cloud3d", Cube, Cloud, false, false,
            "the same points disturbed and in random order: a scattered cloud"),
        problem("cloud3d-breaking", Cube, Cloud, false, true,
            "the same cloud with a crack that runs"),
        problem("plate2d", Plate, Lattice, false, false,
            "the bundled case crack_branching in its first steps, no bond breaks"),
        problem("plate2d-breaking", Plate, Lattice, false, true,
            "the same while its crack runs"),
        Problem { solid: true, ..problem("lps3d", Cube, Lattice, false, false,
            "the cube as a state-based solid: both passes over the bonds") },
        Problem { solid: true, ..problem("lps3d-cloud", Cube, Cloud, false, false,
            "the scattered cloud as a state-based solid") },
        Problem { parts: Halves, ..problem("halves3d", Cube, Lattice, false, false,
            "block3d of two materials, one on either side") },
        Problem { parts: Grains, ..problem("grains3d", Cube, Lattice, false, false,
            "block3d of two materials, cell by cell: every bond has its weight looked up") },
        Problem { parts: Halves, ..problem("halves3d-cloud", Cube, Cloud, false, false,
            "cloud3d of two materials, one on either side") },
        Problem { parts: Halves, solid: true, ..problem("halves3d-lps", Cube, Lattice, false, false,
            "lps3d of two materials, one on either side") },
    ]
};

impl Problem {
    pub fn named(name: &str) -> Option<&'static Problem> {
        PROBLEMS.iter().find(|p| p.name == name)
    }

    /// Steps that are taken before any is timed.
    pub fn warm_up(&self) -> u32 {
        match (self.body, self.breaking) {
            (_, false) => 2,
            // Its crack has opened, and breaks bonds in nearly every step from here.
            (Body::Cube, true) => 12,
            // Its crack starts after some 270 of the 642 steps of the case.
            (Body::Plate, true) => 320,
        }
    }

    /// The case to run, for a cube of `n` points along an edge.
    pub fn case(&self, n: u32) -> String {
        match self.body {
            Body::Cube => self.cube(n),
            Body::Plate => bundled::CASES[0].case.to_string(),
        }
    }

    /// Δx = 0.5 mm, E = 72 GPa, ρ = 2440 kg/m³, steps of 20 ns.
    ///
    /// Either it is drawn apart along x at ±1 m/s, far from any strain that breaks bonds; or it starts stretched along
    /// x to nine tenths of the critical stretch, with a crack in the middle plane x = constant that cuts into it from
    /// y = 0 so far that about 1 % of the points lose bonds (those within a horizon of it), and is let go: the crack
    /// opens and runs.
    fn cube(&self, n: u32) -> String {
        let half = f64::from(n / 2) * 5e-4;
        let edge = f64::from(n) * 5e-4;
        let depth = (edge * f64::from(n) / 600.0).max(1e-3);
        let (crack, motion) = if self.breaking {
            let (out, side) = (edge + 1e-3, format!("{half:e}"));
            (
                format!(
                    "cracks = [{{ polygon = {{ vertices = [[{side}, -1e-3, -1e-3], [{side}, {depth:e}, -1e-3], \
                     [{side}, {depth:e}, {out:e}], [{side}, -1e-3, {out:e}]] }} }}]"
                ),
                "displacement = { component = 0, value = \"0.9 * 0.004 * x\" }",
            )
        } else {
            (String::new(), "velocity = { component = 0, value = \"2*(x - 2.5e-4)/((n - 1)*5e-4) - 1\" }")
        };
        let failure = match (self.path, self.breaking) {
            (Path::Rows, _) => "",
            (_, false) => "failure = { critical_stretch = { stretch = 0.01 } }",
            (_, true) => "failure = { critical_stretch = { stretch = 0.004 } }",
        };
        let disturbed = "perturb = { amplitude = 0.05, seed = 1, shuffle = true }";
        let title = self.name;
        let perturb = if self.path == Path::Cloud { disturbed } else { "" };
        let law = match (self.solid, self.linear) {
            (false, false) => "bond_based",
            (false, true) => "bond_based_linear",
            (true, _) => "state_based",
        };
        // That of bonds, so that the bodies of all problems are of one material.
        let poisson = if self.solid { ", poisson = 0.25" } else { "" };
        let first = match self.parts {
            Parts::One => "",
            Parts::Halves => "x < 0.5*n*5e-4",
            // An even sum of the three numbers of a cell.
            Parts::Grains => "cos(pi*(x + y + z - 7.5e-4)/5e-4) > 0",
        };
        let (of, materials) = if self.parts == Parts::One {
            (format!("law = {{ {law} = {{ young = 72e9, density = 2440{poisson} }} }}"), String::new())
        } else {
            let sets =
                format!("[sets]\nfirst = {{ where = \"{first}\" }}\nsecond = {{ not = {{ where = \"{first}\" }} }}");
            let a = format!("[materials.a]\nyoung = 72e9\ndensity = 2440{}", poisson.replace(", ", "\n"));
            let b = format!("[materials.b]\nyoung = 36e9\ndensity = 1500{}", poisson.replace(", ", "\n"));
            let law = format!("law = {{ {law} = {{}} }}\nmaterials = {{ a = \"first\", b = \"second\" }}");
            (law, format!("{sets}\n{a}\n{b}"))
        };
        format!(
            r#"
[case]
title = "{title}"
dimension = 3
[constants]
n = {n}
[geometry]
shape = {{ box = {{ low = [0, 0, 0], high = ["n*5e-4", "n*5e-4", "n*5e-4"] }} }}
spacing = 5e-4
{perturb}
{crack}
[discretization]
horizon_ratio = 3.015
partial_volumes = "none"
{materials}
[physics.elasticity]
{of}
{failure}
[[conditions]]
on = "all"
initial = {{ {motion} }}
[solver.velocity_verlet]
end_time = 1
time_step = 2e-8
"#
        )
    }
}
