//! Weights of a free-field column in the force and strain of the section beside it: the weights of complete
//! stencils, which contain the column beyond the side, minus the weights of stencils cut at the side.

use crate::{
    section::{
        description::{Operators, STRESS_NODES},
        node_id::id,
        outline::{Hand, Outline},
    },
    skeleton::section_view::SectionView,
    weights::{
        images::Surroundings,
        points::stress_node_positions,
        rows::{StrainRow, VectorWeight, divergence_row},
        stencils::Stencils,
    },
};
use sandboil_sph::{Csr, LeastSquaresFit, NeighbourList, Vec2, WendlandQuintic};
use std::collections::{BTreeMap, BTreeSet};

/// Difference of the weights of a complete and a cut stencil that is still round-off, times the spacing.
pub const NO_DIFFERENCE: f64 = 1e-12;

/// Weights of the column's stress, pressure and base traction in the force on nodes near a side.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct SideTables {
    /// Nodes on which the column acts.
    pub nodes: Vec<usize>,
    /// Volume times weight: rows are `nodes`, columns the stress nodes of the column's rows.
    pub stress: Csr<VectorWeight>,
    /// Volume times weight: rows are `nodes`, columns the column's rows; empty without water.
    pub pressure: Csr<Vec2>,
    /// Length of base whose traction the trace that is cut at the side leaves out, m.
    pub base: Vec<f64>,
    /// Weights of the column's velocities in the section's strain, for each stress node near the side, with
    /// indices of rows of the column. They are moved to the section's geometry.
    pub strain: BTreeMap<usize, Vec<(u32, VectorWeight)>>,
    /// Weights of the same velocities in the divergence at nodes.
    pub divergence: BTreeMap<usize, Vec<(u32, Vec2)>>,
}

/// Rows of the column at a side, found by their elevation on the undeformed lattice.
pub struct Rows {
    lowest: f64,
    spacing: f64,
    last: usize,
}

impl Rows {
    /// The rows at a side.
    pub fn of(section: &SectionView, hand: Hand) -> Self {
        let side = &section.edges.sides[hand as usize];
        let lowest = side.first().map_or(0.0, |&node| section.model.position[node].y);
        Self { lowest, spacing: section.model.spacing.y, last: side.len().saturating_sub(1) }
    }

    fn height(&self, y: f64) -> f64 {
        ((y - self.lowest) / self.spacing).round()
    }

    /// The row at an elevation (m); above or below the column its last or first row.
    pub fn nearest(&self, y: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to the rows
        let row = self.height(y).clamp(0.0, self.last as f64) as usize;
        row
    }

    /// The row at an elevation (m), if the column has one.
    fn at(&self, y: f64) -> Option<usize> {
        let row = self.nearest(y);
        (self.height(y) == row as f64).then_some(row)
    }
}

