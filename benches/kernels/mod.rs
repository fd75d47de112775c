//! The sums over bonds that are timed and counted: each by its name, on a body of the asked size.

use bondwise::discretization::collocation::SharedRow;
use bondwise::discretization::{Collocation, Influence, Operator, PartialVolume, Regions, standard};
use bondwise::execution::{Exec, Instructions, Limits, Packs};
use bondwise::family::{Body, BondStates};
use bondwise::field::{Double, Mixed, Number, Single, components, components_mut};
use bondwise::geometry::{Arrangement, Cloud, Shape};
use bondwise::physics::Physics;
use bondwise::physics::elasticity::laws::{BondBased, BondBasedLinear};
use bondwise::physics::elasticity::linear_solid::{LinearSolid, Moduli, Stretch};
use bondwise::physics::elasticity::moduli::Hypothesis;
use bondwise::physics::elasticity::{Bonds, Elasticity, Material};
use bondwise::physics::failure::CriticalStretch;

/// Points along the edges of the bodies.
#[derive(Debug, Clone, Copy)]
pub struct Edges {
    pub plate: [usize; 2],
    /// Long along x, so that many blocks have all their bonds.
    pub solid: [usize; 3],
    pub cloud: [usize; 3],
}

/// A kernel on its body.
pub struct Kernel {
    /// Directed: bond updates of one evaluation.
    pub bonds: u64,
    pub evaluate: Box<dyn FnMut()>,
}

type Maker = fn(Edges, Instructions) -> Kernel;

/// What is summed.
#[derive(Clone, Copy, PartialEq)]
enum What {
    /// Forces at strains for which the small form of the law serves.
    Force,
    /// The same where bonds never break: of a linear law, by rows.
    Unbreakable,
    /// Forces at strains that ask for the exact form, after the small one.
    ExactForce,
    /// The strain energy density.
    Energy,
    /// Forces of a state-based solid, small form.
    TwoPasses,
}

/// All kernels: what, law, path and dimension, precision.
#[rustfmt::skip] // a table
pub const KERNELS: [(&str, Maker); 32] = [
    ("force/bond_based/lattice2d/double", |e, i| plate::<_, Double>(BondBased, What::Force, e, i)),
    ("force/bond_based/lattice2d/single", |e, i| plate::<_, Single>(BondBased, What::Force, e, i)),
    ("force/bond_based/lattice2d/mixed", |e, i| plate::<_, Mixed>(BondBased, What::Force, e, i)),
    ("force/bond_based/lattice3d/double", |e, i| solid::<_, Double>(BondBased, What::Force, e, i)),
    ("force/bond_based/lattice3d/single", |e, i| solid::<_, Single>(BondBased, What::Force, e, i)),
    ("force/bond_based/lattice3d/mixed", |e, i| solid::<_, Mixed>(BondBased, What::Force, e, i)),
    ("force/bond_based/cloud3d/double", |e, i| cloud::<_, Double>(BondBased, What::Force, e, i)),
    ("force/bond_based/cloud3d/single", |e, i| cloud::<_, Single>(BondBased, What::Force, e, i)),
    ("force/bond_based/cloud3d/mixed", |e, i| cloud::<_, Mixed>(BondBased, What::Force, e, i)),
    ("force/bond_based_linear/lattice2d/double", |e, i| plate::<_, Double>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/lattice2d/single", |e, i| plate::<_, Single>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/lattice2d/mixed", |e, i| plate::<_, Mixed>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/lattice3d/double", |e, i| solid::<_, Double>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/lattice3d/single", |e, i| solid::<_, Single>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/lattice3d/mixed", |e, i| solid::<_, Mixed>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/cloud3d/double", |e, i| cloud::<_, Double>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/cloud3d/single", |e, i| cloud::<_, Single>(BondBasedLinear, What::Force, e, i)),
    ("force/bond_based_linear/cloud3d/mixed", |e, i| cloud::<_, Mixed>(BondBasedLinear, What::Force, e, i)),
    ("rows/bond_based_linear/lattice2d/double", |e, i| plate::<_, Double>(BondBasedLinear, What::Unbreakable, e, i)),
    ("rows/bond_based_linear/lattice3d/double", |e, i| solid::<_, Double>(BondBasedLinear, What::Unbreakable, e, i)),
    ("rows/bond_based_linear/lattice3d/single", |e, i| solid::<_, Single>(BondBasedLinear, What::Unbreakable, e, i)),
    ("rows/bond_based_linear/lattice3d/mixed", |e, i| solid::<_, Mixed>(BondBasedLinear, What::Unbreakable, e, i)),
    ("exact_force/bond_based/lattice3d/double", |e, i| solid::<_, Double>(BondBased, What::ExactForce, e, i)),
    ("exact_force/bond_based/cloud3d/double", |e, i| cloud::<_, Double>(BondBased, What::ExactForce, e, i)),
    ("energy/bond_based/lattice3d/double", |e, i| solid::<_, Double>(BondBased, What::Energy, e, i)),
    ("energy/bond_based/cloud3d/double", |e, i| cloud::<_, Double>(BondBased, What::Energy, e, i)),
    ("force/state_based/lattice3d/double", |e, i| solid::<_, Double>(BondBased, What::TwoPasses, e, i)),
    ("force/state_based/lattice3d/single", |e, i| solid::<_, Single>(BondBased, What::TwoPasses, e, i)),
    ("force/state_based/lattice3d/mixed", |e, i| solid::<_, Mixed>(BondBased, What::TwoPasses, e, i)),
    ("force/state_based/cloud3d/double", |e, i| cloud::<_, Double>(BondBased, What::TwoPasses, e, i)),
    ("collocation/bond_based/lattice2d/double", |e, i| collocation(filled(e.plate), 13, i)),
    ("collocation/bond_based/lattice3d/double", |e, i| collocation(filled(e.solid), 33, i)),
];

/// The kernel of a name, if there is one.
pub fn kernel(name: &str, edges: Edges, instructions: Instructions) -> Option<Kernel> {
    KERNELS.iter().find(|k| k.0 == name).map(|(_, make)| make(edges, instructions))
}

/// Δx, m.
const SPACING: f64 = 1e-3;

fn filled<const D: usize>(edges: [usize; D]) -> Cloud<D> {
    Cloud::lattice(&Shape::Box { low: [0.0; D], high: edges.map(|n| n as f64 * SPACING) }, SPACING, 4)
}

fn plate<L: Stretch<2> + 'static, P: Packs>(law: L, what: What, edges: Edges, instructions: Instructions) -> Kernel {
    on_body::<2, L, P>(filled(edges.plate), law, what, instructions)
}

