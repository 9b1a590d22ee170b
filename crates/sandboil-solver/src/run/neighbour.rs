//! Ground beside a section: it acts on the section, and the section does not act on it.

use crate::{
    edges::dashpots::NodalMotion,
    error::SolverError,
    run::time_step::{PressureCoupling, TimeLimit},
    section::edge_nodes::EdgeNodes,
    skeleton::{point::StressPoint, section_view::SectionView},
    stages::{column_record::ColumnRecord, gravity::Gravity, stage::Stage},
    weights::geometry::Geometry,
};
use sandboil_sph::Vec2;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// Ground beside a section: one-way coupled, advanced before the section in every step.
pub trait Neighbour: Debug + Send + Sync + Serialize + DeserializeOwned {
    /// The neighbours that a stage needs, coupled, and brought to rest by the static stage `gravity` if there
    /// was one.
    ///
    /// # Errors
    /// A neighbour that does not come to rest, or soil that refuses its stress.
    fn new(
        section: &SectionView,
        stage: &Stage,
        gravity: Option<Gravity>,
    ) -> Result<Option<Self>, SolverError>;

    /// Begins another stage from the present state.
    ///
    /// # Errors
    /// Soil that refuses its stress.
    fn begin(&mut self, section: &SectionView, stage: &Stage) -> Result<(), SolverError>;

    /// Number of the neighbour's velocities that the section's strain reads.
    fn copied_velocities(&self) -> usize;

    /// Adds the weights of the copied velocities, from index `nodes` on, to a geometry; once for each renewal.
    fn couple(&mut self, geometry: &mut Geometry, nodes: usize);

    /// The first half of a step: advances by `dt` (s), and stores the section's velocity at the common edges.
    ///
    /// # Errors
    /// A neighbour that has diverged.
    fn begin_step(&mut self, dt: f64, velocity: &[Vec2]) -> Result<(), SolverError>;

    /// Adds the stress of the neighbour to the motion, which the section's own forces have already changed.
    fn push(&self, dt: f64, mass: &[f64], motion: &mut NodalMotion);

    /// Adds the dashpots between section and neighbour, and copies the neighbour's motion to the end of the
    /// section's.
    fn end_step(&mut self, dt: f64, mass: &[f64], motion: &mut NodalMotion);

    /// Work of the neighbour on the section in a step, kJ/m, from velocities that include all forces of the
    /// step and the stress at its beginning.
    fn work(
        &self,
        dt: f64,
        velocity: &[Vec2],
        acceleration: &[Vec2],
        geometry: &Geometry,
        points: &[StressPoint],
    ) -> f64;

    /// Adds the present stress of the neighbour to forces on all nodes, kN/m.
    fn add_push(&mut self, force: &mut [Vec2]);

    /// Renews the neighbour's own geometry and its coupling with the section.
    fn renew(&mut self, section: &SectionView);

    /// Whether the neighbour is strained beyond the range of its weights.
    fn is_strained(&self) -> bool;

    /// Longest stable time step of the neighbour, s.
    fn limit(&self, coupling: PressureCoupling, factor: f64) -> Option<TimeLimit>;

    /// Sets the excess pore pressure of the neighbour to that of the section beside it, kPa, held in balance.
    fn set_excess(&mut self, edges: &EdgeNodes, excess: &[f64]);

    /// Refuses motion or pore pressure that is no longer finite, and impossible velocities.
    ///
    /// # Errors
    /// The first node found.
    fn guard(&self) -> Result<(), SolverError>;

    /// Takes out the records of the left and the right side in the stage, if there are any.
    fn take_records(&mut self) -> [Option<ColumnRecord>; 2];

    /// Bytes held.
    fn bytes(&self) -> usize;
}

/// No neighbour: ground between periodic or held sides, and the columns beside a section.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub enum Alone {}

impl Neighbour for Alone {
    fn new(
        _section: &SectionView,
        _stage: &Stage,
        _gravity: Option<Gravity>,
    ) -> Result<Option<Self>, SolverError> {
        Ok(None)
    }

    fn begin(&mut self, _section: &SectionView, _stage: &Stage) -> Result<(), SolverError> {
        match *self {}
    }

    fn copied_velocities(&self) -> usize {
        match *self {}
    }

    fn couple(&mut self, _geometry: &mut Geometry, _nodes: usize) {
        match *self {}
    }

    fn begin_step(&mut self, _dt: f64, _velocity: &[Vec2]) -> Result<(), SolverError> {
        match *self {}
    }

    fn push(&self, _dt: f64, _mass: &[f64], _motion: &mut NodalMotion) {
        match *self {}
    }

    fn end_step(&mut self, _dt: f64, _mass: &[f64], _motion: &mut NodalMotion) {
        match *self {}
    }

    fn work(
        &self,
        _dt: f64,
        _velocity: &[Vec2],
        _acceleration: &[Vec2],
        _geometry: &Geometry,
        _points: &[StressPoint],
    ) -> f64 {
        match *self {}
    }

    fn add_push(&mut self, _force: &mut [Vec2]) {
        match *self {}
    }

    fn renew(&mut self, _section: &SectionView) {
        match *self {}
    }

    fn is_strained(&self) -> bool {
        match *self {}
    }

    fn limit(&self, _coupling: PressureCoupling, _factor: f64) -> Option<TimeLimit> {
        match *self {}
    }

    fn set_excess(&mut self, _edges: &EdgeNodes, _excess: &[f64]) {
        match *self {}
    }

    fn guard(&self) -> Result<(), SolverError> {
        match *self {}
    }

    fn take_records(&mut self) -> [Option<ColumnRecord>; 2] {
        match *self {}
    }

    fn bytes(&self) -> usize {
        match *self {}
    }
}
