//! Elastic bodies that break: ρ ü = Σ μ f(ξ, η) β V′ + b.
//!
//! The equation of motion of Silling & Askari (2005), discretised as in Shojaei et al. 2022, eq. (26). What is inside, and
//! of which law, is a [`Material`].

mod adapt;
mod bond_forces;
pub mod bonds;
mod breaking;
pub mod density;
pub mod discrete;
pub mod hybrid;
mod images;
mod kernels;
pub mod laws;
pub mod linear_solid;
pub mod material;
pub mod moduli;
mod resultants;
mod springs;
mod stress;
mod stretched;
pub mod surface;
mod tangent;

use std::ops::Range;

pub use adapt::{Adaptation, INDICATORS};
pub use bond_forces::{BondForce, BondForces};
pub use bonds::Bonds;
pub use density::Density;
pub use hybrid::{Hybrid, Work};
use kernels::bonded_volume;
pub use linear_solid::LinearSolid;
pub use material::{Material, On, Overstretched, RowBoundary};
use stretched::stretch_ratios;

use super::{
    Adapted, Balance, Column, Content, FieldInfo, ForceAndMoment, Physics, Points, Replaced, Resultant, StretchedBond,
};
use crate::discretization::Operator;
use crate::execution::{Broken, Exec, Packs};
use crate::family::{Body, BondStates, Families};
use crate::field::{Double, Field, Kind, Number, Precision, Values, components, embed};
use crate::geometry::{Arrangement, Crack, Images};
use crate::parallel;
use crate::physics::failure::CriticalStretch;
use crate::solver::Drift;
use crate::unknown::{Unknown, Vectors};
use crate::visit::Visitor;

/// An elastic body: its points and bonds, what it is made of, and where it stands.
pub struct Elasticity<const D: usize, P: Packs = Double> {
    pub body: Body<D>,
    pub operator: Operator,
    pub density: Density<P::Field>,
    /// Number of the material of each slot; empty where there is one.
    pub materials: Vec<u8>,
    /// None: bonds never break.
    pub failure: Option<CriticalStretch>,
    pub material: Box<dyn Material<D, P>>,
    pub state: State<P>,
    pub exec: Exec,
    /// σ_zz over σ_xx + σ_yy in 2D by number of the material: the Poisson ratio in plane strain; empty in plane stress.
    pub out_of_plane: Vec<f64>,
    /// Σ β V′ over the family before any bond broke, by slot: what damage is measured against.
    family_volume: Vec<P::Field>,
    /// Directed bonds of the body, and how many of them the pre-cracks cut.
    n_bonds: u64,
    n_cut: u64,
    /// How cells follow the solution; None if they do not.
    adaptation: Option<Box<Adaptation<D>>>,
    /// What each point belongs to: only points of one class are merged.
    merge_class: Vec<u32>,
    adapted: Adapted,
    generation: u64,
}

/// The vectors and bonds of an elastic body.
#[derive(Debug, Clone)]
pub struct State<P: Precision = Double> {
    /// Displacement, m; component after component over all slots.
    pub displacement: Vec<P::Field>,
    /// m/s
    pub velocity: Vec<P::Field>,
    /// Force density: internal, and after the loads are added total; N/m³.
    pub force: Vec<P::Field>,
    /// μ: one bit a directed bond.
    pub states: BondStates,
    /// Broken since the start, pre-cracks not counted.
    pub broken: Broken,
}

