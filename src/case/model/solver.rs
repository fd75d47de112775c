//! Tables of the solvers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FirstOrder;

/// One solver, or several that follow each other.
///
/// A list is `[{ static = { ... } }, { velocity_verlet = { ... } }]`, or several `[[solver]]` tables. Each begins with the
/// displacements and the bonds that the one before it left. Time goes on, so that `end_time` ascends.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Chain {
    One(Solver),
    Several(#[schemars(length(min = 1))] Vec<Solver>),
}

impl Chain {
    /// The solvers, each with its key path.
    pub fn stages(&self) -> impl Iterator<Item = (String, &Solver)> {
        let (list, single) = match self {
            Chain::One(solver) => (std::slice::from_ref(solver), true),
            Chain::Several(list) => (&list[..], false),
        };
        let path = move |(k, solver): (usize, &'_ Solver)| {
            let name = solver.name();
            if single { format!("solver.{name}") } else { format!("solver[{k}].{name}") }
        };
        list.iter().enumerate().map(move |(k, solver)| (path((k, solver)), solver))
    }
}

impl Solver {
    /// The key that chooses it.
    pub fn name(&self) -> &'static str {
        match self {
            Solver::VelocityVerlet(_) => "velocity_verlet",
            Solver::RungeKutta(_) => "runge_kutta",
            Solver::Static(_) => "static",
            Solver::Newton(_) => "newton",
            Solver::DynamicRelaxation(_) => "dynamic_relaxation",
            Solver::QuasiStatic(_) => "quasi_static",
            Solver::ForwardEuler(_) => "forward_euler",
        }
    }

    /// s
    pub fn end_time(&self) -> f64 {
        match self {
            Solver::VelocityVerlet(s) | Solver::RungeKutta(s) => s.end_time,
            Solver::Static(s) | Solver::Newton(s) => s.end_time,
            Solver::QuasiStatic(s) => s.end_time,
            Solver::DynamicRelaxation(s) => s.end_time,
            Solver::ForwardEuler(s) => s.end_time,
        }
    }

    /// Whether it advances equations of first order, as those of diffusion; all others are of motion or rest.
    pub fn is_of_first_order(&self) -> bool {
        matches!(self, Solver::ForwardEuler(_))
    }
}

/// How time advances, or how the body comes to rest. The static solvers take load steps: time is what conditions are
/// given in, and nothing moves by itself.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Solver {
    /// Explicit, second order; one sum over bonds a step.
    VelocityVerlet(Explicit),
    /// Explicit, fourth order; four sums over bonds a step, which may be √2 times as long.
    RungeKutta(Explicit),
    /// Equilibrium at small displacements: the law linearised at rest. No bond breaks.
    Static(Statics),
    /// Equilibrium of the law as it is, by Newton's method. No bond breaks.
    Newton(Statics),
    /// The same by motion that dies out: no linear system is solved.
    DynamicRelaxation(Relaxation),
    /// Equilibrium of the law as it is, and bonds break one by one where the load has reached what they bear.
    QuasiStatic(QuasiStatic),
    /// Of diffusion: explicit, first order; one sum over bonds a step.
    ForwardEuler(FirstOrder),
}

/// Parameters of static solvers.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Statics {
    /// Time at the end of the last load step; 1 s if not given.
    #[serde(default = "super::one")]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Load steps, of the same length.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// At rest when forces out of balance are at most this share of loads or reactions.
    #[serde(default = "balanced")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Iterations of Newton's method in a load step.
    #[serde(default = "newton_iterations")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// How the linear system in each of these is solved.
    #[serde(default)]
    pub linear: LinearSolver,
    /// Of the Krylov methods; `jacobi` if not given.
    pub preconditioner: Option<Preconditioner>,
    /// Iterations of the linear solver in each system.
    #[serde(default = "many_iterations")]
    #[schemars(range(min = 1))]
    pub max_linear: usize,
}

/// Parameters of cracks that grow at rest.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuasiStatic {
    /// Time at the end of the last load step; 1 s if not given.
    #[serde(default = "super::one")]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Load steps, of the same length. In each of them what is prescribed changes in proportion to time.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// What the loads do while bonds break.
    #[serde(default)]
    pub control: Control,
    /// Which bonds break before the body is brought to rest again.
    #[serde(default, rename = "break")]
    pub together: Together,
    /// At rest when forces out of balance are at most this share of loads or reactions.
    #[serde(default = "balanced")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Iterations of Newton's method from one break to the next.
    #[serde(default = "newton_iterations")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// How linear systems are solved. If not given: in 1D and 2D by factors that many breaks share, as `direct`; where these do
    /// not fit by `conjugate_gradients`.
    pub linear: Option<LinearSolver>,
    /// Of the Krylov methods; `jacobi` if not given.
    pub preconditioner: Option<Preconditioner>,
    /// Iterations of the linear solver in each system.
    #[serde(default = "many_iterations")]
    #[schemars(range(min = 1))]
    pub max_linear: usize,
}

/// What the loads do while bonds break.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Control {
    /// They stay until no bond breaks any more, then they rise.
    #[default]
    Load,
    /// They fall as far as equilibrium wants, so that each bond breaks where it just does: the snap-back of the load curve is in
    /// `load_steps` of the report.
    Equilibrium,
}

/// Which bonds break before the body is brought to rest again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Together {
    /// The one that breaks first, with those that are strained alike.
    #[default]
    One,
    /// Those, too, whose strain beyond the critical one is more than this share of the largest excess: fewer states at rest, and
    /// bonds break that the first ones would have relieved.
    Share(#[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))] f64),
}

/// Solvers of linear systems.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinearSolver {
    /// Without a matrix; for stable bodies, whose tangent is symmetric and positive.
    #[default]
    ConjugateGradients,
    /// Sparse factors of the assembled tangent: 2D, or 3D below some 30 000 unknowns.
    Direct,
    /// For any tangent.
    Bicgstab,
    /// For any tangent; safer and in more memory.
    Gmres,
}

/// Preconditioners of linear systems.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioner {
    /// The diagonal of the tangent.
    #[default]
    Jacobi,
    /// The block of each point on the diagonal.
    BlockJacobi,
    /// Incomplete factors of the assembled tangent: fewer iterations, at some hundred bytes a bond.
    IncompleteFactors,
    /// None.
    None,
}

/// Parameters of dynamic relaxation.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Relaxation {
    /// Time at the end of the last load step; 1 s if not given.
    #[serde(default = "super::one")]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Load steps, of the same length.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// At rest when forces out of balance are at most this share of loads or reactions.
    #[serde(default = "balanced")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Steps of the motion in a load step.
    #[serde(default = "many_iterations")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
}

fn one_step() -> u64 {
    1
}

fn balanced() -> f64 {
    1e-8
}

fn newton_iterations() -> usize {
    50
}

fn many_iterations() -> usize {
    100_000
}

/// Parameters of explicit solvers.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Explicit {
    /// The instant at which it ends: the last step is shorter where it has to be.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Δt as a fraction of the stable step that is estimated from the discretisation (0.8 if not given). Either this or
    /// `time_step`.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub safety: Option<f64>,
    /// Δt. Above the estimate of the stable step it is taken where it is proven stable.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
    /// c in ρ ü = force − ρ c u̇. `velocity_verlet` bears any; `runge_kutta` c Δt up to 2.785.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/s", "minimum" = 0))]
    pub damping: f64,
}
