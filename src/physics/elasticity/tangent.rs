//! An elastic body at rest: forces in newtons and their tangent, in double precision whatever the fields are stored in.

use super::Elasticity;
use crate::execution::{BlockRow, Broken, Packs};
use crate::field::{Number, components, components_mut};
use crate::geometry::Images;
use crate::physics::{Points, Spring, Stretched, Tangent};
use crate::solver::linear::{BlockJacobi, Layout, LinearError, Preconditioner, Sparse, vector};

/// What preconditioning by blocks keeps of their off-diagonals: the block of a point whose bonds are all in one plane or on
/// one line is singular, and so is not.
const COUPLED: f64 = 0.999;

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// Force density × volume → force, by slot.
    fn times_volume(&self, force: &mut [f64]) {
        let cloud = &self.body.cloud;
        for component in components_mut::<D, _>(force) {
            vector::fill(component, |start, values| {
                for (k, value) in values.iter_mut().enumerate() {
                    *value *= cloud.volume(start + k);
                }
            });
        }
    }
}

/// Puts the bonds of a point to images on their sources, which move the images, and gives what is left to the point itself.
fn fold<const D: usize>(images: &Images<D>, here: usize, row: &mut BlockRow<D>) -> [[f64; D]; D] {
    let mut own = [[0.0; D]; D];
    let mut folded: BlockRow<D> = Vec::with_capacity(row.len());
    for (there, mut block) in std::mem::take(row) {
        let (source, signs) = images.source(there as usize);
        for c in 0..D {
            for d in 0..D {
                own[c][d] += block[c][d];
                block[c][d] *= signs[d];
                if source == here {
                    own[c][d] -= block[c][d];
                }
            }
        }
        if source != here {
            folded.push((source as u32, block));
        }
    }
    folded.sort_by_key(|(there, _)| *there);
    for bonds in folded.chunk_by(|a, b| a.0 == b.0) {
        let sum = |c: usize, d: usize| bonds.iter().map(|(_, block)| block[c][d]).sum();
        row.push((bonds[0].0, std::array::from_fn(|c| std::array::from_fn(|d| sum(c, d)))));
    }
    own
}

impl<const D: usize, P: Packs> Tangent for Elasticity<D, P> {
    fn components(&self) -> usize {
        D
    }

    fn points(&self) -> &dyn Points {
        &self.body
    }

    fn displacement(&mut self) -> Vec<f64> {
        self.state.displacement.iter().map(|u| u.to_f64()).collect()
    }

    fn forces(&mut self, u: &[f64], force: &mut [f64]) {
        let imaged = self.imaged(u);
        let u = imaged.as_deref().unwrap_or(u);
        let (material, mut on, state) = self.parts();
        let output = components_mut::<D, _>(&mut *force);
        material.force_in_double(&mut on, &state.states, components::<D, _>(u), output);
        self.times_volume(force);
    }

    fn is_linear(&self) -> bool {
        self.material.is_linear()
    }

    fn diagonal(&mut self) -> Vec<f64> {
        let mut diagonal = vec![0.0; D * self.body.cloud.n_slots()];
        let (material, mut on, state) = self.parts();
        material.diagonal(&mut on, &state.states, components_mut::<D, _>(&mut diagonal));
        diagonal
    }

    fn block_diagonal(&mut self, free: &dyn Fn(usize) -> bool) -> Result<Box<dyn Preconditioner>, LinearError> {
        let n = self.body.cloud.n_slots();
        let (material, mut on, state) = self.parts();
        let rows: [Vec<f64>; D] = std::array::from_fn(|row| {
            let mut sums = vec![0.0; D * n];
            material.diagonal_row(row, &mut on, &state.states, components_mut::<D, _>(&mut sums));
            sums
        });
        let cloud = &self.body.cloud;
        let entry = |slot: usize, c: usize, d: usize| {
            let [here, there] = [c, d].map(|c| free(c * n + slot) && rows[c][c * n + slot] > 0.0);
            match (here && there, c == d) {
                (true, true) => rows[c][c * n + slot] * cloud.volume(slot),
                (true, false) => COUPLED * rows[c][d * n + slot] * cloud.volume(slot),
                (false, same) => f64::from(u8::from(same)),
            }
        };
        let block = |slot| std::array::from_fn(|c| std::array::from_fn(|d| entry(slot, c, d)));
        let blocks: Vec<[[f64; D]; D]> = (0..n).map(block).collect();
        Ok(Box::new(BlockJacobi::new(&blocks, Layout::ByComponent)?))
    }

    fn assemble(&mut self, u: &[f64], free: &dyn Fn(usize) -> bool) -> Sparse {
        let (cloud, n) = (&self.body.cloud, self.body.cloud.n_slots());
        let imaged = self.imaged(u);
        let u = components::<D, _>(imaged.as_deref().unwrap_or(u));
        let mut bonds = self
            .material
            .stiffness(&self.body, &self.operator.weights, &self.state.states, u)
            .expect("checks have refused matrices of materials that have none by bonds");
        // What a point is pulled by at its own displacement: of all its bonds, less what its own images do.
        let own: Option<Vec<[[f64; D]; D]>> = cloud
            .images
            .as_ref()
            .map(|images| bonds.iter_mut().enumerate().map(|(here, row)| fold(images, here, row)).collect());
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for c in 0..D {
            for (here, bonds) in bonds.iter().enumerate() {
                if free(c * n + here) {
                    let volume = cloud.volume(here);
                    for d in 0..D {
                        // The point itself stands among its neighbours, by its slot.
                        let own = match &own {
                            Some(own) => own[here][c][d],
                            None => bonds.iter().map(|(_, block)| block[c][d]).sum::<f64>(),
                        };
                        let before = bonds.partition_point(|(there, _)| (*there as usize) < here);
                        let entry = |(there, block): &(u32, [[f64; D]; D])| (*there as usize, -block[c][d]);
                        let others = bonds[..before].iter().map(entry);
                        for (there, value) in others.chain([(here, own)]).chain(bonds[before..].iter().map(entry)) {
                            if free(d * n + there) {
                                columns.push((d * n + there) as u32);
                                values.push(volume * value);
                            }
                        }
                    }
                } else {
                    columns.push((c * n + here) as u32);
                    values.push(1.0);
                }
                starts.push(columns.len() as u64);
            }
        }
        Sparse::from_rows(starts, columns, values)
    }

    fn can_break(&self) -> bool {
        self.failure.is_some()
    }

    fn springs(&mut self) -> Option<Vec<Spring>> {
        self.all_springs()
    }

    fn stretched(&mut self, u: &[f64], v: &[f64], keep: &(dyn Fn(f64, f64, f64) -> bool + Sync)) -> Vec<Stretched> {
        self.bonds_where(u, v, keep)
    }

    fn break_bonds(&mut self, u: &[f64], bits: &[usize]) -> Broken {
        self.break_these(u, bits)
    }

    fn words(&self) -> &[u16] {
        self.state.states.words()
    }

    fn words_mut(&mut self) -> &mut [u16] {
        self.state.states.words_mut()
    }
}