impl<P: Precision> State<P> {
    /// At rest, all bonds whole.
    pub fn new<const D: usize>(body: &Body<D>) -> Self {
        let zeros = || vec![P::Field::default(); D * body.cloud.n_slots()];
        State {
            displacement: zeros(),
            velocity: zeros(),
            force: zeros(),
            states: BondStates::whole(body),
            broken: Broken::default(),
        }
    }
}

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// A body at rest whose bonds are whole. `density` in kg/m³ (2D: unit thickness; 1D: unit cross-section).
    pub fn new(
        body: Body<D>,
        operator: Operator,
        material: Box<dyn Material<D, P>>,
        density: f64,
        failure: Option<CriticalStretch>,
    ) -> Self {
        let state = State::new(&body);
        let mut elasticity = Elasticity {
            body,
            operator,
            density: Density::same(density),
            materials: Vec::new(),
            failure,
            material,
            n_bonds: state.states.count(),
            state,
            exec: Exec::default(),
            out_of_plane: Vec::new(),
            family_volume: Vec::new(),
            n_cut: 0,
            adaptation: None,
            merge_class: Vec::new(),
            adapted: Adapted::default(),
            generation: 0,
        };
        elasticity.measure_families();
        elasticity
    }

    /// Breaks the bonds that cross a pre-crack or one of its images; how many, both directions counted. `tolerance`, m: what
    /// counts as touching. All at once, since pieces that meet are one crack.
    pub fn cut(&mut self, cracks: &[Crack<D>], tolerance: f64) -> u64 {
        let cut = self.state.states.cut(&self.body, cracks, tolerance);
        self.n_cut += cut;
        cut
    }

    /// From here on points have rows as the hybrid scheme that `over` puts over the material says. Before the start.
    pub fn hybridised(self, over: impl FnOnce(Box<dyn Material<D, P>>) -> Hybrid<D, P>) -> Self {
        let mut elasticity = self;
        let mut hybrid = over(elasticity.material);
        hybrid.begin(&elasticity.body, &mut elasticity.exec);
        elasticity.material = Box::new(hybrid);
        elasticity
    }

    /// The material, what its passes run over, and the state that they change.
    pub fn parts(&mut self) -> (&mut dyn Material<D, P>, On<'_, D>, &mut State<P>) {
        let Elasticity { body, operator, failure, material, state, exec, .. } = self;
        (&mut **material, On { body, operator, failure: failure.as_ref(), exec }, state)
    }

    /// Strain energy density by slot, J/m³.
    pub fn energy_density(&mut self) -> Vec<P::Field> {
        let mut density = vec![P::Field::default(); self.body.cloud.n_slots()];
        self.with_images(|body| {
            let (material, mut on, state) = body.parts();
            material.energy_density(&mut on, &state.states, components::<D, _>(&state.displacement), &mut density);
        });
        density
    }

    /// Takes note of what families were before any bond broke.
    fn measure_families(&mut self) {
        let mut volume = vec![0.0; self.body.cloud.n_slots()];
        let whole = BondStates::whole(&self.body);
        bonded_volume(&mut self.exec, &self.body, &self.operator.volumes, &whole, &mut volume);
        self.n_bonds = whole.count();
        self.family_volume = volume.into_iter().map(P::Field::from_f64).collect();
    }

    /// φ = 1 − Σ μ β V′ / Σ β V′ by slot; Shojaei et al. 2022, eq. (21).
    fn damage(&mut self) -> Vec<f64> {
        // Points with a row have lost no bond.
        let mut now: Vec<f64> = self.family_volume.iter().map(|whole| whole.to_f64()).collect();
        bonded_volume(&mut self.exec, &self.body, &self.operator.volumes, &self.state.states, &mut now);
        let damage = |slot: usize| {
            let [now, whole] = [P::Field::from_f64(now[slot]), self.family_volume[slot]].map(P::Field::to_f64);
            if whole > 0.0 { 1.0 - now / whole } else { 0.0 }
        };
        parallel::map(now.len(), &damage)
    }

    /// One of the vectors at some slots.
    fn vectors(&self, flat: &[P::Field], slots: &[u32]) -> Values {
        let parts = components::<D, _>(flat);
        Values::Vector(gather(slots, &|slot| embed::<D>(&std::array::from_fn(|d| parts[d][slot].to_f64()))))
    }

    /// The fields, each with what computes it at some slots: a line here is all that a field takes.
    const FIELDS: &'static [(FieldInfo, FieldOf<D, P>)] = &[
        (info("displacement", "m", "u").of(Kind::Vector), |body, slots| body.vectors(&body.state.displacement, slots)),
        (info("velocity", "m/s", "its rate").of(Kind::Vector), |body, slots| body.vectors(&body.state.velocity, slots)),
        (info("force", "N/m³", "density of internal force and load").of(Kind::Vector), |body, slots| {
            body.vectors(&body.state.force, slots)
        }),
        (info("damage", "", "φ, 0 whole to 1 free of all bonds"), |body, slots| {
            let damage = body.damage();
            Values::Scalar(gather(slots, &|slot| damage[slot]))
        }),
        (info("strain_energy", "J/m³", "W, density of what bonds hold"), |body, slots| {
            let density = body.energy_density();
            Values::Scalar(gather(slots, &|slot| density[slot].to_f64()))
        }),
        (info("material", "", "number of the material, from 0 in the order of their names"), |body, slots| {
            Values::Scalar(gather(slots, &|slot| body.materials.get(slot).map_or(0.0, |k| f64::from(*k))))
        }),
        (info("density", "kg/m³", "ρ"), |body, slots| Values::Scalar(gather(slots, &|slot| body.density.at(slot)))),
        (
            info("relative_stiffness", "", "c/c₀: what bonds inside are of those of the first material"),
            |body, slots| {
                let weights = &body.operator.weights;
                Values::Scalar(gather(slots, &|slot| body.material.relative_stiffness(weights, slot)))
            },
        ),
        (info("scheme", "", "1 where bonds are summed, 0 where a point has a row of collocation"), |body, slots| {
            Values::Scalar(gather(slots, &|slot| body.material.scheme(slot)))
        }),
        (info("stress", "Pa", "σ of the forces in the family: xx yy zz xy yz xz").of(Kind::Tensor), |body, slots| {
            Values::Tensor(body.stress(slots))
        }),
        (info("principal_stress", "Pa", "eigenvalues of σ, the largest first").of(Kind::Principal), |body, slots| {
            Values::Principal(body.of_stress(slots, stress::principal))
        }),
        (info("von_mises", "Pa", "√(3/2 s : s), s the deviator of σ"), |body, slots| {
            Values::Scalar(body.of_stress(slots, stress::von_mises))
        }),
        (info("pressure", "Pa", "−(σ_xx + σ_yy + σ_zz)/3"), |body, slots| {
            Values::Scalar(body.of_stress(slots, stress::pressure))
        }),
        (
            info("strain", "", "ε of linear laws, else Green–Lagrange: xx yy zz xy yz xz").of(Kind::Tensor),
            |body, slots| Values::Tensor(body.strain(slots)),
        ),
        (info("stretch_ratio", "", "largest stretch over critical stretch of the bonds that hold"), |body, slots| {
            let failure = body.failure.clone();
            Values::Scalar(body.pulled(|pulled| stretch_ratios(pulled, failure.as_ref(), slots)))
        }),
    ];
}