impl SideTables {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.base.as_slice())
            + self.stress.bytes()
            + self.pressure.bytes()
    }

    /// Tables for the present positions of the section.
    pub fn new(section: &SectionView, hand: Hand) -> Self {
        match section.model.numerics.operators {
            Operators::Conservative | Operators::Dual => Self::completed(section, hand),
            Operators::Printed => Self::on_outermost_row(section, hand),
        }
    }

    /// The column's traction on the outermost node of each row.
    fn on_outermost_row(section: &SectionView, hand: Hand) -> Self {
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

    /// Weights of complete stencils minus those of stencils cut at the side.
    fn completed(section: &SectionView, hand: Hand) -> Self {
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
        let points = strip.stress_points(section, hand);
        let places: Vec<Vec2> = points.iter().map(|point| point.at).collect();
        let (in_cut, in_whole) = (list(&places, &cut), list(&places, &whole));
        for (s, point) in points.iter().enumerate() {
            let row = |stencils: &Stencils, list: &NeighbourList| {
                StrainRow::least_squares(stencils, &stencils.all(list, s, point.at))
            };
            let whole = row(&whole_stencils, &in_whole);
            let cut = point.in_section.and_then(|_| row(&cut_stencils, &in_cut));
            // Weights of the complete stencil times `factor`, minus those of the cut one.
            let difference = |factor: f64| {
                let mut weights: BTreeMap<u32, VectorWeight> = BTreeMap::new();
                for (found, factor) in [(&whole, factor), (&cut, -1.0)] {
                    let Some(found) = found else { continue };
                    let free = found.free.iter().map(|(owner, g)| (*owner, VectorWeight::plain(g.gradient)));
                    for (owner, mut weight) in free.chain(found.walls.iter().copied()) {
                        weight *= factor;
                        *weights.entry(owner).or_default() += weight;
                    }
                }
                weights
            };
            let weights = difference(1.0);
            // In these weights every node moves as the row of the column at its height.
            let near = weights.values().any(|weight| weight.magnitude() > negligible);
            if let (Some(s), true) = (point.in_section, near) {
                let rows =
                    weights.iter().map(|(&owner, &weight)| (id(strip.row_or_end[owner as usize]), weight));
                tables.strain.insert(s, rows.collect());
            }
            let Some(of_column) = point.of_column else { continue };
            let weights = if point.parts == 1.0 { weights } else { difference(point.parts) };
            for (owner, mut weight) in weights {
                if (owner as usize) < strip.local.len() && weight.magnitude() > negligible {
                    weight *= point.volume;
                    stress[owner as usize].push((id(of_column), weight));
                }
            }
        }

        let mut pressure: Vec<Vec<(u32, Vec2)>> = vec![Vec::new(); strip.local.len()];
        if model.has_nodal_water() {
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

/// A stress point near a side.
struct StripPoint {
    at: Vec2,
    /// Index in the section; none beyond the side.
    in_section: Option<usize>,
    /// Index among the stresses of the column; none above and below the column.
    of_column: Option<usize>,
    /// Volume, m2; in the section the part that belongs to it.
    volume: f64,
    /// The volume of the point in ground that continues beyond the side, over its volume.
    parts: f64,
}

/// The nodes near a side, and copies of the column beyond it, as far as stencils reach.
struct Strip {
    /// Nodes of the section near the side.
    local: Vec<usize>,
    /// Positions of these nodes, then of the copies of the column, m.
    position: Vec<Vec2>,
    volume: Vec<f64>,
    /// Row of the column at the height of each node; `None` above and below the column.
    row: Vec<Option<usize>>,
    /// The same, with the last row above the column and the first row below it.
    row_or_end: Vec<usize>,
    rows: Rows,
    /// Distance from the side within which nodes belong to the strip, m.
    reach: f64,
}

impl Strip {
    fn new(section: &SectionView, hand: Hand) -> Self {
        let SectionView { model, edges, position, phases, .. } = section;
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
            rows,
            reach,
        };
        for shift in strip.shifts(section, hand) {
            for (row, &node) in side.iter().enumerate() {
                strip.position.push(position[node] + shift);
                strip.volume.push(phases.volume()[node]);
                strip.row.push(Some(row));
                strip.row_or_end.push(row);
            }
        }
        strip
    }

    /// Displacements from the section's outermost nodes to the copies beyond them, m.
    fn shifts(&self, section: &SectionView, hand: Hand) -> impl Iterator<Item = Vec2> + use<> {
        let spacing = section.model.spacing.x;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
        let repeats = (self.reach / spacing).ceil() as usize + 1;
        (1..=repeats).map(move |repeat| hand.normal() * (repeat as f64 * spacing))
    }

    /// The stress points of the strip.
    fn stress_points(&self, section: &SectionView, hand: Hand) -> Vec<StripPoint> {
        let SectionView { model, layout, points, .. } = section;
        let of_column = |node: usize, point: usize| {
            self.rows.at(model.position[node].y).map(|row| STRESS_NODES * row + layout.level(point))
        };
        let Some(dual) = layout.dual() else {
            let places = stress_node_positions(&self.position, model.spacing);
            let point = |(s, at): (usize, Vec2)| {
                let (node, k) = (s / STRESS_NODES, s % STRESS_NODES);
                StripPoint {
                    at,
                    in_section: self.local.get(node).map(|&node| STRESS_NODES * node + k),
                    of_column: self.row[node].map(|row| STRESS_NODES * row + k),
                    volume: self.volume[node] / STRESS_NODES as f64,
                    parts: 1.0,
                }
            };
            return places.into_iter().enumerate().map(point).collect();
        };
        let is_on_side = |s: usize| dual.on[s].side == Some(hand);
        let near: BTreeSet<usize> =
            self.local.iter().flat_map(|&node| dual.of_node[node].map(|s| s as usize)).collect();
        // Ground that continues beyond the side has as much of a point on it as the section.
        let continued = 2.0;
        let own = near.iter().map(|&s| StripPoint {
            at: dual.position[s],
            in_section: Some(s),
            of_column: of_column(dual.node[s] as usize, s),
            volume: points[s].volume,
            parts: if is_on_side(s) { continued } else { 1.0 },
        });
        let beyond = self.shifts(section, hand).flat_map(|shift| {
            near.iter().filter(|&&s| is_on_side(s)).map(move |&s| StripPoint {
                at: dual.position[s] + shift,
                in_section: None,
                of_column: of_column(dual.node[s] as usize, s),
                volume: continued * points[s].volume,
                parts: 1.0,
            })
        });
        own.chain(beyond).collect()
    }

    /// The first `count` nodes with their images.
    fn around(&self, section: &SectionView, outline: &Outline, count: usize) -> Surroundings {
        let reach = WendlandQuintic::new(section.model.smoothing_length()).support();
        Surroundings::new(&self.position[..count], outline, section.walls, reach)
    }

    /// Length of base, m, whose traction acts on each node of the strip through a complete trace, minus the
    /// length through the trace that is cut at the side.
    fn base_lengths(&self, section: &SectionView, hand: Hand, kernel: WendlandQuintic) -> Vec<f64> {
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
