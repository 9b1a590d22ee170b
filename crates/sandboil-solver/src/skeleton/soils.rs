//! Soil models at the stress nodes, region by region: which model runs where is decided once per stage.

use crate::{
    error::SolverError,
    parallel::{Rows, chunks, for_each_chunk},
    section::{description::Model, stress_layout::StressLayout},
    skeleton::{
        point::StressPoint,
        shared_volume::SharedStrain,
        strain_and_force::{NodalShare, motion},
    },
    weights::geometry::Geometry,
};
use sandboil_soil::{
    Integrator, Moduli, Soil, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport, elastic::Elastic,
    with_model,
};
use sandboil_sph::Vec2;
use serde::{Serialize, Serializer, ser::Error as _};
use std::{fmt::Debug, ops::Range};

/// One region's stress nodes under one model.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Group {
    region: usize,
    rows: Range<usize>,
    law: Law,
}

#[derive(Debug, serde::Deserialize)]
#[serde(try_from = "StoredLaw")]
enum Law {
    /// Linear elasticity: its only state is the stress, which the stress nodes hold.
    Elastic(Elastic),
    /// A model with a state, and the soil from which it was made.
    Plastic(Soil, Box<dyn Plastic>),
}

/// A [`Law`] as it is stored: the states of a plastic model as bytes.
#[derive(serde::Serialize, serde::Deserialize)]
enum StoredLaw {
    Elastic(Elastic),
    Plastic(Soil, Vec<u8>),
}

impl Serialize for Law {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Elastic(law) => StoredLaw::Elastic(*law),
            Self::Plastic(soil, rows) => {
                StoredLaw::Plastic(soil.clone(), rows.states().map_err(S::Error::custom)?)
            }
        }
        .serialize(serializer)
    }
}

impl TryFrom<StoredLaw> for Law {
    type Error = postcard::Error;

    fn try_from(stored: StoredLaw) -> postcard::Result<Self> {
        match stored {
            StoredLaw::Elastic(law) => Ok(Self::Elastic(law)),
            StoredLaw::Plastic(soil, states) => {
                let rows = with_model!(&soil, law => restored_rows(law, &states)?);
                Ok(Self::Plastic(soil, rows))
            }
        }
    }
}

/// Work of the effective stress in the strain of a step, kJ/m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressWork {
    /// With the mean of the stresses before and after it.
    pub mean: f64,
    /// With the stress after it; zero if it is not requested.
    pub after: f64,
}

impl StressWork {
    /// Adds the work at a stress node that has been strained from the stress `before`.
    #[inline]
    fn add(&mut self, before: &Stress, point: &StressPoint, increment: &StrainIncrement, with_after: bool) {
        let StrainIncrement { xx, yy, xy, .. } = increment;
        // The volume at mid-step. That at either end would cause an energy error of first order in the strain
        // of the step.
        let volume = point.volume * point.deformation.volume_ratio() * (1.0 - 0.5 * (xx + yy));
        let after = &point.stress;
        let twice = (before.xx + after.xx) * xx + (before.yy + after.yy) * yy + (before.xy + after.xy) * xy;
        self.mean += 0.5 * volume * twice;
        if with_after {
            self.after += volume * (after.xx * xx + after.yy * yy + after.xy * xy);
        }
    }

    fn merge(&mut self, other: &Self) {
        self.mean += other.mean;
        self.after += other.after;
    }
}

/// Outcome of one chunk of updates.
#[derive(Debug, Clone, Default)]
struct Outcome {
    report: UpdateReport,
    work: StressWork,
    failure: Option<(usize, SoilError)>,
}

/// The soil models of a stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct SoilField {
    groups: Vec<Group>,
    /// Stress nodes whose soil could not carry their initial stress.
    inadmissible_starts: u64,
    /// Outcomes of the chunks of the longest group in a step; empty in a restored field before its first
    /// step.
    #[serde(skip)]
    outcomes: Vec<Outcome>,
    /// Largest strain component of one step.
    largest_strain: f64,
}

/// Input of a step of the soil.
#[derive(Clone, Copy)]
pub struct StrainStep<'a> {
    /// Stress points.
    pub layout: &'a StressLayout,
    /// Weights.
    pub geometry: &'a Geometry,
    /// Volume strains that groups of points share.
    pub shared: Option<&'a SharedStrain>,
    /// Velocities at mid-step, m/s.
    pub velocity: &'a [Vec2],
    /// Strength `xi / dx` of the velocity filter, 1/m.
    pub filter: f64,
    /// Time step, s.
    pub dt: f64,
    /// Integrator of the sand model.
    pub integrator: &'a Integrator,
    /// Whether the work of the stress after the step is needed too.
    pub with_after: bool,
}