/// Computes a field at some slots.
type FieldOf<const D: usize, P> = fn(&mut Elasticity<D, P>, &[u32]) -> Values;

const fn info(name: &'static str, unit: &'static str, about: &'static str) -> FieldInfo {
    FieldInfo { name, unit, about, kind: Kind::Scalar }
}

impl FieldInfo {
    const fn of(self, kind: Kind) -> Self {
        FieldInfo { kind, ..self }
    }
}

/// The fields of elastic bodies.
pub fn fields() -> impl Iterator<Item = &'static FieldInfo> {
    Elasticity::<2, Double>::FIELDS.iter().map(|(info, _)| info)
}

impl<const D: usize, P: Packs> Physics for Elasticity<D, P> {
    fn unknown(&mut self) -> Unknown<'_> {
        let State { displacement, velocity, force, .. } = &mut self.state;
        let damped = self.material.damped();
        let relative_inertia = self.density.by_place();
        Unknown {
            vectors: P::Field::numbers(Vectors {
                value: displacement,
                velocity,
                rate: force,
                damped,
                relative_inertia,
            }),
            components: D,
            inertia: self.density.unit,
            negligible: P::Bond::NEGLIGIBLE * self.body.cloud.spacing,
        }
    }

    fn evaluate(&mut self) {
        self.with_images(|body| {
            let (material, mut on, state) = body.parts();
            material.evaluate(&mut on, state);
        });
    }

    fn evolve(&mut self, dt: f64) {
        self.with_images(|body| {
            let (material, mut on, state) = body.parts();
            material.evolve(&mut on, state, dt);
        });
    }

    fn drift_and_evolve(&mut self, drift: &Drift, dt: f64) -> Option<f64> {
        // The pass of a drift knows one inertia, and images have their values only when all points have drifted.
        if !self.density.is_same() || self.body.cloud.images.is_some() {
            return None;
        }
        let (material, mut on, state) = self.parts();
        material.drift_and_evolve(&mut on, state, drift, dt)
    }

    fn was_set(&mut self, component: usize, slots: &[u32]) {
        self.material.was_set(&self.state, component, slots);
    }

    fn has_drifted(&mut self) {
        self.material.has_drifted();
    }

    fn stable_step(&self) -> f64 {
        let mut on = On {
            body: &self.body,
            operator: &self.operator,
            failure: self.failure.as_ref(),
            exec: &mut Exec::default(),
        };
        self.material.stable_step(&mut on, &self.density)
    }

    /// A bond of its own holds or not; the energy of a state-based point is one of its whole family, which breaking changes.
    fn only_softens(&self) -> bool {
        let first = self.body.cloud.slots.first();
        let state_based = first.is_some_and(|&slot| self.material.dilatation_scales(slot as usize).is_some());
        self.failure.is_none() || !state_based
    }

    fn field(&mut self, name: &str, points: Range<usize>) -> Option<Field> {
        let (info, compute) = Self::FIELDS.iter().find(|(info, _)| info.name == name)?;
        let slots = self.body.cloud.slots[points].to_vec();
        let values = compute(self, &slots);
        Some(Field { name: info.name, unit: info.unit, values })
    }

    fn points(&self) -> &dyn Points {
        &self.body
    }

    fn generation(&self) -> u64 {
        self.generation
    }

    fn states(&self) -> &BondStates {
        &self.state.states
    }

    fn n_bonds(&self) -> [u64; 2] {
        [self.n_bonds, self.n_cut]
    }

    fn motion(&mut self) -> (f64, [f64; 3]) {
        let (cloud, density) = (&self.body.cloud, &self.density);
        let velocity = components::<D, _>(&self.state.velocity);
        if !density.is_same() {
            let [square, momentum @ ..] = self.exec.sum(cloud.n_points(), &|points| {
                let mut sum = [0.0; 4];
                for slot in cloud.stored(points) {
                    let mass = density.at(slot) * cloud.volume(slot);
                    for d in 0..D {
                        let v = velocity[d][slot].to_f64();
                        sum[0] += mass * v * v;
                        sum[d + 1] += mass * v;
                    }
                }
                sum
            });
            return (0.5 * square, momentum);
        }
        let (volumes, volume) = match &cloud.arrangement {
            // Slots without a point are at rest.
            Arrangement::Lattice(lattice) => (None, lattice.cell_volume()),
            Arrangement::Scattered { volumes, .. } => (Some(volumes), 1.0),
        };
        let [square, momentum @ ..] = self.exec.sum(cloud.n_slots(), &|slots| {
            let volumes = volumes.map(|v| &v[slots.clone()]);
            let mut sum = [0.0; 4];
            for d in 0..D {
                let [square, momentum] = squares_and_sum(&velocity[d][slots.clone()], volumes);
                sum[0] += square;
                sum[d + 1] = momentum;
            }
            sum
        });
        let mass = density.unit * volume;
        (0.5 * mass * square, momentum.map(|p| mass * p))
    }

    fn motion_of(&self, squares: f64) -> Option<f64> {
        let Arrangement::Lattice(_) = self.body.cloud.arrangement else { return None };
        let volume = self.body.cloud.spacing.powi(D as i32);
        Some(0.5 * self.density.unit * volume * squares)
    }

    fn content(&mut self) -> Content {
        let density = self.energy_density();
        let (cloud, rho) = (&self.body.cloud, &self.density);
        let [u, v] = [&self.state.displacement, &self.state.velocity].map(|flat| components::<D, _>(flat));
        let n = cloud.n_points();
        let [stored, scale, ..] = self.exec.sum(n, &|points| {
            let (mut strain, mut scale) = (0.0, 0.0);
            for slot in cloud.stored(points) {
                let volume = cloud.volume(slot);
                strain += density[slot].to_f64() * volume;
                scale += rho.at(slot) * volume * v.iter().map(|v| v[slot].to_f64().powi(2)).sum::<f64>().sqrt();
            }
            [strain, scale, 0.0, 0.0]
        });
        let momentum_of = |slot: usize| -> [f64; 3] {
            let mass = rho.at(slot) * cloud.volume(slot);
            embed::<D>(&std::array::from_fn(|d| mass * v[d][slot].to_f64()))
        };
        let angular = self.exec.sum(n, &|points| {
            let mut sum = [0.0; 4];
            for slot in cloud.stored(points) {
                let x = cloud.position(slot);
                let y = embed::<D>(&std::array::from_fn(|d| x[d] + u[d][slot].to_f64()));
                let p = momentum_of(slot);
                for d in 0..3 {
                    let (a, b) = ((d + 1) % 3, (d + 2) % 3);
                    sum[d] += y[a] * p[b] - y[b] * p[a];
                }
            }
            sum
        });
        Content { stored, scale, angular_momentum: [angular[0], angular[1], angular[2]] }
    }

    fn broken(&self) -> Broken {
        self.state.broken
    }

    fn resultant(&mut self, of: &Resultant) -> Option<ForceAndMoment> {
        self.force_and_moment(of)
    }

    fn most_stretched(&mut self) -> Option<StretchedBond> {
        let Elasticity { body, operator, failure, material, state, .. } = self;
        if let Some(images) = &body.cloud.images {
            images.fill(&mut state.displacement);
        }
        let u = components::<D, _>(&state.displacement);
        let (ratio, ends) =
            material.most_stretched(body, &operator.weights, &mut state.states, u, failure.as_ref()?)?;
        let [a, b] = ends.map(|slot| body.cloud.position(slot));
        Some(StretchedBond { ratio, position: embed::<D>(&std::array::from_fn(|d| 0.5 * (a[d] + b[d]))) })
    }

    fn dissipates(&self) -> bool {
        self.material.dissipates()
    }

    fn dissipation(&mut self) -> Option<f64> {
        let (material, mut on, state) = self.parts();
        material.dissipation(&mut on, state)
    }

    fn columns(&self, b: &Balance) -> Vec<Column> {
        let relative = if b.scale() > 0.0 { b.defect() / b.scale() } else { 0.0 };
        let mut columns: Vec<Column> = [
            ("kinetic", b.kinetic),
            ("strain", b.strain),
            ("fracture", b.fracture),
            ("external", b.external),
            ("damped", b.damped),
            ("imbalance", relative),
            ("broken_bonds", (self.state.broken.bonds / 2) as f64),
        ]
        .map(|(name, value)| Column::new(name, value))
        .into();
        let axes = ["x", "y", "z"];
        columns.extend((0..D).map(|d| Column::new(format!("momentum_{}", axes[d]), b.momentum[d])));
        // About z in 2D; none in 1D.
        let turns = [0..0, 2..3, 0..3][D - 1].clone();
        columns.extend(turns.map(|d| Column::new(format!("angular_momentum_{}", axes[d]), b.angular_momentum[d])));
        columns
    }

    fn first_bad(&mut self) -> Option<(&'static str, f64, usize)> {
        let State { displacement, velocity, force, .. } = &self.state;
        let slots = &self.body.cloud.slots;
        [("displacement", displacement), ("force density", force), ("velocity", velocity)].into_iter().find_map(
            |(name, flat)| {
                components::<D, _>(flat).into_iter().find_map(|component| {
                    let bad = slots.iter().position(|&slot| !component[slot as usize].to_f64().is_finite())?;
                    Some((name, component[slots[bad] as usize].to_f64(), bad))
                })
            },
        )
    }

    fn fastest(&mut self) -> Option<usize> {
        let (velocity, slots) = (components::<D, _>(&self.state.velocity), &self.body.cloud.slots);
        let speed = |&slot: &u32| velocity.iter().map(|v| v[slot as usize].to_f64().powi(2)).sum::<f64>();
        (0..slots.len()).max_by(|&a, &b| speed(&slots[a]).total_cmp(&speed(&slots[b])))
    }

    fn tangent(&mut self) -> Option<&mut dyn super::Tangent> {
        Some(self)
    }

    fn settle(&mut self, at_rest: &[f64], force: &[f64], broken: Broken) {
        self.state.broken.bonds += broken.bonds;
        self.state.broken.energy += broken.energy;
        for (u, value) in self.state.displacement.iter_mut().zip(at_rest) {
            *u = P::Field::from_f64(*value);
        }
        let (cloud, n) = (&self.body.cloud, self.body.cloud.n_slots());
        for d in 0..D {
            for slot in cloud.slots.iter().map(|&slot| slot as usize) {
                self.state.force[d * n + slot] = P::Field::from_f64(force[d * n + slot] / cloud.volume(slot));
            }
        }
    }

    fn adapt(&mut self, t: f64, thoroughly: bool) -> Option<Replaced> {
        self.follow(t, thoroughly)
    }

    fn adapts_every(&self) -> Option<u64> {
        self.adaptation.as_ref().map(|adaptation| adaptation.every)
    }

    fn adapted(&self) -> Option<Adapted> {
        let follows = self.adaptation.as_ref().is_some_and(|adaptation| adaptation.criteria.is_some());
        follows.then_some(self.adapted)
    }

    fn hybrid(&self) -> Option<Work> {
        self.material.work()
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        let State { displacement, velocity, force, states, broken } = &mut self.state;
        P::Field::visit(displacement, "displacement", visitor);
        P::Field::visit(velocity, "velocity", visitor);
        // The rate of the last evaluation: the next step begins with it.
        P::Field::visit(force, "force", visitor);
        visitor.words("bonds", states.vector());
        visitor.count("broken_bonds", &mut broken.bonds);
        visitor.number("fracture_energy", &mut broken.energy);
        self.material.visit(visitor);
        self.exec.visit(visitor);
    }

    fn hash(&mut self, hasher: &mut blake3::Hasher) {
        for flat in [&self.state.displacement, &self.state.velocity] {
            for component in components::<D, _>(flat) {
                for &slot in &self.body.cloud.slots {
                    hasher.update(component[slot as usize].bytes().as_ref());
                }
            }
        }
        hasher.update(&self.state.states.bytes());
    }

    fn memory(&self) -> usize {
        let cloud = &self.body.cloud;
        let fields = (3 * D + 1) * size_of::<P::Field>() * cloud.n_slots()
            + size_of_val(&cloud.slots[..])
            + self.density.memory()
            + self.materials.len();
        let images = cloud.images.as_ref().map_or(0, Images::memory);
        let classes = self.failure.as_ref().map_or(0, CriticalStretch::memory);
        let points = match &cloud.arrangement {
            Arrangement::Lattice(_) => 0,
            Arrangement::Scattered { positions, volumes } => size_of_val(&positions[..]) + size_of_val(&volumes[..]),
        };
        let families = match &self.body.families {
            Families::Lattice(families) => size_of_val(&families.blocks[..]),
            // Sites in the precision of the loops, and the records of input values.
            Families::Cloud(families) => {
                let records = size_of_val(&families.sites.records[..]);
                let fixed = if size_of::<P::Bond>() == 4 { records / 2 } else { 0 };
                let input = 4 * size_of::<P::Field>() * cloud.n_slots();
                size_of_val(&families.starts[..]) + size_of_val(&families.neighbours[..]) + records + fixed + input
            }
        };
        let bonds = size_of_val(self.state.states.words()) + self.operator.memory();
        fields + images + classes + points + families + bonds + self.material.memory()
    }
}

