//! Bonds that break one by one about a crack, at the price of few factors.
//!
//! A bond of stretch s holds ½ w s² and pulls along the slope g of s: it is the part w g gᵀ of the tangent, and broken a change of
//! rank one. The tangent is factored with the unknowns of a zone about the crack last, so that its inverse F there is dense and
//! follows such changes exactly ([`Condensed`]). With c = F g and κ = w gᵀ c a broken bond moves the zone by c w s/(1 − κ),
//! strains the others by their slopes along it, and takes ½ w s²/(1 − κ) of energy: ½ w s² its own, the rest is lost in settling.
//!
//! Bonds outside the zone are looked at now and then: with the factor as it is, and F between its halves, the whole body is
//! brought to rest.

use super::walk::{Inverse, Walk};
use super::{Books, Kind, StaticSystem};
use crate::geometry::lattice::BLOCK;
use crate::physics::Spring;
use crate::solver::linear::{Condensed, LinearError, Sparse};
use crate::solver::newton::NotConverged;
use crate::solver::statics::{Breaking, Control, LoadStep, Together};

/// Bonds strained alike to this share break together: mirrored pairs, which rounding would split below some 1e-11.
pub(super) const TIE: f64 = 1e-7;
/// 1 − κ below which nothing but the bond holds something: it then keeps this share of its stiffness in the zone, though neither
/// in forces nor in books, so that what has come loose stays where it is.
const LOOSE: f64 = 1e-7;
const KEPT: f64 = 1e-8;
/// Horizons from the worst bond to the rim of its zone, and about the others that are to be in it.
const REACH: f64 = 4.0;
const ABOUT: f64 = 1.3;
/// Share of the worst strain from which on bonds are to be in the zone.
const NEAR: f64 = 0.6;
/// Bonds at which zones were left before: to be in the next one.
const LEADS: usize = 8;
/// Unknowns of a zone: its inverse is dense.
const LARGEST: usize = 1800;
/// Breaks between two looks at the bonds outside.
const TRUST: usize = 100;
/// By how much a bond outside has to lead.
const LEAD: f64 = 1e-9;

/// A body with its crack, kept from one load step to the next.
pub(crate) struct Crack {
    springs: Vec<Spring>,
    /// Springs that keep a little stiffness, though broken.
    soft: Vec<bool>,
    holds: Vec<bool>,
    zone: Option<Zone>,
    /// Bonds that led where a zone was left.
    led: Vec<u32>,
    /// What it was made for.
    kind: Vec<Kind>,
    words: Vec<u16>,
}

/// The factor of the tangent, and the bonds of the points whose unknowns are last in it.
struct Zone {
    condensed: Condensed,
    /// Numbers of the free unknowns in the factor, by unknown of the body.
    number: Vec<u32>,
    size: usize,
    /// Springs with both ends in the zone that hold and may break.
    bonds: Vec<u32>,
    /// By bond, the slope of s by places in the zone; places of unknowns that are held are left out.
    slopes: Vec<Slope>,
    /// s now and its change along v, of each bond.
    strain: Vec<[f64; 2]>,
    /// Whether an end sees beyond the zone.
    rim: Vec<bool>,
}

/// Up to six entries.
#[derive(Clone, Copy, Default)]
struct Slope {
    entries: [(u32, f64); 6],
    count: usize,
}

impl Slope {
    fn entries(&self) -> &[(u32, f64)] {
        &self.entries[..self.count]
    }

    fn along(&self, column: &[f64]) -> f64 {
        self.entries().iter().map(|&(place, value)| value * column[place as usize]).sum()
    }

    fn push(&mut self, place: u32, value: f64) {
        // Both ends of a bond may be one point, seen in a mirror.
        match self.entries[..self.count].iter_mut().find(|(other, _)| *other == place) {
            Some((_, sum)) => *sum += value,
            None => {
                self.entries[self.count] = (place, value);
                self.count += 1;
            }
        }
    }
}

/// The bond that breaks next: how urgently, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Next {
    pub urgency: f64,
    pub time: f64,
    pub bond: usize,
}