/// Stress nodes and their shares in the nodal forces, in the same order.
pub struct StressRows<'a> {
    /// Stress nodes.
    pub points: &'a mut [StressPoint],
    /// Their shares.
    pub shares: &'a mut [NodalShare],
}

/// Rows of stress nodes under any model with a state. There is one dynamic call for each group and step.
trait Plastic: Debug + Send + Sync {
    fn step(
        &mut self,
        threaded: bool,
        step: &StrainStep,
        largest_strain: f64,
        first_row: usize,
        rows: StressRows,
        outcomes: &mut [Outcome],
    );
    fn void_ratio(&self, row: usize) -> Option<f64>;
    fn points(&self) -> usize;
    fn state_bytes(&self) -> usize;
    /// The states in their stored form.
    fn states(&self) -> postcard::Result<Vec<u8>>;
}

#[derive(Debug)]
struct PlasticRows<M: SoilModel> {
    model: M,
    states: Vec<M::State>,
}

impl<M: SoilModel> Plastic for PlasticRows<M> {
    fn step(
        &mut self,
        threaded: bool,
        step: &StrainStep,
        largest_strain: f64,
        first_row: usize,
        rows: StressRows,
        outcomes: &mut [Outcome],
    ) {
        let model = &self.model;
        let StrainStep { shared, geometry, velocity, filter, dt, integrator, with_after, .. } = *step;
        let rows = Rows { a: rows.points, b: rows.shares, c: &mut self.states };
        for_each_chunk(threaded, rows, outcomes, |first, rows, outcome| {
            *outcome = Outcome::default();
            for k in 0..rows.a.len() {
                let (point, state) = (&mut rows.a[k], &mut rows.c[k]);
                let s = first_row + first + k;
                let motion = motion(geometry, s, velocity);
                let increment = shared_increment(shared, s, motion.advance(&mut point.deformation, dt));
                match check_size(&increment, largest_strain)
                    .and_then(|()| model.update(state, &increment, integrator))
                {
                    Ok(report) => outcome.report.merge(&report),
                    Err(error) => {
                        outcome.failure = Some((s, error));
                        return;
                    }
                }
                let before = std::mem::replace(&mut point.stress, model.stress(state));
                outcome.work.add(&before, point, &increment, with_after);
                set_moduli(point, model.moduli(state));
                add_strain(point, &increment);
                rows.b[k] = motion.share(point, geometry.covariance[s], filter);
            }
        });
    }

    fn void_ratio(&self, row: usize) -> Option<f64> {
        self.model.void_ratio(&self.states[row])
    }

    fn points(&self) -> usize {
        self.states.len()
    }

    fn state_bytes(&self) -> usize {
        size_of_val(self.states.as_slice())
    }

    fn states(&self) -> postcard::Result<Vec<u8>> {
        postcard::to_stdvec(&self.states)
    }
}

/// Largest strain component of one step: a thousand times that of an earthquake, and small enough to be
/// integrated in a short time. Beyond it the run has diverged.
const LARGEST_STEP: f64 = 0.02;
/// The same with large displacements: a step may rotate a few nodes that touch each other.
const LARGEST_STEP_OF_LARGE_DISPLACEMENTS: f64 = 0.5;
/// Refuses the strain of a diverging run before the soil model integrates it.
fn check_size(increment: &StrainIncrement, limit: f64) -> Result<(), SoilError> {
    let value = increment.xx.abs().max(increment.yy.abs()).max(increment.xy.abs());
    // NaN passes: the model reports it.
    if value > limit {
        return Err(SoilError::StrainIncrementTooLarge { value, limit });
    }
    Ok(())
}

/// The strain of the soil at a point: that of the motion, with the volume strain of the point's group.
#[inline]
fn shared_increment(
    shared: Option<&SharedStrain>,
    point: usize,
    increment: StrainIncrement,
) -> StrainIncrement {
    shared.map_or(increment, |shared| shared.applied(point, increment))
}

