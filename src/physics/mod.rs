//! The equations, and what never comes back: what a bond does, when it breaks, what diffuses.
//!
//! A [`Physics`] is one set of equations on one body, with everything that it changes. A problem holds one as a trait
//! object: dimension, material and precision are types below this line and nowhere above it. It is called once a stage,
//! never for a bond.

pub mod diffusion;
pub mod elasticity;
pub mod failure;
mod resultant;

use std::ops::Range;

pub use diffusion::Diffusion;
pub use elasticity::Elasticity;
pub use resultant::{ForceAndMoment, Resultant, StretchedBond};

use crate::execution::Broken;
use crate::family::{Body, BondStates};
use crate::field::{Field, Kind, embed};
use crate::geometry::Arrangement;
use crate::refinement::Remap;
use crate::solver::Drift;
use crate::solver::linear::{LinearError, Preconditioner, Sparse};
use crate::unknown::Unknown;
use crate::visit::Visitor;

/// One set of equations on one body.
///
/// What a stage needs is split by whether it comes back: [`evaluate`](Self::evaluate) fills the rate and changes nothing
/// else, [`evolve`](Self::evolve) first lets happen what cannot be undone. Both are one pass over the bonds, which is why
/// the second is not left to follow the first.
pub trait Physics: Send {
    fn unknown(&mut self) -> Unknown<'_>;
    /// Fills the rate at the values as they are. Nothing breaks.
    fn evaluate(&mut self);
    /// Breaks what breaks at the values as they are, then fills the rate. `dt` (s): the step that led there with the
    /// velocities as they are now, for the books of what broken bonds take; zero where there was none.
    fn evolve(&mut self, dt: f64);
    /// A drift and [`evolve`](Self::evolve) in one pass over memory, where that is faster; gives what the drift gives. None,
    /// with nothing done, where it is not offered.
    fn drift_and_evolve(&mut self, _drift: &Drift, _dt: f64) -> Option<f64> {
        None
    }
    /// Values of these slots have been set since a drift: component and slots.
    fn was_set(&mut self, _component: usize, _slots: &[u32]) {}
    /// A drift has ended, and everything is set.
    fn has_drifted(&mut self) {}
    /// Largest stable step, s: of velocity Verlet for equations of second order, of forward Euler for those of first.
    fn stable_step(&self) -> f64;
    /// Whether its frequencies, or rates of decay, only fall as it breaks.
    fn only_softens(&self) -> bool {
        true
    }

    /// A field at these points, in point order; None if there is no such field.
    fn field(&mut self, name: &str, points: Range<usize>) -> Option<Field>;
    /// The points as they are now.
    fn points(&self) -> &dyn Points;
    /// How often the points have been replaced.
    fn generation(&self) -> u64 {
        0
    }
    /// Which bonds hold.
    fn states(&self) -> &BondStates;
    /// Directed bonds before any broke, and how many pre-cracks cut.
    fn n_bonds(&self) -> [u64; 2];

    /// Kinetic energy (J), and what is kept where nothing enters: momentum (N·s) or amount, by component.
    fn motion(&mut self) -> (f64, [f64; 3]);
    /// The same, where Σ v² over all slots is known already; None where that says nothing.
    fn motion_of(&self, _squares: f64) -> Option<f64> {
        None
    }
    /// What is in the body beside its motion.
    fn content(&mut self) -> Content;
    /// What has broken so far.
    fn broken(&self) -> Broken {
        Broken::default()
    }
    /// A force on a part of the body; None where there are no forces.
    fn resultant(&mut self, _of: &Resultant) -> Option<ForceAndMoment> {
        None
    }
    /// The whole bond that is nearest to breaking; None where no bond is stretched, or none can break.
    fn most_stretched(&mut self) -> Option<StretchedBond> {
        None
    }
    /// Whether something inside the body takes energy while it moves.
    fn dissipates(&self) -> bool {
        false
    }
    /// What that takes now, W; None where there is none.
    fn dissipation(&mut self) -> Option<f64> {
        None
    }
    /// By how much what is kept is off, and what that is measured against: of motion the energy, J.
    fn defect(&self, balance: &Balance) -> [f64; 2] {
        [balance.defect(), balance.scale()]
    }
    /// The books as columns of a history.
    fn columns(&self, balance: &Balance) -> Vec<Column>;
    /// The first point, in point order, whose value, rate or velocity is not finite: name of the field, value, point.
    fn first_bad(&mut self) -> Option<(&'static str, f64, usize)>;
    /// The point that moves or changes fastest.
    fn fastest(&mut self) -> Option<usize> {
        None
    }

    /// What a body at rest is solved by; None where nothing can rest.
    fn tangent(&mut self) -> Option<&mut dyn Tangent> {
        None
    }
    /// A static solver has brought the body to rest: its displacements (m), the force on each slot and component (N), and
    /// what broke on the way.
    fn settle(&mut self, _at_rest: &[f64], _force: &[f64], _broken: Broken) {}

    /// Replaces points where the solution asks for it at time `t`, all levels at once when `thoroughly`; the rate is then that
    /// of the new points. None where nothing was replaced.
    fn adapt(&mut self, _t: f64, _thoroughly: bool) -> Option<Replaced> {
        None
    }
    /// How many steps lie between two looks whether points are to be replaced; None where they never are.
    fn adapts_every(&self) -> Option<u64> {
        None
    }
    /// What replacing points has done; None where they stay.
    fn adapted(&self) -> Option<Adapted> {
        None
    }
    /// What the hybrid scheme has to do; None in other schemes.
    fn hybrid(&self) -> Option<elasticity::Work> {
        None
    }

    /// Shows everything that changes in a run.
    fn visit(&mut self, visitor: &mut dyn Visitor);
    /// Adds the bits that make two states equal: values, velocities, bonds.
    fn hash(&mut self, hasher: &mut blake3::Hasher);
    /// Bytes of points, fields, bonds and the scratch of the loops.
    fn memory(&self) -> usize;
}

/// A field that a physics has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldInfo {
    pub name: &'static str,
    /// SI; empty for none.
    pub unit: &'static str,
    pub about: &'static str,
    pub kind: Kind,
}