/// Of several bonds, the one that breaks next. `control` as of the case.
pub(super) struct Order {
    pub control: Control,
    /// s
    pub now: f64,
    /// Length of the load step, s.
    pub length: f64,
}

impl Order {
    /// How urgently a bond breaks, and when. Loads that stay: a bond beyond its critical stretch at once, the more urgently the
    /// larger their ratio; the others when the rising loads make it so. Loads that follow: where each just breaks, but for those
    /// beyond it that smaller loads do not relieve.
    pub fn of(&self, stretch: f64, rate: f64, critical: f64) -> Option<(f64, f64)> {
        let ratio = stretch / critical;
        // Not-a-number and infinite critical stretches never break.
        let wait = (critical - stretch) / rate;
        let never = !(rate > 0.0 && wait.is_finite());
        match self.control {
            Control::Load if ratio > 1.0 => Some((ratio, self.now)),
            Control::Equilibrium if ratio > 1.0 && (never || self.now + wait <= 0.0) => Some((f64::MAX, self.now)),
            _ if never || ratio.is_nan() => None,
            Control::Load => Some((1.0 - wait / self.length, self.now + wait)),
            Control::Equilibrium => Some((-(self.now + wait) / self.length, self.now + wait)),
        }
    }

    /// The first of those given by stretch, rate and critical stretch.
    pub fn first(&self, bonds: impl Iterator<Item = (usize, [f64; 2], f64)>) -> Option<Next> {
        let mut first: Option<Next> = None;
        for (bond, [stretch, rate], critical) in bonds {
            if let Some((urgency, time)) = self.of(stretch, rate, critical)
                && first.is_none_or(|first| urgency > first.urgency)
            {
                first = Some(Next { urgency, time, bond });
            }
        }
        first
    }
}

/// Whether a bond of stretch over critical stretch `ratio` breaks with the worst one.
pub(super) fn breaks_with(together: Together, tie: f64, worst: f64, ratio: f64) -> bool {
    let alike = ratio >= worst * (1.0 - tie);
    match together {
        Together::One => alike,
        Together::Share(share) => alike || (worst > 1.0 && ratio > 1.0 + share * (worst - 1.0)),
    }
}

impl Crack {
    /// Of a body whose bonds are springs; None of others.
    pub(super) fn new(rest: &mut StaticSystem<'_>) -> Option<Self> {
        let springs = rest.body.springs()?;
        let words = rest.body.words().to_vec();
        let holds = springs.iter().map(|spring| holds(&words, spring.bits[0])).collect();
        let soft = vec![false; springs.len()];
        Some(Crack { springs, soft, holds, zone: None, led: Vec::new(), kind: Vec::new(), words })
    }

    /// Whether it is that of this body with its bonds as they are; its factor is forgotten where other unknowns are free.
    pub(super) fn fits(&mut self, rest: &StaticSystem<'_>) -> bool {
        if self.kind != rest.kind {
            self.zone = None;
        }
        self.words == rest.body.words()
    }

    /// Points that have bonds, broken or not, are free where nothing holds them.
    pub(super) fn free(&self, rest: &mut StaticSystem<'_>) {
        for spring in &self.springs {
            for slot in spring.ends {
                for d in 0..rest.components {
                    let kind = &mut rest.kind[d * rest.n + slot as usize];
                    if *kind == Kind::Absent {
                        *kind = Kind::Free;
                    }
                }
            }
        }
    }

    /// Takes the body along its way to the end of the load step, and books it.
    ///
    /// # Errors
    /// No factor; no balance; an interruption, where the body is at rest at the time reached.
    #[allow(clippy::too_many_arguments)] // a body, its way, how bonds break, and who is told of it
    pub(super) fn follow(
        &mut self,
        rest: &mut StaticSystem<'_>,
        walk: &mut Walk,
        breaking: &Breaking,
        tolerance: f64,
        books: &mut Books,
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        self.kind.clone_from(&rest.kind);
        let result = self.grow(rest, walk, breaking, tolerance, books, log, observe);
        self.words = rest.body.words().to_vec();
        result
    }

