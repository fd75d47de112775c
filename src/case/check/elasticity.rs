//! Rules of bond laws and of their failure.

use std::collections::BTreeSet;

use super::super::model::{
    Case, CriticalStretch, FailurePair, Law, LinearSolver, Plane, Preconditioner, Scheme, Solver, SurfaceCorrection,
};
use super::Checker;

impl Checker<'_> {
    /// `elsewhere`: the values are those of materials.
    pub(super) fn law(&mut self, kind: &Law, dimension: usize, path: &str, elsewhere: bool) {
        let law = kind.parameters();
        for (key, unit, given) in [("young", "Pa", law.young), ("density", "kg/m^3", law.density)] {
            if given.is_none() && law.material.is_none() && !elsewhere {
                let message = format!("missing key `{key}`");
                let help =
                    format!("add `{key} = <number, {unit}>`, or take both from the library: `material = \"PMMA\"`");
                self.error(path, message, &help);
            } else if given.is_some() && elsewhere {
                let message = format!("each of the materials has its own `{key}`");
                self.error(&format!("{path}.{key}"), message, "give it in `[materials.<name>]`");
            }
        }
        if law.material.is_some() && elsewhere {
            let message = "the materials of this body are named in `physics.elasticity.materials`";
            self.error(&format!("{path}.material"), message, "give it in `[materials.<name>]`");
        }
        if law.plane.is_some() && dimension != 2 {
            self.error(
                &format!("{path}.plane"),
                format!("`plane` is for 2D, and this case is {dimension}D"),
                "remove it",
            );
        }
        if kind.of().is_state_based() {
            // That of several materials is asked for one by one.
            if !elsewhere {
                let library = law.material.filter(|_| dimension > 1).map(|material| material.values().poisson);
                self.poisson(law.poisson.or(library), law.plane, dimension, path);
            }
            return;
        }
        self.fixed_poisson(law.poisson, law.plane, dimension, path);
    }

    /// Poisson's ratio of a bond-based law, which a case may say but not choose.
    pub(super) fn fixed_poisson(&mut self, poisson: Option<f64>, plane: Option<Plane>, dimension: usize, path: &str) {
        let Some(poisson) = poisson else { return };
        let (fixed, name, why) = match (dimension, plane) {
            (1, _) => (None, "", "in 1D there is no Poisson ratio"),
            (2, Some(Plane::Strain)) => (Some(1.0 / 4.0), "1/4", "in plane strain"),
            (2, _) => (Some(1.0 / 3.0), "1/3", "in plane stress"),
            _ => (Some(1.0 / 4.0), "1/4", "in 3D"),
        };
        // 1e-3 lets 0.333 stand for 1/3.
        if fixed.is_none_or(|fixed| (poisson - fixed).abs() > 1e-3) {
            let message = match fixed {
                Some(_) => format!("the bond-based law fixes the Poisson ratio at {name} {why}"),
                None => why.to_owned(),
            };
            self.error(&format!("{path}.poisson"), message, "remove the key, or give that value");
        }
    }

    /// Poisson's ratio of a state-based law: positive moduli, and none in 1D.
    pub(super) fn poisson(&mut self, poisson: Option<f64>, plane: Option<Plane>, dimension: usize, path: &str) {
        let (most, name, place) = match (dimension, plane) {
            (1, _) => {
                if poisson.is_some() {
                    self.error(&format!("{path}.poisson"), "in 1D there is no Poisson ratio", "remove the key");
                }
                return;
            }
            (2, Some(Plane::Strain)) => (0.5, "1/2", "in plane strain"),
            (2, _) => (1.0, "1", "in plane stress"),
            _ => (0.5, "1/2", "in 3D"),
        };
        match poisson {
            Some(poisson) if poisson > -1.0 && poisson < most => {}
            Some(_) => {
                let message = format!(
                    "the state-based law needs a Poisson ratio above -1 and below {name} {place}, where the moduli are \
                     positive and finite"
                );
                let help = if most < 1.0 { "for a nearly incompressible body: 0.49 or less" } else { "" };
                self.error(&format!("{path}.poisson"), message, help);
            }
            None => {
                let message = format!("missing key `poisson`: the state-based law has no ratio of its own {place}");
                self.error(path, message, "add `poisson = <number>`, such as `poisson = 0.3`");
            }
        }
    }

    /// What state-based laws cannot do.
    pub(super) fn state_based(&mut self, case: &Case) {
        let bonds = "use a bond-based law, or remove it";
        if case.discretization.surface_correction != SurfaceCorrection::None {
            let message = "the state-based law has no surface correction: each family has a weighted volume of its own";
            self.error("discretization.surface_correction", message, bonds);
        }
        if case.refinement.is_some() {
            self.error("refinement", "the state-based law needs cells of one size", bonds);
        }
        if let Scheme::Hybrid(hybrid) = &case.discretization.scheme {
            if hybrid.buffer < 2 {
                let message = "rows of the state-based law feel what points at two horizons do, in two passes";
                self.error("discretization.scheme.hybrid.buffer", message, "use 2 or more");
            }
            if hybrid.rescale {
                let message =
                    "the state-based law measures each family by its own weighted volume: nothing is left to rescale";
                self.error("discretization.scheme.hybrid.rescale", message, "remove it");
            }
        }
        for (path, solver) in case.solver.stages() {
            let (linear, preconditioner) = match solver {
                Solver::Static(s) | Solver::Newton(s) => (Some(s.linear), s.preconditioner),
                Solver::QuasiStatic(s) => (s.linear, s.preconditioner),
                _ => continue,
            };
            let of_a_matrix = "needs the tangent bond by bond, and in the state-based law points feel two horizons";
            if linear == Some(LinearSolver::Direct) {
                let help = "use `conjugate_gradients`, or a bond-based law";
                self.error(&format!("{path}.linear"), format!("`direct` {of_a_matrix}"), help);
            }
            if let Some(Preconditioner::BlockJacobi | Preconditioner::IncompleteFactors) = preconditioner {
                let message = format!("this preconditioner {of_a_matrix}");
                self.error(&format!("{path}.preconditioner"), message, "use `jacobi` or `none`, or a bond-based law");
            }
        }
    }

    pub(super) fn failure<'a>(
        &mut self,
        failure: &'a CriticalStretch,
        case: &'a Case,
        imported: bool,
        used: &mut BTreeSet<&'a str>,
    ) {
        let path = "physics.elasticity.failure.critical_stretch";
        // Materials may have their own.
        let own = case.physics.elasticity.as_ref().is_some_and(|elasticity| {
            let library = elasticity.law.parameters().material.map(|material| material.values());
            !elasticity.materials.is_empty() || library.is_some_and(|values| values.fracture_energy.is_some())
        });
        if !own || failure.fracture_energy.is_some() && failure.stretch.is_some() {
            self.either(
                path,
                ("fracture_energy", failure.fracture_energy.is_some()),
                ("stretch", failure.stretch.is_some()),
                "fracture_energy = \"3.8 J/m^2\"",
            );
        }
        for (k, name) in failure.no_fail.iter().enumerate() {
            self.set_name(name, case, imported, &format!("{path}.no_fail[{k}]"), used);
        }
        for (k, FailurePair { between, fracture_energy, stretch }) in failure.pairs.iter().enumerate() {
            let path = format!("{path}.pairs[{k}]");
            self.either(
                &path,
                ("fracture_energy", fracture_energy.is_some()),
                ("stretch", stretch.is_some()),
                "stretch = 0.01",
            );
            for (i, name) in between.iter().enumerate() {
                self.set_name(name, case, imported, &format!("{path}.between[{i}]"), used);
            }
        }
    }
}