fn stiffness(moduli: Moduli) -> f64 {
    moduli.bulk + 4.0 / 3.0 * moduli.shear
}

/// Contiguous rows of the stress points of each region; stress points are sorted by region.
fn groups(model: &Model, layout: &StressLayout) -> Vec<(usize, Range<usize>)> {
    let mut groups: Vec<(usize, Range<usize>)> = Vec::new();
    for point in 0..layout.count(model.nodes()) {
        let region = layout.region(model, point);
        match groups.last_mut() {
            Some((last, span)) if *last == region => span.end = point + 1,
            _ => groups.push((region, point..point + 1)),
        }
    }
    groups
}

impl SoilField {
    /// Statics: every soil elastic, with its static Poisson's ratio.
    ///
    /// # Errors
    /// [`SolverError::Soil`] where an elastic constant is outside its range.
    pub fn elastic(
        model: &Model,
        layout: &StressLayout,
        points: &mut [StressPoint],
    ) -> Result<Self, SolverError> {
        Self::build(model, layout, |region, rows| {
            let soil = &model.regions[region];
            let law = Elastic::from_poisson(soil.soil.static_shear_modulus(), soil.static_poisson_ratio);
            let law =
                law.map_err(|source| SolverError::Soil { region, node: layout.node(rows.start), source })?;
            for point in &mut points[rows] {
                set_moduli(point, law.constants());
            }
            Ok(Law::Elastic(law))
        })
    }

    /// Dynamics: every region with its own model, initialised at the present stress with a given void ratio,
    /// or the model's own.
    ///
    /// # Errors
    /// [`SolverError::Soil`] where a model refuses the stress.
    pub fn plastic(
        model: &Model,
        layout: &StressLayout,
        points: &mut [StressPoint],
        void_ratio: Option<f64>,
    ) -> Result<Self, SolverError> {
        let mut inadmissible_starts = 0;
        let field = Self::build(model, layout, |region, rows| {
            let soil = &model.regions[region].soil;
            let Soil::Elastic(elastic) = soil else {
                let (rows, replaced) =
                    with_model!(soil, law => plastic_rows(law, region, layout, rows, points, void_ratio)?);
                inadmissible_starts += replaced;
                return Ok(Law::Plastic(soil.clone(), rows));
            };
            for point in &mut points[rows] {
                set_moduli(point, elastic.constants());
            }
            Ok(Law::Elastic(*elastic))
        })?;
        Ok(Self { inadmissible_starts, ..field })
    }

    fn build(
        model: &Model,
        layout: &StressLayout,
        mut law: impl FnMut(usize, Range<usize>) -> Result<Law, SolverError>,
    ) -> Result<Self, SolverError> {
        let groups = groups(model, layout)
            .into_iter()
            .map(|(region, rows)| Ok(Group { region, law: law(region, rows.clone())?, rows }))
            .collect::<Result<Vec<_>, SolverError>>()?;
        let longest = groups.iter().map(|group| group.rows.len()).max().unwrap_or(0);
        let outcomes = vec![Outcome::default(); chunks(longest)];
        Ok(Self { groups, inadmissible_starts: 0, outcomes, largest_strain: LARGEST_STEP })
    }

    /// Allows the strain steps of large displacements.
    pub fn allow_large_steps(&mut self) {
        self.largest_strain = LARGEST_STEP_OF_LARGE_DISPLACEMENTS;
    }