    #[allow(clippy::too_many_arguments)]
    fn grow(
        &mut self,
        rest: &mut StaticSystem<'_>,
        walk: &mut Walk,
        breaking: &Breaking,
        tolerance: f64,
        books: &mut Books,
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        let goals = [tolerance.min(1e-10), tolerance];
        if self.zone.is_none() {
            // Whatever the zone: it has no bond yet.
            self.zone = Some(self.zone_about(rest, &vec![false; rest.n], &[])?);
            log.factors += 1;
        }
        let mut account = Account::default();
        self.look(rest, walk, goals, books, &mut account, true)?;
        let mut strains = self.strains(rest, walk);
        let mut outside = self.outside(&strains, breaking, walk);
        let mut since = 0;
        loop {
            let order = Order { control: breaking.control, now: walk.now, length: walk.end - walk.start };
            let zone = self.zone.as_mut().expect("made above");
            let inside = order.first(zone.bonds.iter().enumerate().filter_map(|(k, &bond)| {
                self.holds[bond as usize].then_some((k, zone.strain[k], self.springs[bond as usize].critical))
            }));
            let ends = |next: &Option<Next>| next.is_none_or(|next| next.time > walk.end);
            let leads = |a: &Option<Next>, b: &Option<Next>| match (a, b) {
                (Some(a), Some(b)) => a.urgency > b.urgency + LEAD * b.urgency.abs().min(1e300),
                (a, _) => a.is_some(),
            };
            // Bonds outside are known as they were at the last look.
            let known = outside.and_then(|next: Next| {
                let bond = &self.springs[next.bond];
                let [s, rate] = strains[next.bond];
                order.first(std::iter::once((next.bond, [s + (walk.now - walk.placed) * rate, rate], bond.critical)))
            });
            if since > TRUST || since > 0 && (ends(&inside) || leads(&known, &inside)) {
                self.look(rest, walk, goals, books, &mut account, false)?;
                strains = self.strains(rest, walk);
                outside = self.outside(&strains, breaking, walk);
                since = 0;
                continue;
            }
            if ends(&inside) && ends(&outside) {
                break;
            }
            if leads(&outside, &inside)
                && let Some(next) = outside
            {
                if !observe(log.breaks, walk.imbalance) {
                    return Err(NotConverged::Interrupted);
                }
                self.enclose(rest, walk, breaking, &strains, next.bond, log)?;
                self.look(rest, walk, goals, books, &mut account, false)?;
                strains = self.strains(rest, walk);
                outside = self.outside(&strains, breaking, walk);
                continue;
            }
            let next = inside.expect("a bond inside does not come after the end");
            if !observe(log.breaks, walk.imbalance) {
                if since > 0 {
                    self.look(rest, walk, goals, books, &mut account, false)?;
                }
                return Err(NotConverged::Interrupted);
            }
            since = if self.break_next(rest, walk, breaking, next, books, &mut account, log) {
                TRUST + 1
            } else {
                since + 1
            };
            // The strains are kept as they are at the time of the walk, which the look at the rest of the body moves.
            walk.now = next.time;
        }
        account.go(walk.end - walk.now);
        let end = walk.end;
        walk.go(rest, end);
        // Linear forces are in balance all along the way.
        if !rest.body.is_linear() {
            self.look(rest, walk, goals, books, &mut account, false)?;
        } else {
            account.close(rest, books);
        }
        log.iterations += std::mem::take(&mut walk.corrections);
        log.imbalance = walk.imbalance;
        Ok(())
    }

    /// Brings the body to rest at the time of the walk, and books what has happened since the last look.
    fn look(
        &mut self,
        rest: &mut StaticSystem<'_>,
        walk: &mut Walk,
        goals: [f64; 2],
        books: &mut Books,
        account: &mut Account,
        first: bool,
    ) -> Result<(), NotConverged> {
        let zone = self.zone.as_ref().expect("there is a factor");
        let before = first.then(|| rest.resting());
        let now = walk.now;
        walk.go(rest, now);
        walk.look(rest, &mut ByZone(zone), goals, &mut |_, _| true)?;
        if let Some(before) = before {
            // What was out of balance when the load step began.
            let state = rest.resting();
            let work = rest.work(&before, &state);
            books.work.external += work.external;
            books.work.lost += work.lost;
            account.open(rest, walk);
        } else {
            account.close(rest, books);
            account.open(rest, walk);
        }
        walk.keep(rest, books);
        let zone = self.zone.as_mut().expect("there is a factor");
        for (strain, &bond) in zone.strain.iter_mut().zip(&zone.bonds) {
            let flats = [&rest.displacement[..], &walk.velocity[..]];
            *strain = self.springs[bond as usize].stretch(rest.body.is_linear(), rest.components, rest.n, flats);
        }
        Ok(())
    }

