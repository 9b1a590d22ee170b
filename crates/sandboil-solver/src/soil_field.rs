//! Soil models at the stress nodes, region by region: which model runs where is decided once per stage.

use crate::{
    error::SolverError,
    geometry::Geometry,
    model::{Model, STRESS_NODES, Soil},
    parallel::{Rows, chunks, for_each_chunk},
    skeleton::{NodalShare, StressPoint, motion},
};
use sandboil_soil::{
    Integrator, Moduli, SoilError, StrainIncrement, UpdateReport,
    elastic::Elastic,
    pm4sand::{PM4Sand, State},
};
use sandboil_sph::Vec2;
use std::ops::Range;

/// One region's stress nodes under one model.
#[derive(Debug, Clone)]
struct Group {
    region: usize,
    rows: Range<usize>,
    law: Law,
}

#[derive(Debug, Clone)]
enum Law {
    Elastic(Elastic),
    Sand { material: Box<PM4Sand>, states: Vec<State> },
}

/// Outcome of one chunk of updates.
#[derive(Debug, Clone, Default)]
struct Outcome {
    report: UpdateReport,
    failure: Option<(usize, SoilError)>,
}

/// The soil models of a stage.
#[derive(Debug, Clone)]
pub struct SoilField {
    groups: Vec<Group>,
    outcomes: Vec<Outcome>,
    unit: Vec<()>,
}

/// Largest strain component of one step: a thousand times what an earthquake does, and far below what plasticity
/// would need minutes to follow. Beyond it the run has diverged.
const LARGEST_STEP: f64 = 0.02;

/// Refuses the strain of a diverging run before the soil model goes through it.
fn bounded(increment: &StrainIncrement) -> Result<(), SoilError> {
    let value = increment.xx.abs().max(increment.yy.abs()).max(increment.xy.abs());
    // NaN goes on to the model, which names it.
    if value > LARGEST_STEP {
        return Err(SoilError::StrainIncrementTooLarge { value, limit: LARGEST_STEP });
    }
    Ok(())
}

fn stiffness(moduli: Moduli) -> f64 {
    moduli.bulk + 4.0 / 3.0 * moduli.shear
}

/// Contiguous stress-node rows of each region; nodes are sorted by region.
fn groups(model: &Model) -> Vec<(usize, Range<usize>)> {
    let mut groups: Vec<(usize, Range<usize>)> = Vec::new();
    for (node, &region) in model.region.iter().enumerate() {
        let rows = STRESS_NODES * node..STRESS_NODES * (node + 1);
        match groups.last_mut() {
            Some((last, span)) if *last == region as usize => span.end = rows.end,
            _ => groups.push((region as usize, rows)),
        }
    }
    groups
}

impl SoilField {
    /// Statics: every soil elastic, with its static Poisson's ratio.
    ///
    /// # Errors
    /// [`SolverError::Soil`] where an elastic constant is outside its range.
    pub fn elastic(model: &Model, points: &mut [StressPoint]) -> Result<Self, SolverError> {
        Self::build(model, |region, rows| {
            let soil = &model.regions[region];
            let law = Elastic::from_poisson(soil.soil.static_shear_modulus(), soil.static_poisson_ratio);
            let law =
                law.map_err(|source| SolverError::Soil { region, node: rows.start / STRESS_NODES, source })?;
            for point in &mut points[rows] {
                set_moduli(point, law.moduli());
            }
            Ok(Law::Elastic(law))
        })
    }

    /// Shaking: every region's own model, sand initialised from the stress it has.
    ///
    /// # Errors
    /// [`SolverError::Soil`] where a model refuses the stress.
    pub fn plastic(model: &Model, points: &mut [StressPoint]) -> Result<Self, SolverError> {
        Self::build(model, |region, rows| match &model.regions[region].soil {
            Soil::Elastic(elastic) => {
                for point in &mut points[rows] {
                    set_moduli(point, elastic.moduli());
                }
                Ok(Law::Elastic(elastic.clone()))
            }
            Soil::PM4Sand(material) => {
                let mut states = Vec::with_capacity(rows.len());
                for s in rows {
                    let state = material
                        .initialise(points[s].stress)
                        .map_err(|source| SolverError::Soil { region, node: s / STRESS_NODES, source })?;
                    points[s].stress = material.stress(&state);
                    set_moduli(&mut points[s], material.moduli(&state));
                    states.push(state);
                }
                Ok(Law::Sand { material: material.clone(), states })
            }
        })
    }

