//! Free-field sides (Section 4.2): beyond each side the ground goes on as a column that moves on its own, solved first and
//! one-way. It pushes the section with its stress, and dashpots between the two let out what the section sends.
//!
//! The push is what the section's own force operator would feel of soil beyond the side under the column's stress: the
//! weights of stencils completed by columns beyond the side, less those of the cut ones. Strain is treated alike: the cut
//! stencils see the difference to the column's motion, the completed ones the column's. A section that does as the column
//! does is then held exactly as the column is, corners included, and neither coupling answers to what the section does
//! otherwise: that is left to the dashpots (Eq. 15 as corrected).

use crate::{
    edges::{
        base::{Base, BaseSegment},
        dashpots::{Dashpot, Dashpots, trace},
    },
    error::SolverError,
    run::{
        section_view::Section,
        simulation::{Gravity, Shaking, Simulation},
    },
    section::{
        description::{Model, Operators, STRESS_NODES},
        edge_nodes::EdgeNodes,
        node_id::id,
        outline::{Hand, Outline, Side},
    },
    skeleton::point::StressPoint,
    stages::column::{Column, ColumnRecord, Present},
    weights::{
        geometry::Geometry,
        images::Surroundings,
        points::stress_node_positions,
        rows::{StrainRow, VectorWeight, divergence_row},
        stencils::Stencils,
    },
};
use sandboil_sph::{Csr, LeastSquaresFit, NeighbourList, Period, Vec2, WendlandQuintic};
use std::collections::BTreeMap;

/// Relative difference up to which two columns' stresses are the same: they are computed, not read.
pub const SAME: f64 = 1e-9;
/// Difference of a completed and a cut weight that is round-off, over the inverse of the spacing.
pub const NO_DIFFERENCE: f64 = 1e-12;
/// Columns beyond the sides of a section and what ties the section to them.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct FreeField {
    columns: Vec<Column>,
    sides: Vec<TiedSide>,
}

/// What acts on the section at one side.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct TiedSide {
    hand: Hand,
    /// Where the side stands when shaking begins, m.
    x: f64,
    column: usize,
    dashpots: Dashpots,
    /// Weights of the column's rows in the motion that the dashpots' points would have with it.
    trace: Csr<f64>,
    tables: SideTables,
    /// Nominal stress and pore pressure of the column when increments began, kPa.
    reference: Vec<[f64; 4]>,
    reference_water: Vec<[f64; 4]>,
    /// Velocities towards which the dashpots pull, m/s.
    targets: Vec<f64>,
    /// Force of the step on the nodes of the tables, kN/m.
    force: Vec<Vec2>,
    /// Stress nodes that see the column's motion.
    strained: Vec<usize>,
}

/// Weights of the column's stress, pressure and base traction in the force on nodes near a side.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct SideTables {
    nodes: Vec<usize>,
    /// Volume times weight: rows are `nodes`, columns the stress nodes of the column's rows.
    stress: Csr<VectorWeight>,
    /// Volume times weight: rows are `nodes`, columns the column's rows; empty without water.
    pressure: Csr<Vec2>,
    /// Length of base whose traction the cut trace misses, m.
    base: Vec<f64>,
    /// Weights of the column's velocities in the section's strain, for each stress node near the side; columns are rows
    /// of the column. The section's geometry takes them over.
    strain: BTreeMap<usize, Vec<(u32, VectorWeight)>>,
    /// The same in the divergence at nodes.
    divergence: BTreeMap<usize, Vec<(u32, Vec2)>>,
}

