//! Free-field sides (Section 4.2). Beyond each side the ground is a column that is solved before the section
//! in each step and does not depend on it. The stress of the column pushes on the section, and dashpots
//! between the two absorb waves that leave the section.
//!
//! The push is the force of soil beyond the side under the column's stress, computed by the section's force
//! operator: the weights of complete stencils, which contain columns beyond the side, minus the weights of
//! stencils cut at the side. Strain is computed in the same way: complete stencils act on the column's
//! motion, cut stencils on the difference of the section's motion from it. A section that moves as the column
//! therefore has exactly its strain and its forces, also at the corners. Neither part responds to other
//! motion of the section; only the dashpots do (Eq. 15 as corrected).

use crate::{
    edges::{
        base::BaseSegment,
        dashpots::{Dashpot, Dashpots, NodalMotion, trace},
    },
    error::SolverError,
    neighbours::{
        column::{Column, Present},
        side_tables::{Rows, SideTables},
    },
    run::{
        neighbour::{Alone, Neighbour},
        simulation::Driver,
        time_step::{PressureCoupling, TimeLimit},
    },
    section::{
        description::Model,
        edge_nodes::EdgeNodes,
        node_id::id,
        outline::{Hand, Outline, Side},
        stress_layout::StressLayout,
    },
    skeleton::{point::StressPoint, section_view::SectionView},
    stages::{column_record::ColumnRecord, gravity::Gravity, stage::Stage},
    weights::geometry::Geometry,
};
use sandboil_sph::{Csr, Period, Vec2};
use std::collections::BTreeMap;

/// Relative difference up to which values of two columns count as equal; the values are computed and have round-off.
const SAME: f64 = 1e-9;

/// Columns beyond the sides of a section and their coupling with it.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct FreeField {
    columns: Vec<Column>,
    sides: Vec<CoupledSide>,
}

/// Push and dashpots at one side of the section.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct CoupledSide {
    hand: Hand,
    /// Position of the side at the start of the first moving stage, m.
    x: f64,
    column: usize,
    dashpots: Dashpots,
    /// Weights of the column's rows in its motion at the points of the dashpots.
    trace: Csr<f64>,
    tables: SideTables,
    /// Nominal stress of the column at which the push is zero, kPa.
    reference: Vec<[f64; 4]>,
    /// Nominal pore pressure of the column at which the push is zero, kPa.
    reference_water: Vec<[f64; 4]>,
    /// Velocities of the column at the dashpots, m/s.
    targets: Vec<f64>,
    /// Force of the step on the nodes of the tables, kN/m.
    force: Vec<Vec2>,
    /// Stress nodes whose strain depends on the column's motion.
    strained: Vec<usize>,
}

/// The segment of the base through which the wave of a side arrives.
pub fn segment_at(stage: &Stage, x: f64) -> BaseSegment {
    stage.compliant_base().map_or_else(|| BaseSegment::everywhere(None), |base| base.at(x))
}

impl FreeField {
    /// The columns that are solved.
    fn solved(&self) -> impl Iterator<Item = &Driver<Alone>> {
        self.columns.iter().filter_map(Column::simulation)
    }

    /// Builds the coupling at the present positions. The push is then zero.
    fn renew_tables(&mut self, section: &SectionView) {
        for side in &mut self.sides {
            let column = &self.columns[side.column];
            side.tables = SideTables::new(section, side.hand);
            side.force = vec![Vec2::zeros(); side.tables.nodes.len()];
            side.begin_increments(column);
        }
    }

    /// Copies the columns' motion to the entries that the section's strain reads.
    fn copy_motion(&self, velocity: &mut [Vec2], acceleration: &mut [Vec2]) {
        let copied = self.sides.iter().flat_map(|side| {
            let present = self.columns[side.column].present();
            present.velocity.iter().zip(&present.acceleration)
        });
        for ((v, a), (copied_v, copied_a)) in velocity.iter_mut().zip(acceleration).zip(copied) {
            (*v, *a) = (*copied_v, *copied_a);
        }
    }
}