    /// s of each spring now and its change along v; zero where it is broken.
    fn strains(&self, rest: &StaticSystem<'_>, walk: &Walk) -> Vec<[f64; 2]> {
        let (is_linear, dimension, n) = (rest.body.is_linear(), rest.components, rest.n);
        let flats = [&rest.displacement[..], &walk.velocity[..]];
        let of = |(spring, holds): (&Spring, &bool)| {
            if *holds { spring.stretch(is_linear, dimension, n, flats) } else { [0.0; 2] }
        };
        self.springs.iter().zip(&self.holds).map(of).collect()
    }

    /// The bond outside the zone that breaks next.
    fn outside(&self, strains: &[[f64; 2]], breaking: &Breaking, walk: &Walk) -> Option<Next> {
        let mut inside = vec![false; self.springs.len()];
        self.zone.iter().flat_map(|zone| &zone.bonds).for_each(|&bond| inside[bond as usize] = true);
        let order = Order { control: breaking.control, now: walk.now, length: walk.end - walk.start };
        order.first(
            (0..self.springs.len())
                .filter(|&k| self.holds[k] && !inside[k])
                .map(|k| (k, strains[k], self.springs[k].critical)),
        )
    }

    /// Breaks the next bond of the zone and those strained alike, at its time. Whether one was at the rim of the zone.
    #[allow(clippy::too_many_arguments)]
    fn break_next(
        &mut self,
        rest: &mut StaticSystem<'_>,
        walk: &Walk,
        breaking: &Breaking,
        next: Next,
        books: &mut Books,
        account: &mut Account,
        log: &mut LoadStep,
    ) -> bool {
        let Crack { springs, soft, holds, zone, .. } = self;
        let zone = zone.as_mut().expect("the bond is one of a zone");
        let on = next.time - walk.now;
        account.go(on);
        for strain in &mut zone.strain {
            strain[0] += on * strain[1];
        }
        let ratio = |zone: &Zone, k: usize| zone.strain[k][0] / springs[zone.bonds[k] as usize].critical;
        let worst = ratio(zone, next.bond);
        let group: Vec<usize> = (0..zone.bonds.len())
            .filter(|&k| holds[zone.bonds[k] as usize] && breaks_with(breaking.together, TIE, worst, ratio(zone, k)))
            .collect();
        log.note([next.time, account.power, 0.5 * books.broken.bonds as f64]);
        // What each held before any of them broke is its own.
        let own = |&k: &usize| 0.5 * springs[zone.bonds[k] as usize].weight * zone.strain[k][0].powi(2);
        let own = group.iter().map(own).sum::<f64>();
        let (mut gone, mut rim) = (0.0, false);
        for &k in &group {
            let bond = zone.bonds[k] as usize;
            let mut weight = springs[bond].weight;
            let column = zone.condensed.column(zone.slopes[k].entries());
            let along = zone.slopes[k].along(&column);
            if 1.0 - weight * along < LOOSE {
                weight *= 1.0 - KEPT;
                soft[bond] = true;
            }
            let left = 1.0 - weight * along;
            let [s, rate] = zone.strain[k];
            gone += 0.5 * weight * s * s / left;
            account.power -= weight * s * rate / left;
            account.slope -= weight * rate * rate / left;
            let moved = [weight * s / left, weight * rate / left];
            for (strain, slope) in zone.strain.iter_mut().zip(&zone.slopes) {
                let along = slope.along(&column);
                strain[0] += moved[0] * along;
                strain[1] += moved[1] * along;
            }
            zone.condensed.change(weight / left, column);
            holds[bond] = false;
            rim |= zone.rim[k];
            let [here, there] = springs[bond].bits;
            let words = rest.body.words_mut();
            for bit in [here, there] {
                words[bit / BLOCK] &= !(1 << (bit % BLOCK));
            }
            books.broken.bonds += if here == there { 1 } else { 2 };
        }
        books.broken.energy += own;
        account.gone += gone;
        account.own += own;
        rim
    }