    fn build(
        model: &Model,
        mut law: impl FnMut(usize, Range<usize>) -> Result<Law, SolverError>,
    ) -> Result<Self, SolverError> {
        let groups: Vec<Group> = groups(model)
            .into_iter()
            .map(|(region, rows)| Ok(Group { region, law: law(region, rows.clone())?, rows }))
            .collect::<Result<_, SolverError>>()?;
        let longest = groups.iter().map(|group| group.rows.len()).max().unwrap_or(0);
        Ok(Self { groups, outcomes: vec![Outcome::default(); chunks(longest)], unit: vec![(); longest] })
    }

    /// Moves every stress node through one step: strain from the velocity field, stress from the soil model,
    /// and the share that the force loop will gather.
    ///
    /// # Errors
    /// [`SolverError::Soil`] with the first node, in order, whose model failed.
    pub fn step(
        &mut self,
        threaded: bool,
        geometry: &Geometry,
        velocity: &[Vec2],
        (points, shares): (&mut [StressPoint], &mut [NodalShare]),
        (filter, dt): (f64, f64),
        integrator: &Integrator,
    ) -> Result<UpdateReport, SolverError> {
        let mut total = UpdateReport::default();
        for group in &mut self.groups {
            let first_row = group.rows.start;
            let used = chunks(group.rows.len());
            let outcomes = &mut self.outcomes[..used];
            let a = &mut points[group.rows.clone()];
            let b = &mut shares[group.rows.clone()];
            match &mut group.law {
                Law::Elastic(elastic) => {
                    let c = &mut self.unit[..a.len()];
                    for_each_chunk(threaded, Rows { a, b, c }, outcomes, |first, rows, _| {
                        for (k, (point, share)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                            let s = first_row + first + k;
                            let motion = motion(geometry, s, velocity);
                            let increment = motion.advance(&mut point.deformation, dt);
                            point.stress = elastic.update(&point.stress, &increment);
                            add_strain(point, &increment);
                            *share = motion.share(point, geometry.covariance[s], filter);
                        }
                    });
                }
                Law::Sand { material, states } => {
                    for_each_chunk(threaded, Rows { a, b, c: states }, outcomes, |first, rows, outcome| {
                        *outcome = Outcome::default();
                        for k in 0..rows.a.len() {
                            let (point, state) = (&mut rows.a[k], &mut rows.c[k]);
                            let s = first_row + first + k;
                            let motion = motion(geometry, s, velocity);
                            let increment = motion.advance(&mut point.deformation, dt);
                            let updated = bounded(&increment)
                                .and_then(|()| material.update(state, &increment, integrator));
                            match updated {
                                Ok(report) => outcome.report.merge(&report),
                                Err(error) => {
                                    outcome.failure = Some((s, error));
                                    return;
                                }
                            }
                            point.stress = material.stress(state);
                            set_moduli(point, material.moduli(state));
                            add_strain(point, &increment);
                            rows.b[k] = motion.share(point, geometry.covariance[s], filter);
                        }
                    });
                    for outcome in outcomes.iter() {
                        if let Some((s, source)) = &outcome.failure {
                            let (region, node) = (group.region, s / STRESS_NODES);
                            return Err(SolverError::Soil { region, node, source: source.clone() });
                        }
                        total.merge(&outcome.report);
                    }
                }
            }
        }
        Ok(total)
    }

    /// Stress nodes that run a plastic model.
    pub fn plastic_points(&self) -> usize {
        self.groups
            .iter()
            .map(|group| if let Law::Sand { states, .. } = &group.law { states.len() } else { 0 })
            .sum()
    }

    /// Bytes of the plastic models' history variables.
    pub fn state_bytes(&self) -> usize {
        self.plastic_points() * size_of::<State>()
    }
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
