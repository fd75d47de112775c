//! What is handed to writers: fields of one instant, copied on the stepping thread, each computed once however many
//! want it. Deliberately not here: any decision when something is due, and any file.

use std::sync::Arc;

use super::source::{Points, Source};
use crate::field::{Field, difference, norm};
use crate::geometry::{TIE, tie};
use crate::physics::{ForceAndMoment, Resultant};
use crate::solver::Clock;

/// The fields that a writer wants to be handed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldRequest {
    pub fields: Vec<&'static str>,
    /// At the point nearest to this place (m) only; everywhere if None.
    pub at: Option<[f64; 3]>,
    /// That point.
    point: Option<usize>,
    /// A force on a part of the body.
    resultant: Option<Resultant>,
}

impl FieldRequest {
    /// These fields at all points.
    pub fn everywhere(fields: Vec<&'static str>) -> Self {
        FieldRequest { fields, ..FieldRequest::default() }
    }

    /// These fields at the point nearest to a place, m.
    pub fn at(fields: Vec<&'static str>, at: [f64; 3]) -> Self {
        FieldRequest { fields, at: Some(at), ..FieldRequest::default() }
    }

    /// No field, but a force on a part of the body.
    pub fn resultant(of: Resultant) -> Self {
        FieldRequest { resultant: Some(of), ..FieldRequest::default() }
    }

    /// Finds the place among the points of a body: the nearest, by the rule of [ties](tie::nearest).
    pub fn find(&mut self, points: &Points) {
        self.point = self.at.and_then(|at| {
            let all = points.positions.iter().enumerate().map(|(k, x)| (k, norm(&difference(x, &at)), *x));
            let (nearest, ..) = all.clone().min_by(|a, b| a.1.total_cmp(&b.1))?;
            let side = points.sizes.get(nearest).copied().unwrap_or(points.facts.spacing);
            tie::nearest(all, TIE * side)
        });
    }

    /// The place that is wanted (m), and the point that stands for it.
    pub fn found(&self) -> Option<([f64; 3], usize)> {
        self.at.zip(self.point)
    }
}

/// What one writer sees of one instant.
#[derive(Debug, Clone)]
pub struct Snapshot {
    pub clock: Clock,
    pub points: Arc<Points>,
    /// Those that the writer wants and the model has, in the writer's order.
    pub fields: Vec<Arc<Field>>,
    /// The force that the writer wants, if any.
    pub resultant: Option<ForceAndMoment>,
}

impl Snapshot {
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().map(Arc::as_ref).find(|field| field.name == name)
    }

    /// How many numbers it holds.
    pub fn numbers(&self) -> usize {
        self.fields.iter().map(|field| field.values.numbers()).sum()
    }
}

/// A look at a model at one instant, while it stands still.
pub struct FieldCache<'a> {
    pub source: &'a mut dyn Source,
    clock: Clock,
    /// Fields that somebody has asked for.
    known: Vec<Arc<Field>>,
}

impl<'a> FieldCache<'a> {
    pub fn new(source: &'a mut dyn Source, clock: Clock) -> Self {
        FieldCache { source, clock, known: Vec::new() }
    }

    /// A field by name; None if the model has no such field.
    pub fn field(&mut self, name: &str) -> Option<Arc<Field>> {
        if let Some(known) = self.known.iter().find(|field| field.name == name) {
            return Some(known.clone());
        }
        let field = Arc::new(self.source.field(name)?);
        self.known.push(field.clone());
        Some(field)
    }

    /// What a writer wants of this instant.
    pub fn snapshot(&mut self, wants: &FieldRequest) -> Snapshot {
        let fields = match (wants.at, wants.point) {
            (None, _) => wants.fields.iter().filter_map(|name| self.field(name)).collect(),
            (_, None) => Vec::new(),
            (_, Some(point)) => wants.fields.iter().filter_map(|name| self.field_at(name, point)).collect(),
        };
        let resultant = wants.resultant.as_ref().and_then(|of| self.source.resultant(of));
        Snapshot { clock: self.clock, points: self.source.points().clone(), fields, resultant }
    }

    fn field_at(&mut self, name: &str, point: usize) -> Option<Arc<Field>> {
        let known = self.known.iter().find(|field| field.name == name);
        known.map(|field| field.at(point)).or_else(|| self.source.field_at(name, point)).map(Arc::new)
    }
}
