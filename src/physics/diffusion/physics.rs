//! A body in which something diffuses: Ċ = L C + S.
//!
//! An equation of first order in one component. What is kept where nothing enters is the amount Σ C V, which the standard
//! scheme keeps to rounding.

use std::ops::Range;

use super::Diffusion;
use crate::execution::Exec;
use crate::family::{Body, BondStates, Families};
use crate::field::{Field, Kind, Values};
use crate::geometry::{Arrangement, Crack};
use crate::parallel;
use crate::physics::{Balance, Column, Content, FieldInfo, Physics, Points};
use crate::unknown::{Numbers, Unknown, Vectors};
use crate::visit::Visitor;

/// Concentrations on one body, and where they stand.
pub struct Diffusing<const D: usize> {
    pub body: Body<D>,
    pub diffusion: Diffusion,
    /// C by slot, in whatever unit its user has.
    pub concentration: Vec<f64>,
    /// Ċ, per second.
    rate: Vec<f64>,
    /// Which bonds carry something: all but those that pre-cracks cut.
    bonds: BondStates,
    /// Directed bonds before any was cut, and how many were.
    n_bonds: u64,
    n_cut: u64,
    exec: Exec,
}

impl<const D: usize> Diffusing<D> {
    /// Without any concentration.
    pub fn new(body: Body<D>, diffusion: Diffusion) -> Self {
        let n = body.cloud.n_slots();
        let bonds = BondStates::whole(&body);
        let n_bonds = bonds.count();
        let (concentration, rate) = (vec![0.0; n], vec![0.0; n]);
        Diffusing { body, diffusion, concentration, rate, bonds, n_bonds, n_cut: 0, exec: Exec::default() }
    }

    /// Makes pre-cracks insulators: the bonds that they cut carry nothing. How many they are, both directions counted;
    /// `tolerance` in m, what counts as touching. Of the standard scheme: rows of collocation are right for whole balls only.
    pub fn cut(&mut self, cracks: &[Crack<D>], tolerance: f64) -> u64 {
        let cut = self.bonds.cut(&self.body, cracks, tolerance);
        self.n_cut += cut;
        cut
    }
}

/// The fields of bodies in which something diffuses.
pub fn fields() -> impl Iterator<Item = &'static FieldInfo> {
    Diffusing::<2>::FIELDS.iter().map(|(info, _)| info)
}

type FieldOf<const D: usize> = fn(&Diffusing<D>, usize) -> f64;

impl<const D: usize> Diffusing<D> {
    const FIELDS: &'static [(FieldInfo, FieldOf<D>)] = &[
        (
            FieldInfo { name: "concentration", unit: "", about: "C, in the unit of its user", kind: Kind::Scalar },
            |body, slot| body.concentration[slot],
        ),
        (
            FieldInfo { name: "rate", unit: "1/s", about: "rate of C, sources included", kind: Kind::Scalar },
            |body, slot| body.rate[slot],
        ),
    ];
}

impl<const D: usize> Physics for Diffusing<D> {
    fn unknown(&mut self) -> Unknown<'_> {
        let (value, rate) = (&mut self.concentration[..], &mut self.rate[..]);
        Unknown {
            vectors: Numbers::Double(Vectors { value, velocity: &mut [], rate, damped: None, relative_inertia: None }),
            components: 1,
            inertia: 1.0,
            negligible: 0.0,
        }
    }

    fn evaluate(&mut self) {
        let Diffusing { body, diffusion, concentration, rate, bonds, exec, .. } = self;
        if let Some(images) = &body.cloud.images {
            images.fill_scalar(concentration);
        }
        diffusion.rate(body, bonds, exec, concentration, rate);
    }

    fn evolve(&mut self, _: f64) {
        self.evaluate();
    }

    fn stable_step(&self) -> f64 {
        self.diffusion.stable_step(&self.body)
    }

    fn field(&mut self, name: &str, points: Range<usize>) -> Option<Field> {
        let (info, value) = Self::FIELDS.iter().find(|(info, _)| info.name == name)?;
        let slots = &self.body.cloud.slots[points];
        let values = parallel::map(slots.len(), &|k| value(self, slots[k] as usize));
        Some(Field { name: info.name, unit: info.unit, values: Values::Scalar(values) })
    }

    fn points(&self) -> &dyn Points {
        &self.body
    }

    fn states(&self) -> &BondStates {
        &self.bonds
    }

    fn n_bonds(&self) -> [u64; 2] {
        [self.n_bonds, self.n_cut]
    }

    /// No motion; the amount stands in the first component.
    fn motion(&mut self) -> (f64, [f64; 3]) {
        let Diffusing { body, concentration, exec, .. } = self;
        (0.0, [super::mass(&body.cloud, exec, concentration), 0.0, 0.0])
    }

    fn content(&mut self) -> Content {
        let Diffusing { body, concentration, exec, .. } = self;
        let sizes: Vec<f64> = concentration.iter().map(|c| c.abs()).collect();
        Content { stored: 0.0, scale: super::mass(&body.cloud, exec, &sizes), angular_momentum: [0.0; 3] }
    }

    fn defect(&self, b: &Balance) -> [f64; 2] {
        [b.momentum_defect, b.momentum_scale]
    }

    /// What is there, what came in, and what of it is missing over the size of what is there.
    fn columns(&self, b: &Balance) -> Vec<Column> {
        let missing = if b.momentum_scale > 0.0 { b.momentum_defect / b.momentum_scale } else { 0.0 };
        vec![
            Column::new("amount", b.momentum[0]),
            Column::new("supplied", b.impulse[0]),
            Column::new("imbalance", missing),
        ]
    }

    fn first_bad(&mut self) -> Option<(&'static str, f64, usize)> {
        [("concentration", &self.concentration), ("rate", &self.rate)].into_iter().find_map(|(name, field)| {
            let slots = &self.body.cloud.slots;
            let bad = slots.iter().position(|&slot| !field[slot as usize].is_finite())?;
            Some((name, field[slots[bad] as usize], bad))
        })
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        visitor.doubles("concentration", &mut self.concentration);
        visitor.doubles("rate", &mut self.rate);
        visitor.words("bonds", self.bonds.vector());
    }

    fn hash(&mut self, hasher: &mut blake3::Hasher) {
        for &slot in &self.body.cloud.slots {
            hasher.update(&self.concentration[slot as usize].to_le_bytes());
        }
        hasher.update(&self.bonds.bytes());
    }

    fn memory(&self) -> usize {
        let cloud = &self.body.cloud;
        let fields = 2 * size_of_val(&self.concentration[..]) + size_of_val(&cloud.slots[..]);
        let points = match &cloud.arrangement {
            Arrangement::Lattice(_) => 0,
            Arrangement::Scattered { positions, volumes } => size_of_val(&positions[..]) + size_of_val(&volumes[..]),
        };
        let families = match &self.body.families {
            Families::Lattice(families) => size_of_val(&families.blocks[..]),
            Families::Cloud(families) => {
                let records = size_of_val(&families.sites.records[..]);
                size_of_val(&families.starts[..]) + size_of_val(&families.neighbours[..]) + records
            }
        };
        fields + points + families + size_of_val(self.bonds.words()) + self.diffusion.memory()
    }
}