/// The fields that cases may ask for, of one physics after another.
pub fn all_fields() -> impl Iterator<Item = &'static FieldInfo> {
    elasticity::fields().chain(diffusion::fields())
}

/// The points of a body, whatever its dimension.
pub trait Points {
    fn dimension(&self) -> usize;
    fn n_points(&self) -> usize;
    /// Where the values of each point stand in a component, in point order.
    fn slots(&self) -> &[u32];
    fn n_slots(&self) -> usize;
    /// Reference position of a slot, m; zeros beyond the dimension.
    fn position(&self, slot: usize) -> [f64; 3];
    /// m³, m² in 2D, m in 1D.
    fn volume(&self, slot: usize) -> f64;
    /// Of all points, if it is the same.
    fn same_volume(&self) -> Option<f64>;
    /// m
    fn spacing(&self) -> f64;
    /// δ, m; the largest where they differ.
    fn horizon(&self) -> f64;
    /// Bonds of each point that hold, in point order.
    fn bonds_that_hold(&self, states: &BondStates) -> Vec<u32>;
    /// Calls `visit` with the slot of each image, that of its source, and the sign of each component of a vector, which is 1
    /// beyond the dimension.
    fn visit_images(&self, _visit: &mut dyn FnMut(usize, usize, [f64; 3])) {}
    /// x and x′ (m) of the bond whose state is bit `bit % 16` of word `bit / 16`.
    fn ends(&self, bit: usize) -> [[f64; 3]; 2];
}

impl<const D: usize> Points for Body<D> {
    fn dimension(&self) -> usize {
        D
    }
    fn n_points(&self) -> usize {
        self.cloud.n_points()
    }
    fn slots(&self) -> &[u32] {
        &self.cloud.slots
    }
    fn n_slots(&self) -> usize {
        self.cloud.n_slots()
    }
    fn position(&self, slot: usize) -> [f64; 3] {
        embed(&self.cloud.position(slot))
    }
    fn volume(&self, slot: usize) -> f64 {
        self.cloud.volume(slot)
    }
    fn same_volume(&self) -> Option<f64> {
        match &self.cloud.arrangement {
            Arrangement::Lattice(lattice) => Some(lattice.cell_volume()),
            Arrangement::Scattered { .. } => None,
        }
    }
    fn spacing(&self) -> f64 {
        self.cloud.spacing
    }
    fn horizon(&self) -> f64 {
        self.horizon
    }
    fn bonds_that_hold(&self, states: &BondStates) -> Vec<u32> {
        states.per_point(self)
    }
    fn visit_images(&self, visit: &mut dyn FnMut(usize, usize, [f64; 3])) {
        for (slot, source, signs) in self.cloud.images.iter().flat_map(|images| images.iter()) {
            visit(slot, source, std::array::from_fn(|d| signs.get(d).copied().unwrap_or(1.0)));
        }
    }
    fn ends(&self, bit: usize) -> [[f64; 3]; 2] {
        self.ends_of(bit).map(|slot| embed(&self.cloud.position(slot)))
    }
}

/// What is in a body beside its motion.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Content {
    /// Strain energy, J.
    pub stored: f64,
    /// Σ ρ |v| V (N·s), or Σ |amount|: what a defect of what is kept is measured against.
    pub scale: f64,
    /// About the origin, N·m·s.
    pub angular_momentum: [f64; 3],
}

/// Points were replaced.
pub struct Replaced {
    /// One after another.
    pub remaps: Vec<Remap>,
    /// By how much the kinetic and strain energy changed, J.
    pub energy: f64,
}