    /// Advances every stress node by one step: strain from the velocity field, stress from the soil model,
    /// and the share that the force loop will gather. Returns the counts of the models and the work of the
    /// stress.
    ///
    /// # Errors
    /// [`SolverError::Soil`] with the first node, in order, whose model failed.
    pub fn step(
        &mut self,
        threaded: bool,
        step: &StrainStep,
        StressRows { points, shares }: StressRows,
    ) -> Result<(UpdateReport, StressWork), SolverError> {
        let StrainStep { layout, shared, geometry, velocity, filter, dt, with_after, .. } = *step;
        let (mut total, mut work) = (UpdateReport::default(), StressWork::default());
        for group in &mut self.groups {
            let first_row = group.rows.start;
            let used = chunks(group.rows.len());
            if self.outcomes.len() < used {
                self.outcomes.resize(used, Outcome::default());
            }
            let outcomes = &mut self.outcomes[..used];
            let a = &mut points[group.rows.clone()];
            let b = &mut shares[group.rows.clone()];
            match &mut group.law {
                Law::Elastic(elastic) => {
                    // The loop writes two arrays; the third has no size.
                    let c = &mut vec![(); a.len()];
                    for_each_chunk(threaded, Rows { a, b, c }, outcomes, |first, rows, outcome| {
                        let mut work = StressWork::default();
                        for (k, (point, share)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                            let s = first_row + first + k;
                            let motion = motion(geometry, s, velocity);
                            let increment =
                                shared_increment(shared, s, motion.advance(&mut point.deformation, dt));
                            let before = point.stress;
                            point.stress = elastic.moved(&before, &increment);
                            work.add(&before, point, &increment, with_after);
                            add_strain(point, &increment);
                            *share = motion.share(point, geometry.covariance[s], filter);
                        }
                        *outcome = Outcome { work, ..Outcome::default() };
                    });
                }
                Law::Plastic(_, law) => {
                    let rows = StressRows { points: a, shares: b };
                    law.step(threaded, step, self.largest_strain, first_row, rows, outcomes);
                    for outcome in &*outcomes {
                        if let Some((s, source)) = &outcome.failure {
                            let (region, node) = (group.region, layout.node(*s));
                            return Err(SolverError::Soil { region, node, source: source.clone() });
                        }
                        total.merge(&outcome.report);
                    }
                }
            }
            // In a fixed order, so that the sum is the same with any number of threads.
            for outcome in &*outcomes {
                work.merge(&outcome.work);
            }
        }
        Ok((total, work))
    }

    /// Region and rows of each group.
    pub fn rows(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.groups.iter().map(|group| (group.region, group.rows.clone()))
    }

    /// Void ratio at stress node `s`, if its model knows it.
    pub fn void_ratio(&self, s: usize) -> Option<f64> {
        let group = self.groups.iter().find(|group| group.rows.contains(&s))?;
        match &group.law {
            Law::Elastic(_) => None,
            Law::Plastic(_, law) => law.void_ratio(s - group.rows.start),
        }
    }

    fn plastic_groups(&self) -> impl Iterator<Item = &dyn Plastic> {
        self.groups.iter().filter_map(|group| match &group.law {
            Law::Elastic(_) => None,
            Law::Plastic(_, law) => Some(&**law),
        })
    }

    /// Stress nodes whose soil could not carry their initial stress and took the nearest that it can carry.
    pub fn inadmissible_starts(&self) -> u64 {
        self.inadmissible_starts
    }

    /// Stress nodes that run a plastic model.
    pub fn plastic_points(&self) -> usize {
        self.plastic_groups().map(Plastic::points).sum()
    }

    /// Bytes of the plastic models' history variables.
    pub fn state_bytes(&self) -> usize {
        self.plastic_groups().map(Plastic::state_bytes).sum()
    }
}

/// Makes the states of one region's rows and sets the stress and moduli of their points. Returns the states,
/// and how many rows could not carry their stress.
fn plastic_rows<M: SoilModel + 'static>(
    law: &M,
    region: usize,
    layout: &StressLayout,
    rows: Range<usize>,
    points: &mut [StressPoint],
    void_ratio: Option<f64>,
) -> Result<(Box<dyn Plastic>, u64), SolverError> {
    let mut states = Vec::with_capacity(rows.len());
    let mut replaced = 0;
    for s in rows {
        replaced += u64::from(!law.carries(&points[s].stress));
        let state = law.initialise(points[s].stress, void_ratio).map_err(|source| SolverError::Soil {
            region,
            node: layout.node(s),
            source,
        })?;
        points[s].stress = law.stress(&state);
        set_moduli(&mut points[s], law.moduli(&state));
        states.push(state);
    }
    Ok((Box::new(PlasticRows { model: law.clone(), states }), replaced))
}

fn restored_rows<M: SoilModel + 'static>(law: &M, states: &[u8]) -> postcard::Result<Box<dyn Plastic>> {
    Ok(Box::new(PlasticRows { model: law.clone(), states: postcard::from_bytes(states)? }))
}

fn set_moduli(point: &mut StressPoint, moduli: Moduli) {
    point.shear_modulus = moduli.shear;
    point.stiffness = stiffness(moduli);
}

fn add_strain(point: &mut StressPoint, increment: &StrainIncrement) {
    point.strain[0] += increment.xx;
    point.strain[1] += increment.yy;
    point.strain[2] += increment.xy;
}