fn solid<L: Stretch<3> + 'static, P: Packs>(law: L, what: What, edges: Edges, instructions: Instructions) -> Kernel {
    on_body::<3, L, P>(filled(edges.solid), law, what, instructions)
}

/// The points of a lattice, each moved a little.
fn cloud<L: Stretch<3> + 'static, P: Packs>(law: L, what: What, edges: Edges, instructions: Instructions) -> Kernel {
    let lattice = filled::<3>(edges.cloud);
    let moved = |(k, &slot): (usize, &u32)| {
        let phase = k as f64;
        let [x, y, z] = lattice.position(slot as usize);
        let shift = |factor: f64| 0.05 * SPACING * (factor * phase).sin();
        [x + shift(1.3), y + shift(2.9), z + shift(4.7)]
    };
    let positions: Vec<[f64; 3]> = lattice.slots.iter().enumerate().map(moved).collect();
    let volumes = vec![SPACING.powi(3); positions.len()];
    on_body::<3, L, P>(Cloud::scattered(positions, volumes), law, what, instructions)
}

/// A body, slightly deformed, in which no bond breaks.
fn on_body<const D: usize, L: Stretch<D> + 'static, P: Packs>(
    points: Cloud<D>,
    law: L,
    what: What,
    instructions: Instructions,
) -> Kernel {
    let body: Body<D> = standard::body(points, 3.015 * SPACING, PartialVolume::None);
    let operator = Operator::standard(&body, 1.0, Influence::Constant, PartialVolume::None);
    let failure = (what != What::Unbreakable).then(|| CriticalStretch::uniform(0.1));
    let solid = Moduli::new(Hypothesis::Solid, 1.0, 0.3);
    let material: Box<dyn Material<D, P>> = if what == What::TwoPasses {
        Box::new(LinearSolid::new(law, &[solid], &body, &operator.weights))
    } else {
        Box::new(Bonds::new(law))
    };
    let mut elasticity = Elasticity::new(body, operator, material, 1.0, failure);
    let Elasticity { body, state, .. } = &mut elasticity;
    // Strains up to 0.1 %, or 3 %: those of the first are below the 1 % up to which small forms serve.
    let stretch = if what == What::ExactForce { 3e-2 } else { 1e-3 };
    for &slot in &body.cloud.slots {
        let x = body.cloud.position(slot as usize);
        for (d, u) in components_mut::<D, _>(&mut state.displacement).into_iter().enumerate() {
            u[slot as usize] = P::Field::from_f64(stretch * x[d] / (d + 1) as f64);
        }
    }
    let bonds = state.states.count();
    elasticity.exec = Exec::on(instructions);
    let evaluate = move || match what {
        What::Energy => drop(elasticity.energy_density()),
        What::Force | What::ExactForce | What::Unbreakable | What::TwoPasses => elasticity.evolve(0.0),
    };
    Kernel { bonds, evaluate: Box::new(evaluate) }
}

/// Rows of order 2 at all points whose family is whole, with their look at the strain; nodes are counted as bonds.
fn collocation<const D: usize>(points: Cloud<D>, nodes: usize, instructions: Instructions) -> Kernel {
    let body: Body<D> = standard::body(points, 3.0 * SPACING, PartialVolume::Ramp);
    let Arrangement::Lattice(lattice) = &body.cloud.arrangement else { unreachable!("it was made as one") };
    let fit = Collocation::new(2, nodes).on_lattice::<D>(SPACING, 3.0 * SPACING).expect("as many nodes as it takes");
    let row = SharedRow::new(lattice, &fit, &fit.elastic(&Influence::Constant, 1.0)).expect("it is of this lattice");
    let regions = Regions::new(&body, &BondStates::whole(&body), std::iter::empty(), 1);
    let n = body.cloud.n_slots();
    let mut displacement = vec![0.0; D * n];
    for &slot in &body.cloud.slots {
        let x = body.cloud.position(slot as usize);
        for (d, u) in components_mut::<D, _>(&mut displacement).into_iter().enumerate() {
            u[slot as usize] = 1e-3 * x[d] / (d + 1) as f64;
        }
    }
    let mut force = vec![0.0; D * n];
    let mut exec = Exec::on(instructions);
    let limits = Limits { strain: 0.01, linear: false, gradient: 0.02 };
    let bonds = (regions.collocated_points() * row.n_nodes()) as u64;
    let evaluate = move || {
        let (input, output) = (components::<D, _>(&displacement), components_mut::<D, _>(&mut force));
        exec.collocate::<D, Double>(&body, &row, &regions, &regions.collocated, input, output, &limits);
    };
    Kernel { bonds, evaluate: Box::new(evaluate) }
}