impl Neighbour for FreeField {
    fn new(
        section: &SectionView,
        stage: &Stage,
        gravity: Option<Gravity>,
    ) -> Result<Option<Self>, SolverError> {
        let mut free_field = Self { columns: Vec::new(), sides: Vec::new() };
        let mut made: Vec<(Model, BaseSegment)> = Vec::new();
        for (hand, wanted) in Hand::BOTH.into_iter().zip(stage.free_field()) {
            let (true, Some(side)) = (wanted, section.outline.sides[hand as usize]) else { continue };
            let model = column_model(section.model, section.edges, hand);
            let segment = segment_at(stage, side.x);
            let same =
                made.iter().position(|(other, arrival)| *arrival == segment && same_column(other, &model));
            let column = match (same, stage.column_record(hand)) {
                (Some(column), _) => column,
                (None, recorded) => {
                    free_field.columns.push(match recorded {
                        Some(record) => {
                            record.validate(model.nodes(), model.has_nodal_water(), stage.duration())?;
                            Column::recorded(record.clone())
                        }
                        None => {
                            Column::at_rest(&model, gravity).map_err(|error| on_side(hand, side.x, error))?
                        }
                    });
                    made.push((model, segment));
                    made.len() - 1
                }
            };
            free_field.sides.push(CoupledSide {
                hand,
                x: side.x,
                column,
                dashpots: Dashpots::default(),
                trace: Csr::default(),
                tables: SideTables::default(),
                reference: Vec::new(),
                reference_water: Vec::new(),
                targets: Vec::new(),
                force: Vec::new(),
                strained: Vec::new(),
            });
        }
        if free_field.columns.is_empty() {
            return Ok(None);
        }
        free_field.begin(section, stage)?;
        free_field.renew_tables(section);
        Ok(Some(free_field))
    }

    /// Each column is shaken by the wave that arrives at its side.
    fn begin(&mut self, section: &SectionView, stage: &Stage) -> Result<(), SolverError> {
        let lowest = section.model.outline.lowest();
        let mut begun = vec![false; self.columns.len()];
        for k in 0..self.sides.len() {
            let CoupledSide { hand, column, .. } = self.sides[k];
            let Some(side) = section.outline.sides[hand as usize] else { continue };
            if !std::mem::replace(&mut begun[column], true) {
                let of_column = stage.of_column(segment_at(stage, side.x), lowest);
                self.columns[column]
                    .begin(of_column, stage.column_record(hand), stage.output.record_columns)
                    .map_err(|error| on_side(hand, side.x, error))?;
            }
            (self.sides[k].dashpots, self.sides[k].trace) =
                side_dashpots(section, hand, side, &self.columns[column])
                    .map_err(|error| on_side(hand, side.x, error))?;
        }
        for side in &mut self.sides {
            side.targets = vec![0.0; side.dashpots.all().len()];
            side.begin_increments(&self.columns[side.column]);
        }
        Ok(())
    }

    fn renew(&mut self, section: &SectionView) {
        for column in &mut self.columns {
            column.renew_geometry();
        }
        self.renew_tables(section);
    }

    fn set_excess(&mut self, edges: &EdgeNodes, excess: &[f64]) {
        for side in &mut self.sides {
            let column = &mut self.columns[side.column];
            column.set_excess(edges.sides[side.hand as usize].iter().map(|&node| excess[node]));
            side.begin_increments(column);
        }
    }

    fn copied_velocities(&self) -> usize {
        self.sides.iter().map(|side| self.columns[side.column].rows()).sum()
    }

    fn couple(&mut self, geometry: &mut Geometry, nodes: usize) {
        let mut first = id(nodes);
        for side in &mut self.sides {
            let (strain, divergence) =
                (std::mem::take(&mut side.tables.strain), std::mem::take(&mut side.tables.divergence));
            side.strained = strain.keys().copied().collect();
            geometry.add_copied_velocities(renumbered(strain, first), renumbered(divergence, first));
            first += id(self.columns[side.column].rows());
        }
    }

    /// The traction of the columns' bases is left out, because it lasts only as long as the motion.
    fn add_push(&mut self, force: &mut [Vec2]) {
        for column in &mut self.columns {
            column.observe();
        }
        for side in &mut self.sides {
            side.push(self.columns[side.column].present());
            for (&node, pushed) in side.tables.nodes.iter().zip(&side.force) {
                force[node] += pushed;
            }
        }
    }

    fn is_strained(&self) -> bool {
        self.solved().any(Driver::is_strained)
    }

    fn limit(&self, coupling: PressureCoupling, factor: f64) -> Option<TimeLimit> {
        self.solved().map(|column| column.limit(coupling, factor)).reduce(TimeLimit::least)
    }

    /// Sides that share a column have copies of one record.
    fn take_records(&mut self) -> [Option<ColumnRecord>; 2] {
        let taken: Vec<Option<ColumnRecord>> = self.columns.iter_mut().map(Column::take_record).collect();
        let mut records = [None, None];
        for side in &self.sides {
            records[side.hand as usize].clone_from(&taken[side.column]);
        }
        records
    }