impl FreeField {
    /// Columns at rest beyond those sides of the section of which `wanted` is true, and the ties to them.
    ///
    /// # Errors
    /// A column that finds no rest, or soil that refuses its stress.
    pub fn new(
        section: &Section,
        wanted: [bool; 2],
        gravity: Option<Gravity>,
        stage: &Shaking,
    ) -> Result<Option<Self>, SolverError> {
        let mut free_field = Self { columns: Vec::new(), sides: Vec::new() };
        let mut made: Vec<(Model, BaseSegment)> = Vec::new();
        for (hand, wanted) in Hand::BOTH.into_iter().zip(wanted) {
            let (true, Some(side)) = (wanted, section.outline.sides[hand as usize]) else { continue };
            let model = column_model(section, hand);
            let segment = stage.base.at(side.x);
            let same =
                made.iter().position(|(other, arrival)| *arrival == segment && same_column(other, &model));
            let column = match (same, &stage.column_records[hand as usize]) {
                (Some(column), _) => column,
                (None, recorded) => {
                    free_field.columns.push(match recorded {
                        Some(record) => {
                            record.validate(model.nodes(), model.water.is_some(), stage.duration)?;
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
            free_field.sides.push(TiedSide {
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
        free_field.begin_shaking(section, stage)?;
        Ok(Some(free_field))
    }

    /// Begins a stage: columns are shaken by the wave that comes to their side.
    ///
    /// # Errors
    /// Soil that refuses its stress.
    pub fn begin_shaking(&mut self, section: &Section, stage: &Shaking) -> Result<(), SolverError> {
        let mut begun = vec![false; self.columns.len()];
        for k in 0..self.sides.len() {
            let TiedSide { hand, column, .. } = self.sides[k];
            let Some(side) = section.outline.sides[hand as usize] else { continue };
            if !std::mem::replace(&mut begun[column], true) {
                let of_column = Shaking {
                    run_out: None,
                    base: Base {
                        segments: vec![stage.base.at(side.x)],
                        datum: Some(stage.base.datum.unwrap_or_else(|| section.model.outline.lowest())),
                        ..stage.base.clone()
                    },
                    free_field: [false; 2],
                    column_records: [None, None],
                    record_columns: None,
                    probes: Vec::new(),
                    conditions: Vec::new(),
                    stress_histories: false,
                    pressure_envelope: false,
                    strain_envelope: false,
                    ..stage.clone()
                };
                let record = stage.column_records[hand as usize].as_ref();
                self.columns[column]
                    .begin_shaking(of_column, record, stage.record_columns)
                    .map_err(|error| on_side(hand, side.x, error))?;
            }
            (self.sides[k].dashpots, self.sides[k].trace) =
                side_dashpots(section, (hand, side), &self.columns[column])?;
        }
        self.renew(section);
        Ok(())
    }

    /// Builds columns and ties anew where nodes now are; pushes count from here.
    pub fn renew(&mut self, section: &Section) {
        for side in &mut self.sides {
            let column = &self.columns[side.column];
            side.tables = SideTables::new(section, side.hand);
            side.force = vec![Vec2::zeros(); side.tables.nodes.len()];
            side.targets = vec![0.0; side.dashpots.all().len()];
            side.begin_increments(column);
        }
    }

    /// Gives the columns the excess pressure of the section beside them, kPa, held in balance.
    pub fn set_excess(&mut self, edges: &EdgeNodes, excess: &[f64]) {
        for side in &mut self.sides {
            let column = &mut self.columns[side.column];
            column.set_excess(edges.sides[side.hand as usize].iter().map(|&node| excess[node]));
            side.begin_increments(column);
        }
    }

    /// Number of velocities that columns lend to the section.
    pub fn guests(&self) -> usize {
        self.sides.iter().map(|side| self.columns[side.column].rows()).sum()
    }

    /// Lets the section's strain see the velocities lent, which stand from index `nodes` on; once for each renewal.
    pub fn tie(&mut self, geometry: &mut Geometry, nodes: usize) {
        let mut first = id(nodes);
        for side in &mut self.sides {
            let (strain, divergence) =
                (std::mem::take(&mut side.tables.strain), std::mem::take(&mut side.tables.divergence));
            side.strained = strain.keys().copied().collect();
            geometry.see_guests(renumbered(strain, first), renumbered(divergence, first));
            first += id(self.columns[side.column].rows());
        }
    }

    /// Copies the columns' motion to where the section sees it.
    pub fn lend(&self, velocity: &mut [Vec2], acceleration: &mut [Vec2]) {
        let lent = self.sides.iter().flat_map(|side| {
            let present = self.columns[side.column].present();
            present.velocity.iter().zip(&present.acceleration)
        });
        for ((v, a), (lent_v, lent_a)) in velocity.iter_mut().zip(acceleration).zip(lent) {
            (*v, *a) = (*lent_v, *lent_a);
        }
    }

    /// Adds what the columns' present stress and pressure push to forces on all nodes, kN/m. The traction of their bases is
    /// no part of it: it passes.
    pub fn add_push(&mut self, force: &mut [Vec2]) {
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

    /// The columns that are solved.
    pub fn columns(&self) -> impl Iterator<Item = &Simulation> {
        self.columns.iter().filter_map(Column::simulation)
    }

    /// What the column of each side did in the stage, if it is kept; equal columns give it once for both.
    pub fn take_records(&mut self) -> [Option<ColumnRecord>; 2] {
        let taken: Vec<Option<ColumnRecord>> = self.columns.iter_mut().map(Column::take_record).collect();
        let mut records = [None, None];
        for side in &self.sides {
            records[side.hand as usize].clone_from(&taken[side.column]);
        }
        records
    }

    /// Renews the geometry of every column.
    pub fn renew_columns(&mut self) {
        for column in &mut self.columns {
            column.renew_geometry();
        }
    }

    /// The first half of a step: columns advance by `dt` (s), and the section's trace is remembered.
    ///
    /// # Errors
    /// A column that has diverged.
    pub fn begin_step(&mut self, dt: f64, velocity: &[Vec2]) -> Result<(), SolverError> {
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

    /// Refuses columns whose motion or pore pressure is no longer finite, or that run away.
    ///
    /// # Errors
    /// [`SolverError::Column`] with the first one and its node.
    pub fn guard(&self) -> Result<(), SolverError> {
        for (k, column) in self.columns.iter().enumerate() {
            let Some(simulation) = column.simulation() else { continue };
            simulation.guard().map_err(|error| of_column(&self.sides, k, error))?;
        }
        Ok(())
    }

    /// The pushes of the step, on velocities that the section's own forces have moved already.
    pub fn push(&self, dt: f64, mass: &[f64], velocity: &mut [Vec2], acceleration: &mut [Vec2]) {
        for side in &self.sides {
            for (&node, force) in side.tables.nodes.iter().zip(&side.force) {
                let pushed = force / mass[node];
                velocity[node] += pushed * dt;
                acceleration[node] += pushed;
            }
        }
    }

    /// The dashpots of the step: they pull towards the columns' motion.
    pub fn end_step(&mut self, dt: f64, mass: &[f64], velocity: &mut [Vec2], acceleration: &mut [Vec2]) {
        for side in &mut self.sides {
            let present = self.columns[side.column].present();
            let TiedSide { dashpots, trace, targets, .. } = side;
            // The column's motion as the section's own trace would read it.
            for (target, dashpot) in targets.iter_mut().zip(dashpots.all()) {
                let read = |(row, weight): (usize, &f64)| {
                    let twice = present.velocity[row] + present.velocity_before[row];
                    weight * twice.dot(&dashpot.direction)
                };
                *target = 0.5 * trace.iter_row(dashpot.point).map(read).sum::<f64>();
            }
            dashpots.end_step(dt, mass, (velocity, acceleration), |k| targets[k]);
        }
    }

    /// Energy that a step brings in, kJ/m: the work of pushes and dashpots, and that of the section's stress in the strain
    /// that the velocities lent give it, from which no force comes back. Velocities (m/s) have had all their forces,
    /// accelerations (m/s2) are those of the step, stress is that at its beginning.
    pub fn work(
        &self,
        dt: f64,
        (velocity, acceleration): (&[Vec2], &[Vec2]),
        (geometry, points): (&Geometry, &[StressPoint]),
    ) -> f64 {
        let path = |node: usize| (velocity[node] - acceleration[node] * (0.5 * dt)) * dt;
        let lent = velocity.len() - self.guests();
        let strained = |&s: &usize| {
            let StressPoint { stress, volume, deformation, .. } = &points[s];
            let nominal = deformation.cofactor().nominal(stress);
            let guests = geometry.wall.forward.iter_row(s).filter(|(column, _)| *column >= lent);
            guests.map(|(column, weight)| weight.contract(nominal).dot(&path(column)) * volume).sum::<f64>()
        };
        let of_side = |side: &TiedSide| {
            let pushed: f64 =
                side.tables.nodes.iter().zip(&side.force).map(|(&node, force)| force.dot(&path(node))).sum();
            pushed + side.dashpots.work(dt, velocity) + side.strained.iter().map(strained).sum::<f64>()
        };
        self.sides.iter().map(of_side).sum()
    }

    /// Bytes held, columns included.
    pub fn bytes(&self) -> usize {
        let side = |side: &TiedSide| {
            side.dashpots.bytes()
                + side.trace.bytes()
                + size_of_val(side.targets.as_slice())
                + size_of_val(side.tables.nodes.as_slice())
                + size_of_val(side.tables.base.as_slice())
                + side.tables.stress.bytes()
                + side.tables.pressure.bytes()
                + size_of_val(side.reference.as_slice())
                + size_of_val(side.reference_water.as_slice())
                + size_of_val(side.force.as_slice())
        };
        self.columns.iter().map(Column::bytes).sum::<usize>() + self.sides.iter().map(side).sum::<usize>()
    }
}

/// Rows of the column as velocities lent from index `first` on.
pub fn renumbered<T>(mut rows: BTreeMap<usize, Vec<(u32, T)>>, first: u32) -> BTreeMap<usize, Vec<(u32, T)>> {
    for (column, _) in rows.values_mut().flatten() {
        *column += first;
    }
    rows
}

/// An error of a column, told with the first side that it belongs to.
pub fn of_column(sides: &[TiedSide], column: usize, error: SolverError) -> SolverError {
    match sides.iter().find(|side| side.column == column) {
        Some(side) => on_side(side.hand, side.x, error),
        None => error,
    }
}

/// An error of the column at a side, told with its place.
pub fn on_side(hand: Hand, x: f64, mut error: SolverError) -> SolverError {
    if let SolverError::Diverged { x: told, .. } = &mut error {
        *told = x;
    }
    SolverError::Column { side: hand.name(), source: Box::new(error) }
}

impl TiedSide {
    /// Lets pushes count from what the column now is.
    fn begin_increments(&mut self, column: &Column) {
        self.reference.clone_from(&column.present().stress);
        self.reference_water.clone_from(&column.present().water);
    }

    /// Force of the increments of the column's stress and pressure on the section (Eq. 6 beyond the side).
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

pub fn difference(a: &[f64; 4], b: &[f64; 4]) -> [f64; 4] {
    [0, 1, 2, 3].map(|c| a[c] - b[c])
}

/// The soil at a side as a column between periodic sides.
pub fn column_model(section: &Section, hand: Hand) -> Model {
    let Section { model, outline, edges, .. } = section;
    let nodes = &edges.sides[hand as usize];
    // The column starts where the section did: its rest is found on the undeformed lattice.
    let x = nodes.first().map_or(0.0, |&node| model.position[node].x);
    let pick = |values: &[f64]| nodes.iter().filter_map(|&node| values.get(node).copied()).collect();
    let middle = 0.5 * model.spacing.x;
    Model {
        position: nodes.iter().map(|&node| Vec2::new(middle, model.position[node].y)).collect(),
        volume: pick(&model.volume),
        region: nodes.iter().map(|&node| model.region[node]).collect(),
        surface_elevation: pick(&model.surface_elevation),
        vertical_effective_stress: nodes
            .iter()
            .flat_map(|&node| [0, 1].map(|k| model.vertical_effective_stress[STRESS_NODES * node + k]))
            .collect(),
        pore_pressure: pick(&model.pore_pressure),
        saturation: pick(&model.saturation),
        period: Some(Period { width: model.spacing.x }),
        outline: Outline {
            base_support: outline.base_support,
            ..Outline::level(model.outline.base_elevation(x))
        },
        ..(*model).clone()
    }
}

/// Whether two columns are made of the same rows.
pub fn same_column(a: &Model, b: &Model) -> bool {
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

/// A dashpot across and one along the side for each of its rows, of the column's small-strain speeds, and the trace at
/// their points over the rows of the column.
pub fn side_dashpots(
    section: &Section,
    (hand, side): (Hand, Side),
    column: &Column,
) -> Result<(Dashpots, Csr<f64>), SolverError> {
    let Section { model, position, edges, .. } = section;
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

/// Rows of the column at a side, by their elevation on the undeformed lattice.
pub struct Rows {
    lowest: f64,
    spacing: f64,
    last: usize,
}

impl Rows {
    fn of(section: &Section, hand: Hand) -> Self {
        let side = &section.edges.sides[hand as usize];
        let lowest = side.first().map_or(0.0, |&node| section.model.position[node].y);
        Self { lowest, spacing: section.model.spacing.y, last: side.len().saturating_sub(1) }
    }

    fn height(&self, y: f64) -> f64 {
        ((y - self.lowest) / self.spacing).round()
    }

    /// The row at an elevation, or the column's end for what stands higher or lower.
    fn nearest(&self, y: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to the rows
        let row = self.height(y).clamp(0.0, self.last as f64) as usize;
        row
    }

    /// The row at an elevation, if the column has one.
    fn at(&self, y: f64) -> Option<usize> {
        let row = self.nearest(y);
        (self.height(y) == row as f64).then_some(row)
    }
}

impl SideTables {
    fn new(section: &Section, hand: Hand) -> Self {
        match section.model.numerics.operators {
            Operators::Conservative => Self::completed(section, hand),
            Operators::Printed => Self::on_outermost_row(section, hand),
        }
    }

    /// The column's traction on the outermost node of each row.
    fn on_outermost_row(section: &Section, hand: Hand) -> Self {
        let nodes = section.edges.sides[hand as usize].clone();
        let outward = hand.normal() * section.model.spacing.y;
        let (mut stress, mut pressure) =
            (Csr::with_capacity(nodes.len(), 0), Csr::with_capacity(nodes.len(), 0));
        for row in 0..nodes.len() {
            let share = VectorWeight::plain(-outward / STRESS_NODES as f64);
            stress.push_row(&mut [0, 1].map(|k| (id(STRESS_NODES * row + k), share)));
            let wet = section.model.water.is_some();
            pressure.push_row(&mut if wet { vec![(id(row), -outward)] } else { Vec::new() });
        }
        Self { base: vec![0.0; nodes.len()], stress, pressure, nodes, ..Self::default() }
    }

    /// Weights of stencils completed by the column beyond the side, less those of the cut ones.
    fn completed(section: &Section, hand: Hand) -> Self {
        let model = section.model;
        let strip = Strip::new(section, hand);
        let cut = strip.around(section, section.outline, strip.local.len());
        let without_side = Outline { sides: [None, None], ..section.outline.clone() };
        let whole = strip.around(section, &without_side, strip.position.len());
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let list = |queries: &[Vec2], around: &Surroundings| {
            NeighbourList::build(queries, &around.sources, kernel.support(), 0.0, None)
        };
        let stencils = |around| Stencils { around, volume: &strip.volume, kernel, period: None };
        let (cut_stencils, whole_stencils) = (stencils(&cut), stencils(&whole));
        let negligible = NO_DIFFERENCE / model.mean_spacing();

        let mut tables = Self::default();
        let mut stress: Vec<Vec<(u32, VectorWeight)>> = vec![Vec::new(); strip.local.len()];
        let stress_position = stress_node_positions(&strip.position, model.spacing);
        let (in_cut, in_whole) = (list(&stress_position, &cut), list(&stress_position, &whole));
        for (s, &at) in stress_position.iter().enumerate() {
            let (node, k) = (s / STRESS_NODES, s % STRESS_NODES);
            let mut weights: BTreeMap<u32, VectorWeight> = BTreeMap::new();
            let mut take = |stencils: &Stencils, list: &NeighbourList, sign: f64| {
                let Some(found) = StrainRow::least_squares(stencils, &stencils.all(list, s, at)) else {
                    return;
                };
                let free = found.free.iter().map(|(owner, g)| (*owner, VectorWeight::plain(g.gradient)));
                for (owner, mut weight) in free.chain(found.walls) {
                    weight *= sign;
                    *weights.entry(owner).or_default() += weight;
                }
            };
            take(&whole_stencils, &in_whole, 1.0);
            if node < strip.local.len() {
                take(&cut_stencils, &in_cut, -1.0);
            }
            // Seen from here the column's soil stands on both sides: nodes of its rows move as it does.
            let near = weights.values().any(|weight| weight.magnitude() > negligible);
            if node < strip.local.len() && near {
                let rows =
                    weights.iter().map(|(&owner, &weight)| (id(strip.row_or_end[owner as usize]), weight));
                tables.strain.insert(STRESS_NODES * strip.local[node] + k, rows.collect());
            }
            let Some(row) = strip.row[node] else { continue };
            for (owner, mut weight) in weights {
                if (owner as usize) < strip.local.len() && weight.magnitude() > negligible {
                    weight *= strip.volume[node] / STRESS_NODES as f64;
                    stress[owner as usize].push((id(STRESS_NODES * row + k), weight));
                }
            }
        }

        let mut pressure: Vec<Vec<(u32, Vec2)>> = vec![Vec::new(); strip.local.len()];
        if model.water.is_some() {
            let (in_cut, in_whole) = (list(&strip.position, &cut), list(&strip.position, &whole));
            for (node, &at) in strip.position.iter().enumerate() {
                let mut weights: BTreeMap<u32, Vec2> = BTreeMap::new();
                let mut take = |stencils: &Stencils, list: &NeighbourList, sign: f64| {
                    for (owner, weight) in divergence_row(stencils, &stencils.all(list, node, at), id(node)) {
                        *weights.entry(owner).or_default() += weight * sign;
                    }
                };
                take(&whole_stencils, &in_whole, 1.0);
                if node < strip.local.len() {
                    take(&cut_stencils, &in_cut, -1.0);
                }
                let near = weights.values().any(|weight| weight.norm() > negligible);
                if node < strip.local.len() && near {
                    let rows = weights
                        .iter()
                        .map(|(&owner, &weight)| (id(strip.row_or_end[owner as usize]), weight));
                    tables.divergence.insert(strip.local[node], rows.collect());
                }
                let Some(row) = strip.row[node] else { continue };
                for (owner, weight) in weights {
                    if (owner as usize) < strip.local.len() && weight.norm() > negligible {
                        pressure[owner as usize].push((id(row), weight * strip.volume[node]));
                    }
                }
            }
        }

        let base = strip.base_lengths(section, hand, kernel);
        for (local, &node) in strip.local.iter().enumerate() {
            if stress[local].is_empty() && pressure[local].is_empty() && base[local] == 0.0 {
                continue;
            }
            tables.nodes.push(node);
            tables.stress.push_row(&mut stress[local]);
            tables.pressure.push_row(&mut pressure[local]);
            tables.base.push(base[local]);
        }
        tables
    }
}

/// The nodes near a side, and beyond it the column again and again, as far as stencils reach.
pub struct Strip {
    /// Nodes of the section near the side.
    local: Vec<usize>,
    /// Their positions, then those of the repeated column, m.
    position: Vec<Vec2>,
    volume: Vec<f64>,
    /// Row of the column at the height of each; none beside a slope that stands higher.
    row: Vec<Option<usize>>,
    /// The same, with the column's end for what stands higher or lower.
    row_or_end: Vec<usize>,
}

impl Strip {
    fn new(section: &Section, hand: Hand) -> Self {
        let Section { model, edges, position, phases, .. } = section;
        let reach = 2.0 * WendlandQuintic::new(model.smoothing_length()).support();
        let side = &edges.sides[hand as usize];
        let outer =
            side.iter().map(|&node| position[node].dot(&hand.normal())).fold(f64::NEG_INFINITY, f64::max);
        let local: Vec<usize> = (0..position.len())
            .filter(|&node| outer - position[node].dot(&hand.normal()) < reach + model.spacing.x)
            .collect();
        let rows = Rows::of(section, hand);
        let mut strip = Self {
            position: local.iter().map(|&node| position[node]).collect(),
            volume: local.iter().map(|&node| phases.volume()[node]).collect(),
            row: local.iter().map(|&node| rows.at(model.position[node].y)).collect(),
            row_or_end: local.iter().map(|&node| rows.nearest(model.position[node].y)).collect(),
            local,
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful of columns
        let repeats = (reach / model.spacing.x).ceil() as usize + 1;
        for repeat in 1..=repeats {
            for (row, &node) in side.iter().enumerate() {
                strip.position.push(position[node] + hand.normal() * (repeat as f64 * model.spacing.x));
                strip.volume.push(phases.volume()[node]);
                strip.row.push(Some(row));
                strip.row_or_end.push(row);
            }
        }
        strip
    }

    /// The first `count` nodes and their images.
    fn around(&self, section: &Section, outline: &Outline, count: usize) -> Surroundings {
        let reach = WendlandQuintic::new(section.model.smoothing_length()).support();
        Surroundings::new(&self.position[..count], outline, section.walls, reach)
    }

    /// Length of base, m, whose traction acts on each node of the strip through a completed trace, less that of the cut
    /// one.
    fn base_lengths(&self, section: &Section, hand: Hand, kernel: WendlandQuintic) -> Vec<f64> {
        let mut lengths = vec![0.0; self.local.len()];
        let Some(&corner) = section.edges.sides[hand as usize].first() else { return lengths };
        let on_base = |node: usize| section.edges.base.contains(&node);
        if !on_base(corner) || section.model.outline.base.is_empty() {
            return lengths;
        }
        let (model, outline) = (section.model, section.outline);
        let side_rows = section.edges.sides[hand as usize].len();
        let lowest = self.local.iter().enumerate().filter(|(_, node)| on_base(**node)).map(|(k, _)| k);
        let beyond = (self.local.len()..self.position.len()).step_by(side_rows.max(1));
        let columns: Vec<usize> = lowest.chain(beyond).collect();
        let points: Vec<Vec2> = columns
            .iter()
            .map(|&k| Vec2::new(self.position[k].x, outline.base_elevation(self.position[k].x)))
            .collect();
        for (count, sign) in [(self.position.len(), 1.0), (self.local.len(), -1.0)] {
            let around = Surroundings::bare(&self.position[..count]);
            let list = NeighbourList::build(&points, &around.sources, kernel.support(), 0.0, None);
            let stencils = Stencils { around: &around, volume: &self.volume, kernel, period: None };
            for (k, (&column, &at)) in columns.iter().zip(&points).enumerate() {
                if column >= count {
                    continue;
                }
                let members = stencils.all(&list, k, at);
                let Ok(fit) = LeastSquaresFit::new(&members, kernel) else { continue };
                let length = sign * model.spacing.x / -outline.base_normal(at.x).y;
                for (k, member) in members.iter().enumerate() {
                    if let Some(sum) = lengths.get_mut(member.owner as usize) {
                        *sum += length * fit.value_weight(k, member);
                    }
                }
            }
        }
        let round_off = NO_DIFFERENCE * model.mean_spacing();
        lengths.iter().map(|length| if length.abs() > round_off { *length } else { 0.0 }).collect()
    }
}