/// What replacing points has done so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Adapted {
    /// Times that the criteria were asked, and that points were replaced.
    pub looks: u64,
    pub events: u64,
    /// Σ |change of the energy| by that, J.
    pub energy: f64,
    /// Directed bonds of families that were found anew, and of all families, over all events.
    pub bonds: [u64; 2],
    /// Points that saw, with a horizon larger than theirs, one for which finer cells were asked: largest of all events.
    pub seen: usize,
    /// The most points at any time, and Σ of the points over all looks and the start.
    pub points: [u64; 2],
}

/// A number of the books.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub name: String,
    pub value: f64,
}

impl Column {
    pub fn new(name: impl Into<String>, value: f64) -> Self {
        Column { name: name.into(), value }
    }
}

/// The energies (J; J/m of thickness in 2D, J of a unit cross-section in 1D) and momenta of a body at one instant; of what
/// diffuses, the amount stands for the momentum.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Balance {
    pub kinetic: f64,
    pub strain: f64,
    /// Energy that broken bonds took with them.
    pub fracture: f64,
    /// Work of loads and prescribed motion.
    pub external: f64,
    /// Energy taken by damping.
    pub damped: f64,
    /// Energy that came in when points were split and merged.
    pub refined: f64,
    /// Kinetic and strain energy at the start.
    pub initial: f64,
    /// N·s
    pub momentum: [f64; 3],
    /// What came in from outside, N·s.
    pub impulse: [f64; 3],
    /// About the origin, N·m·s.
    pub angular_momentum: [f64; 3],
    /// |momentum − initial momentum − impulse from outside|, N·s.
    pub momentum_defect: f64,
    /// Σ ρ |v| V: what the momentum defect is measured against, N·s.
    pub momentum_scale: f64,
}

impl Balance {
    /// What is found less what should be there, J.
    pub fn defect(&self) -> f64 {
        self.kinetic + self.strain + self.fracture + self.damped - self.initial - self.external - self.refined
    }

    /// What a defect is measured against: the larger of the initial energy and the external work, J.
    pub fn scale(&self) -> f64 {
        self.initial.max(self.external.abs())
    }
}

/// A bond of a body at rest that is a spring of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// Of its states, one at each end; twice the same where it is seen from one end only, as the bond to an image.
    pub bits: [usize; 2],
    /// The slots of its ends; of an image that of its source.
    pub ends: [u32; 2],
    /// ξ, m
    pub xi: [f64; 3],
    /// Of the components of the displacement of the second end, as the first one sees it.
    pub signs: [f64; 3],
    /// w: it holds ½ w s² at the stretch s; J.
    pub weight: f64,
    /// s₀, infinite where it never breaks.
    pub critical: f64,
}

/// A whole bond, from one end, at some displacements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretched {
    /// Of its state.
    pub bit: usize,
    /// s
    pub stretch: f64,
    /// The change of s along some vector.
    pub rate: f64,
    /// s₀
    pub critical: f64,
}

/// A body at rest, as static solvers see it: in double precision whatever the fields are stored in. Unknowns are the
/// displacements by slot, component after component; forces are those on a point, N.
pub trait Tangent {
    fn components(&self) -> usize;
    fn points(&self) -> &dyn Points;
    /// Displacements now, m.
    fn displacement(&mut self) -> Vec<f64>;
    /// Internal forces at displacements `u`, force density times volume.
    fn forces(&mut self, u: &[f64], force: &mut [f64]);
    /// Whether forces are linear in displacements.
    fn is_linear(&self) -> bool;
    /// The diagonal of −∂force density/∂u at rest, by unknown, N/m⁴ in 3D; zero where there are no bonds.
    fn diagonal(&mut self) -> Vec<f64>;
    /// What the blocks of the points on the diagonal are as a preconditioner; rows and columns that are not free are those of
    /// one.
    fn block_diagonal(&mut self, free: &dyn Fn(usize) -> bool) -> Result<Box<dyn Preconditioner>, LinearError>;
    /// −∂force/∂u at displacements `u`, N/m; rows and columns that are not free are those of one.
    ///
    /// # Panics
    /// Where a material has no tangent by bonds: cases that ask for it are refused.
    fn assemble(&mut self, u: &[f64], free: &dyn Fn(usize) -> bool) -> Sparse;
    /// Whether bonds can break.
    fn can_break(&self) -> bool;
    /// The bonds of the families as springs, broken ones too; None where points feel more than their own bonds.
    fn springs(&mut self) -> Option<Vec<Spring>>;
    /// The whole bonds, from each end, for which `keep` holds of their stretch at displacements `u`, its change along `v`, and the
    /// critical stretch.
    fn stretched(&mut self, u: &[f64], v: &[f64], keep: &(dyn Fn(f64, f64, f64) -> bool + Sync)) -> Vec<Stretched>;
    /// Breaks bonds, at displacements `u`, by the numbers of their bits, both of each bond.
    fn break_bonds(&mut self, u: &[f64], bits: &[usize]) -> Broken;
    /// The bits of the bonds, to be kept and put back when a step fails.
    fn words(&self) -> &[u16];
    fn words_mut(&mut self) -> &mut [u16];
}