    fn begin_step(&mut self, dt: f64, velocity: &[Vec2]) -> Result<(), SolverError> {
        for column in &mut self.columns {
            column.observe();
        }
        for side in &mut self.sides {
            side.push(self.columns[side.column].present());
            side.dashpots.begin_step(velocity);
        }
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.step(dt).map_err(|error| of_column(&self.sides, k, error))?;
        }
        for side in &mut self.sides {
            let traction = self.columns[side.column].present().base_traction;
            for (force, length) in side.force.iter_mut().zip(&side.tables.base) {
                *force += traction * *length;
            }
        }
        Ok(())
    }

    fn guard(&self) -> Result<(), SolverError> {
        for (k, column) in self.columns.iter().enumerate() {
            let Some(simulation) = column.simulation() else { continue };
            simulation.guard().map_err(|error| of_column(&self.sides, k, error))?;
        }
        Ok(())
    }

    fn push(&self, dt: f64, mass: &[f64], motion: &mut NodalMotion) {
        for side in &self.sides {
            for (&node, force) in side.tables.nodes.iter().zip(&side.force) {
                motion.add(node, force / mass[node], dt);
            }
        }
    }

    /// The dashpots act on the difference of the section's motion from the columns'.
    fn end_step(&mut self, dt: f64, mass: &[f64], motion: &mut NodalMotion) {
        for side in &mut self.sides {
            let present = self.columns[side.column].present();
            let CoupledSide { dashpots, trace, targets, .. } = side;
            // The column's motion, interpolated by the section's trace.
            for (target, dashpot) in targets.iter_mut().zip(dashpots.all()) {
                let read = |(row, weight): (usize, &f64)| {
                    let twice = present.velocity[row] + present.velocity_before[row];
                    weight * twice.dot(&dashpot.direction)
                };
                *target = 0.5 * trace.iter_row(dashpot.point).map(read).sum::<f64>();
            }
            dashpots.end_step(dt, mass, motion, |k| targets[k]);
        }
        self.copy_motion(&mut motion.velocity[mass.len()..], &mut motion.acceleration[mass.len()..]);
    }

    /// Work of pushes and dashpots, and of the section's stress in the strain from the copied velocities, which has no
    /// counterpart in the nodal forces.
    fn work(
        &self,
        dt: f64,
        velocity: &[Vec2],
        acceleration: &[Vec2],
        geometry: &Geometry,
        points: &[StressPoint],
    ) -> f64 {
        let path = |node: usize| (velocity[node] - acceleration[node] * (0.5 * dt)) * dt;
        let copies = velocity.len() - self.copied_velocities();
        let strained = |&s: &usize| {
            let point @ StressPoint { volume, deformation, .. } = &points[s];
            let nominal = deformation.cofactor().nominal(&point.total_stress());
            let copied = geometry.wall.forward.iter_row(s).filter(|(column, _)| *column >= copies);
            copied.map(|(column, weight)| weight.contract(nominal).dot(&path(column)) * volume).sum::<f64>()
        };
        let of_side = |side: &CoupledSide| {
            let pushed: f64 =
                side.tables.nodes.iter().zip(&side.force).map(|(&node, force)| force.dot(&path(node))).sum();
            pushed + side.dashpots.work(dt, velocity) + side.strained.iter().map(strained).sum::<f64>()
        };
        self.sides.iter().map(of_side).sum()
    }

    /// Includes the columns.
    fn bytes(&self) -> usize {
        let side = |side: &CoupledSide| {
            side.dashpots.bytes()
                + side.trace.bytes()
                + size_of_val(side.targets.as_slice())
                + side.tables.bytes()
                + size_of_val(side.reference.as_slice())
                + size_of_val(side.reference_water.as_slice())
                + size_of_val(side.force.as_slice())
        };
        self.columns.iter().map(Column::bytes).sum::<usize>() + self.sides.iter().map(side).sum::<usize>()
    }
}

/// The same weights with indices of copied velocities, which begin at `first`, instead of rows.
fn renumbered<T>(mut rows: BTreeMap<usize, Vec<(u32, T)>>, first: u32) -> BTreeMap<usize, Vec<(u32, T)>> {
    for (column, _) in rows.values_mut().flatten() {
        *column += first;
    }
    rows
}

/// The error of a column, with the first side that it belongs to.
fn of_column(sides: &[CoupledSide], column: usize, error: SolverError) -> SolverError {
    match sides.iter().find(|side| side.column == column) {
        Some(side) => on_side(side.hand, side.x, error),
        None => error,
    }
}

/// The error of the column at a side, with the position of the side.
fn on_side(hand: Hand, x: f64, mut error: SolverError) -> SolverError {
    if let SolverError::Diverged { x: position, .. } = &mut error {
        *position = x;
    }
    SolverError::Column { side: hand.name(), source: Box::new(error) }
}

impl CoupledSide {
    /// Makes the push zero in the present state of the column.
    fn begin_increments(&mut self, column: &Column) {
        self.reference.clone_from(&column.present().stress);
        self.reference_water.clone_from(&column.present().water);
    }

