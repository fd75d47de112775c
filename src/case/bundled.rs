//! The cases that the program carries: examples, tests and benchmark inputs at once.

/// A case of the folder `cases/`.
#[derive(Debug, Clone, Copy)]
pub struct Bundled {
    pub name: &'static str,
    /// What it shows, in one line.
    pub about: &'static str,
    pub case: &'static str,
    pub readme: &'static str,
}

/// A case by the name of its folder.
macro_rules! bundled {
    ($name:literal, $about:literal) => {
        Bundled {
            name: $name,
            about: $about,
            case: include_str!(concat!("../../cases/", $name, "/case.toml")),
            readme: include_str!(concat!("../../cases/", $name, "/README.md")),
        }
    };
}

/// All of them, in the order in which a newcomer may look at them.
pub const CASES: [Bundled; 20] = [
    bundled!("crack_branching", "2D: a crack runs through glass and branches; the main example"),
    bundled!("crack_branching_refined", "2D: the same crack on cells that are fine about its tips only"),
    bundled!("crack_branching_hybrid", "2D: a larger plate, collocation where it is whole and bonds where it breaks"),
    bundled!("crack_branching_duran", "2D: the same plate in a tougher glass under a higher load"),
    bundled!("wave_in_bar", "1D: a pulse against its closed form; the smallest case"),
    bundled!("prestressed_bar", "1D: a bar rests under tension, then an end is let go; two solvers in a chain"),
    bundled!("diffusion_two_layers", "1D: what diffuses through a wall of a good and a poor conductor"),
    bundled!("diffusion_in_a_square", "2D: something diffuses, against a closed form; rows of collocation"),
    bundled!("wave_in_bar_3d", "3D: a bar runs against a wall; a compression wave and its return"),
    bundled!("plate_with_hole", "2D: a plate with a hole is pulled slowly until it rests"),
    bundled!("stretched_plate", "2D: a plate with the Poisson ratio of aluminium is pulled; state-based"),
    bundled!("double_cantilever", "2D: a crack grows as a specimen is wedged open, in equilibrium all the way"),
    bundled!("l_panel", "2D: a crack from the corner of a panel of concrete, at rest, bond by bond"),
    bundled!(
        "inclusion",
        "2D: a stiff disc in a soft plate is strained evenly, and less than the plate; two materials"
    ),
    bundled!("laminate_delamination", "2D: two unlike layers are wedged apart; their interface gives way"),
    bundled!("random_microstructure", "2D: a plate of scattered stiffness and toughness breaks where it is weak"),
    bundled!("kalthoff_winkler", "2D: a struck plate with two notches cracks at 70 degrees"),
    bundled!("fragmenting_cylinder", "3D: an expanding tube breaks into fragments; scattered points"),
    bundled!("kalthoff_winkler_3d", "3D: the struck plate with its thickness; large"),
    bundled!("crack_branching_3d", "3D: the branching crack with its thickness; large"),
];