/// A value for each slot.
fn gather<T: Send>(slots: &[u32], value: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    parallel::map(slots.len(), &|k| value(slots[k] as usize))
}

/// Σ v² V and Σ v V; V = 1 where none is given. Eight sums side by side, so that the loop is vectors.
fn squares_and_sum<T: Number>(values: &[T], volumes: Option<&[f64]>) -> [f64; 2] {
    let (mut squares, mut sums) = ([0.0; 8], [0.0; 8]);
    let mut chunks = values.chunks_exact(8);
    match volumes {
        None => {
            for chunk in &mut chunks {
                for k in 0..8 {
                    let v = chunk[k].to_f64();
                    squares[k] += v * v;
                    sums[k] += v;
                }
            }
            for (k, v) in chunks.remainder().iter().enumerate() {
                squares[k] += v.to_f64() * v.to_f64();
                sums[k] += v.to_f64();
            }
        }
        Some(volumes) => {
            for (k, (v, volume)) in values.iter().zip(volumes).enumerate() {
                let v = v.to_f64();
                squares[k % 8] += v * v * volume;
                sums[k % 8] += v * volume;
            }
        }
    }
    [squares, sums].map(|[a, b, c, d, e, f, g, h]| ((a + e) + (c + g)) + ((b + f) + (d + h)))
}