    /// Computes the force of the increments of the column's stress and pressure on the section (Eq. 6 beyond the side).
    fn push(&mut self, present: &Present) {
        for (row, force) in self.force.iter_mut().enumerate() {
            *force = Vec2::zeros();
            for (s, weight) in self.tables.stress.iter_row(row) {
                *force -= weight.contract(difference(&present.stress[s], &self.reference[s]));
            }
            for (i, weight) in self.tables.pressure.iter_row(row) {
                let [xx, xy, yx, yy] = difference(&present.water[i], &self.reference_water[i]);
                *force += Vec2::new(xx * weight.x + xy * weight.y, yx * weight.x + yy * weight.y);
            }
        }
    }
}

fn difference(a: &[f64; 4], b: &[f64; 4]) -> [f64; 4] {
    [0, 1, 2, 3].map(|c| a[c] - b[c])
}

/// Model of the soil at a side as a column between periodic sides.
pub fn column_model(model: &Model, edges: &EdgeNodes, hand: Hand) -> Model {
    let nodes = &edges.sides[hand as usize];
    // The static stage of the column needs the undeformed lattice, as that of the section.
    let x = nodes.first().map_or(0.0, |&node| model.position[node].x);
    let pick = |values: &[f64]| nodes.iter().filter_map(|&node| values.get(node).copied()).collect();
    let middle = 0.5 * model.spacing.x;
    let mut column = Model {
        position: nodes.iter().map(|&node| Vec2::new(middle, model.position[node].y)).collect(),
        volume: pick(&model.volume),
        region: nodes.iter().map(|&node| model.region[node]).collect(),
        surface_elevation: pick(&model.surface_elevation),
        vertical_effective_stress: Vec::new(),
        pore_pressure: pick(&model.pore_pressure),
        saturation: pick(&model.saturation),
        period: Some(Period { width: model.spacing.x }),
        outline: Outline {
            base_support: model.outline.base_support,
            ..Outline::level(model.outline.base_elevation(x))
        },
        ..model.clone()
    };
    let (of_section, of_column) = (StressLayout::new(model), StressLayout::new(&column));
    let beside = |point: usize| {
        let node = nodes[of_column.node(point)];
        model.vertical_effective_stress[of_section.beside(node, hand)[of_column.level(point)]]
    };
    column.vertical_effective_stress = (0..of_column.count(nodes.len())).map(beside).collect();
    column
}

/// Whether two columns have the same rows.
fn same_column(a: &Model, b: &Model) -> bool {
    let close = |a: &[f64], b: &[f64]| {
        a.len() == b.len()
            && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME * a.abs().max(b.abs()).max(1.0))
    };
    let heights = |model: &Model| model.position.iter().map(|x| x.y).collect::<Vec<_>>();
    a.region == b.region
        && close(&heights(a), &heights(b))
        && close(&a.volume, &b.volume)
        && close(&a.vertical_effective_stress, &b.vertical_effective_stress)
        && close(&a.pore_pressure, &b.pore_pressure)
        && close(&a.saturation, &b.saturation)
        && close(&a.surface_elevation, &b.surface_elevation)
        && close(&[a.outline.base_elevation(0.0)], &[b.outline.base_elevation(0.0)])
}

/// A dashpot normal and one parallel to the side for each of its rows, from the column's small-strain speeds,
/// and the trace at their points in terms of the rows of the column.
fn side_dashpots(
    section: &SectionView,
    hand: Hand,
    side: Side,
    column: &Column,
) -> Result<(Dashpots, Csr<f64>), SolverError> {
    let SectionView { model, position, edges, .. } = section;
    let nodes = &edges.sides[hand as usize];
    let points: Vec<Vec2> = nodes.iter().map(|&node| Vec2::new(side.x, position[node].y)).collect();
    let mut all = Vec::with_capacity(2 * nodes.len());
    for (point, below) in column.impedance()?.into_iter().enumerate() {
        let (eta_s, eta_p) = (below.density * below.shear_speed, below.density * below.compression_speed);
        for (direction, impedance) in [(Vec2::x(), eta_p), (Vec2::y(), eta_s)] {
            all.push(Dashpot { point, direction, impedance, length: model.spacing.y });
        }
    }
    let trace = trace(model, position, &points, nodes);
    let rows = Rows::of(section, hand);
    let mut over_rows = Csr::with_capacity(trace.rows(), trace.entries());
    for point in 0..trace.rows() {
        let row =
            trace.iter_row(point).map(|(node, &weight)| (id(rows.nearest(model.position[node].y)), weight));
        over_rows.push_row(&mut row.collect::<Vec<_>>());
    }
    Ok((Dashpots::new(all, trace, section.mass), over_rows))
}