    /// A new zone about the bond that leads.
    fn enclose(
        &mut self,
        rest: &StaticSystem<'_>,
        walk: &Walk,
        breaking: &Breaking,
        strains: &[[f64; 2]],
        lead: usize,
        log: &mut LoadStep,
    ) -> Result<(), NotConverged> {
        let horizon = rest.body.points().horizon();
        let ratio = |k: usize| {
            let [s, rate] = strains[k];
            // Of bonds that wait for larger loads, how fast they come is what counts.
            let ahead = match breaking.control {
                Control::Load if s > self.springs[k].critical => s,
                _ if walk.proportional => walk.end * rate,
                _ => s + (walk.end - walk.now) * rate,
            };
            ahead / self.springs[k].critical
        };
        let worst = ratio(lead);
        let mut near: Vec<(f64, usize)> = (0..self.springs.len())
            .filter(|&k| self.holds[k])
            .map(|k| (ratio(k), k))
            .filter(|(q, _)| *q >= NEAR * worst && *q > 0.0)
            .collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let points = rest.body.points();
        let middle = |k: usize| {
            let (x, xi) = (points.position(self.springs[k].ends[0] as usize), self.springs[k].xi);
            [x[0] + 0.5 * xi[0], x[1] + 0.5 * xi[1], x[2] + 0.5 * xi[2]]
        };
        let within = |centre: [f64; 3], radius: f64| {
            let slots = points.slots().iter().map(|&slot| slot as usize);
            slots.filter(move |&slot| {
                let x = points.position(slot);
                (0..3).map(|d| (x[d] - centre[d]).powi(2)).sum::<f64>() <= radius * radius
            })
        };
        let mut inside = vec![false; rest.n];
        let (mut count, mut reach) = (0, REACH * horizon);
        // Of many bonds a horizon, as in 3D, the zone is smaller.
        while within(middle(lead), reach).count() * rest.components > LARGEST {
            reach *= 0.9;
        }
        let mut add = |slots: &[usize], inside: &mut Vec<bool>| {
            for &slot in slots {
                count += usize::from(!inside[slot]);
                inside[slot] = true;
            }
            count
        };
        let first: Vec<usize> = within(middle(lead), reach).collect();
        let mut size = add(&first, &mut inside);
        let before = self.led.iter().rev().take(LEADS).map(|&bond| bond as usize).filter(|&bond| self.holds[bond]);
        for bond in before.chain(near.iter().map(|(_, bond)| *bond)) {
            if self.springs[bond].ends.iter().all(|&slot| inside[slot as usize]) {
                continue;
            }
            let more: Vec<usize> = within(middle(bond), ABOUT * horizon).collect();
            if (size + more.len()) * rest.components > LARGEST {
                break;
            }
            size = add(&more, &mut inside);
        }
        self.led.push(lead as u32);
        self.zone = Some(self.zone_about(rest, &inside, strains)?);
        log.factors += 1;
        Ok(())
    }

    /// The factor of the tangent now, with the unknowns of the points `inside` last.
    fn zone_about(
        &mut self,
        rest: &StaticSystem<'_>,
        inside: &[bool],
        strains: &[[f64; 2]],
    ) -> Result<Zone, LinearError> {
        self.zone = None;
        let (n, dimension, is_linear) = (rest.n, rest.components, rest.body.is_linear());
        let free: Vec<usize> = (0..rest.kind.len()).filter(|&k| rest.kind[k] == Kind::Free).collect();
        let mut number = vec![u32::MAX; rest.kind.len()];
        free.iter().enumerate().for_each(|(k, &unknown)| number[unknown] = k as u32);
        let last: Vec<u32> = (0..free.len() as u32).filter(|&k| inside[free[k as usize] % n]).collect();
        let pattern = Pattern::new(&self.springs, rest, &number, free.len());
        let made = Condensed::new(&pattern.matrix(self, rest, &number), &last);
        let condensed = match made {
            Ok(condensed) => condensed,
            Err(_) => {
                // Parts that have come loose before, or by a pre-crack: broken bonds keep a little stiffness.
                self.soft.iter_mut().zip(&self.holds).for_each(|(soft, holds)| *soft = !holds);
                Condensed::new(&pattern.matrix(self, rest, &number), &last)?
            }
        };
        let mut place = vec![u32::MAX; free.len()];
        last.iter().enumerate().for_each(|(k, &unknown)| place[unknown as usize] = k as u32);
        let ends = |spring: &Spring| spring.ends.map(|slot| inside[slot as usize]);
        let mut edge = vec![false; n];
        for spring in &self.springs {
            let [here, there] = ends(spring);
            if here != there {
                spring.ends.iter().for_each(|&slot| edge[slot as usize] = true);
            }
        }
        let bonds: Vec<u32> = (0..self.springs.len())
            .filter(|&k| self.holds[k] && self.springs[k].critical.is_finite() && ends(&self.springs[k]) == [true; 2])
            .map(|k| k as u32)
            .collect();
        let slope = |&bond: &u32| {
            let spring = &self.springs[bond as usize];
            let (g, _) = spring.slope(is_linear, dimension, n, &rest.displacement);
            let mut slope = Slope::default();
            for d in 0..dimension {
                for (slot, value) in [(spring.ends[0], -g[d]), (spring.ends[1], spring.signs[d] * g[d])] {
                    let unknown = number[d * n + slot as usize];
                    if unknown != u32::MAX {
                        slope.push(place[unknown as usize], value);
                    }
                }
            }
            slope
        };
        let slopes = bonds.iter().map(slope).collect();
        let strain = bonds.iter().map(|&bond| strains[bond as usize]).collect();
        let rim = bonds.iter().map(|&bond| self.springs[bond as usize].ends.iter().any(|&slot| edge[slot as usize]));
        let rim = rim.collect();
        Ok(Zone { condensed, number, size: free.len(), bonds, slopes, strain, rim })
    }
}

/// Rows and columns of the tangent, right of the diagonal and on it, of all bonds of the families.
struct Pattern {
    starts: Vec<u64>,
    columns: Vec<u32>,
}

impl Pattern {
    fn new(springs: &[Spring], rest: &StaticSystem<'_>, number: &[u32], size: usize) -> Self {
        // Points by the points that they have bonds to.
        let mut others: Vec<Vec<u32>> = (0..rest.n as u32).map(|slot| vec![slot]).collect();
        for Spring { ends: [a, b], .. } in springs {
            others[*a as usize].push(*b);
            others[*b as usize].push(*a);
        }
        others.iter_mut().for_each(|list| {
            list.sort_unstable();
            list.dedup();
        });
        let (mut starts, mut columns) = (vec![0], Vec::new());
        let mut rows: Vec<(u32, usize)> =
            (0..number.len()).filter_map(|k| (number[k] != u32::MAX).then_some((number[k], k))).collect();
        rows.sort_unstable();
        for (row, unknown) in rows {
            let list = &others[unknown % rest.n];
            for d in 0..rest.components {
                let columns_of = list.iter().map(|&slot| number[d * rest.n + slot as usize]);
                columns.extend(columns_of.filter(|&column| column != u32::MAX && column >= row));
            }
            starts.push(columns.len() as u64);
        }
        debug_assert_eq!(starts.len(), size + 1);
        Pattern { starts, columns }
    }

    fn matrix(&self, crack: &Crack, rest: &StaticSystem<'_>, number: &[u32]) -> Sparse {
        let (n, dimension, is_linear) = (rest.n, rest.components, rest.body.is_linear());
        let mut values = vec![0.0; self.columns.len()];
        for (k, spring) in crack.springs.iter().enumerate() {
            let share = match (crack.holds[k], crack.soft[k]) {
                (true, _) => 1.0,
                (false, true) => KEPT,
                (false, false) => continue,
            };
            let (g, across) = spring.slope(is_linear, dimension, n, &rest.displacement);
            let (square, weight) = (g.iter().map(|g| g * g).sum::<f64>(), share * spring.weight);
            // w g gᵀ along the bond, and what turns its force across it.
            let block = |c: usize, d: usize| {
                let same = f64::from(u8::from(c == d));
                weight * g[c] * g[d] + share * across * (same - g[c] * g[d] / square)
            };
            let ends = [(spring.ends[0], [-1.0; 3]), (spring.ends[1], spring.signs)];
            for (a, signs_a) in ends {
                for c in 0..dimension {
                    let row = number[c * n + a as usize];
                    if row == u32::MAX {
                        continue;
                    }
                    let range = self.starts[row as usize] as usize..self.starts[row as usize + 1] as usize;
                    let columns = &self.columns[range.clone()];
                    for (b, signs_b) in ends {
                        for d in 0..dimension {
                            let column = number[d * n + b as usize];
                            if column != u32::MAX && column >= row {
                                let at = columns.binary_search(&column).expect("the pattern has all bonds");
                                values[range.start + at] += signs_a[c] * signs_b[d] * block(c, d);
                            }
                        }
                    }
                }
            }
        }
        Sparse::from_rows(self.starts.clone(), self.columns.clone(), values)
    }
}

/// Solves by the factor of a zone.
struct ByZone<'a>(&'a Zone);

impl Inverse for ByZone<'_> {
    fn apply(
        &mut self,
        _: &mut StaticSystem<'_>,
        r: &mut [f64],
        _: f64,
        _: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        let mut b = vec![0.0; self.0.size];
        let at = |unknown: usize| self.0.number[unknown];
        for (k, r) in r.iter().enumerate().filter(|(k, _)| at(*k) != u32::MAX) {
            b[at(k) as usize] = *r;
        }
        self.0.condensed.solve(&mut b);
        for (k, r) in r.iter_mut().enumerate() {
            *r = if at(k) == u32::MAX { 0.0 } else { b[at(k) as usize] };
        }
        Ok(())
    }
}

/// Energies between two looks, from what is known of the zone alone.
///
/// With Q(t) = strain energy − loads · u of the body at rest, dQ/dt is the power of prescribed displacements less that which the
/// loads would have if they changed where the body stands; it is linear in t, and falls with each bond that breaks, as Q does. So
/// the work from outside is the sum of the changes of Q along the way, and the change of loads · u.
#[derive(Default)]
struct Account {
    /// dQ/dt, J/s, and how it changes, J/s².
    power: f64,
    slope: f64,
    /// Loads · u at the last look, J.
    held: f64,
    /// ∫ dQ since the last look, J.
    work: f64,
    /// Energy that broken bonds have set free since then, and the part that was their own, J.
    gone: f64,
    own: f64,
}

impl Account {
    /// Begins at a look.
    fn open(&mut self, rest: &mut StaticSystem<'_>, walk: &Walk) {
        let [power, slope] = walk.power(rest);
        *self = Account { power, slope, held: loads(rest), ..Account::default() };
    }

    /// Goes on for a time, s.
    fn go(&mut self, dt: f64) {
        self.work += dt * (self.power + 0.5 * dt * self.slope);
        self.power += dt * self.slope;
    }

    /// Books it; the body is at rest.
    fn close(&mut self, rest: &StaticSystem<'_>, books: &mut Books) {
        books.work.external += self.work + loads(rest) - self.held;
        books.work.lost += self.gone - self.own;
    }
}

/// Whether the bond with the state `bit` holds.
fn holds(words: &[u16], bit: usize) -> bool {
    words[bit / BLOCK] >> (bit % BLOCK) & 1 == 1
}

/// Loads on free unknowns times their displacements, J.
fn loads(rest: &StaticSystem<'_>) -> f64 {
    let free = rest.kind.iter().zip(&rest.load).zip(&rest.displacement).filter(|((kind, _), _)| **kind == Kind::Free);
    free.map(|((_, load), u)| load * u).sum()
}
