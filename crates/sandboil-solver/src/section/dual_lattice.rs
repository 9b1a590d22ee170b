//! Stress points on the dual lattice: at the corners of the nodes' cells, exactly on surface, base and sides.
//!
//! A corner where cells of several soils meet has one point for each soil, with the part of the volume that the cells of
//! that soil have. All points of a corner have the same strain and the same pore pressure: they are at one place.

use crate::section::{description::Model, edge_nodes::EdgeNodes, node_id::id, outline::Hand};
use sandboil_sph::Vec2;
use std::collections::BTreeMap;

/// Corners of a cell.
pub const CORNERS: usize = 4;
/// Distance from an edge, over the spacing, up to which a corner lies on it: far above rounding.
const ON_EDGE: f64 = 1e-6;
/// Least part of the surroundings of a full corner that is ground. The corner at the foot of a step, with three quarters,
/// has as many neighbours inside as one in full ground.
const FULL: f64 = 0.7;
/// Distance in spacings within which a corner joins a full one.
const REACH: i64 = 2;

/// Stress points at the corners of cells.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct DualLattice {
    /// Present positions, m; updated when the geometry is renewed.
    pub position: Vec<Vec2>,
    /// Positions of the nodes when those of the points were last updated, m.
    pub nodes_at: Vec<Vec2>,
    /// The edges on which each point lies.
    pub on: Vec<OnEdges>,
    /// Volume at rest, m2: a quarter of each cell of the point's soil that touches it.
    pub volume: Vec<f64>,
    /// A node of the point's soil whose cell touches it.
    pub node: Vec<u32>,
    /// The four points of the node's soil at the corners of each cell, counter-clockwise from the lower left.
    pub of_node: Vec<[u32; CORNERS]>,
    /// Place of each point.
    pub place: Vec<u32>,
    /// The first point at each place.
    pub first: Vec<u32>,
    /// Whether cells above a base that is not level are stretched to it.
    pub is_stretched: bool,
    /// Whether each place lies on a free surface.
    pub is_free: Vec<bool>,
    /// Groups of points that share one volume strain; the points of no group are not listed.
    pub groups: Vec<Vec<u32>>,
    /// Group of each point.
    pub group: Vec<Option<u32>>,
}

/// Edges on which a point lies at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct OnEdges {
    /// The base.
    pub base: bool,
    /// One of the sides.
    pub side: Option<Hand>,
}

impl OnEdges {
    fn at(model: &Model, at: Vec2) -> Self {
        let Model { outline, spacing, .. } = model;
        let foot = outline.nearest_on_base(at);
        let is_on_side = |hand: Hand| {
            outline.sides[hand as usize].is_some_and(|side| (at.x - side.x).abs() < ON_EDGE * spacing.x)
        };
        Self {
            base: foot.is_some_and(|(foot, _)| (foot - at).norm() < ON_EDGE * model.mean_spacing()),
            side: Hand::BOTH.into_iter().find(|&hand| is_on_side(hand)),
        }
    }

    /// Parts into which the edges cut the surroundings of the point.
    fn parts(self) -> f64 {
        let halved = |is_cut: bool| if is_cut { 2.0 } else { 1.0 };
        halved(self.base) * halved(self.side.is_some())
    }
}

/// Row and column of a corner on the lattice: that of the cell to its upper right.
type Corner = (i64, i64);

/// Cells of a column between a base that is not level and the first regular row above.
#[derive(Debug, Clone, Copy)]
struct Stretched {
    /// Row of the lowest cell.
    row: i64,
    /// Number of these cells, all of one height.
    cells: i64,
    /// Their height, m.
    height: f64,
    /// Elevation of the base below their middle, m.
    base: f64,
}

/// Rows and columns of the lattice.
struct Lattice<'a> {
    model: &'a Model,
    /// Middle of a regular cell, m.
    first: Vec2,
    /// Number of columns between periodic sides.
    columns: Option<i64>,
    /// Columns of cells that reach down to a base that is not level.
    cells: BTreeMap<i64, Stretched>,
    /// For each column of corners above such a base, the row of the corner on it, and the number of rows from there up to
    /// the first regular one.
    corners: BTreeMap<i64, (i64, i64)>,
}

impl<'a> Lattice<'a> {
    fn new(model: &'a Model) -> Self {
        let columns = model.period.map(|period| whole(period.width / model.spacing.x));
        let least = |nodes: &mut dyn Iterator<Item = &Vec2>| {
            nodes.fold(Vec2::repeat(f64::INFINITY), |low, x| low.inf(x))
        };
        let first = least(&mut model.position.iter());
        let is_regular = |node: &usize| (model.volume[*node] - model.cell()).abs() < ON_EDGE * model.cell();
        let regular = least(&mut (0..model.nodes()).filter(is_regular).map(|node| &model.position[node]));
        let lowest = if regular.y.is_finite() { regular.y } else { first.y };
        let (cells, corners) = (BTreeMap::new(), BTreeMap::new());
        let mut lattice = Self { model, first: Vec2::new(first.x, lowest), columns, cells, corners };
        if !model.is_even_on(&model.outline) {
            lattice.stretch();
        }
        lattice
    }

    fn column(&self, x: f64) -> i64 {
        whole((x - self.first.x) / self.model.spacing.x)
    }

    /// Finds the cells and corners that are off their rows.
    fn stretch(&mut self) {
        let Model { spacing, position, volume, outline, .. } = self.model;
        let mut columns: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for (node, at) in position.iter().enumerate() {
            columns.entry(self.column(at.x)).or_default().push(node);
        }
        for lowest in EdgeNodes::new(self.model).base {
            let (x, height) = (position[lowest].x, volume[lowest] / spacing.x);
            let base = outline.base_elevation(x);
            // The row of the lattice next to the base: above it if the cells are stretched, below it if compressed.
            let rows = (base - self.first.y) / spacing.y + 0.5;
            let row = if height > spacing.y { (rows - ON_EDGE).ceil() } else { (rows + ON_EDGE).floor() };
            let is_alike = |node: &&usize| (volume[**node] / spacing.x - height).abs() < ON_EDGE * spacing.y;
            let column = self.column(x);
            let alike = columns[&column].iter().filter(is_alike).count();
            let is_regular = (height - spacing.y).abs() < ON_EDGE * spacing.y;
            let cells = if is_regular { 1 } else { i64::try_from(alike).unwrap_or(i64::MAX) };
            self.cells.insert(column, Stretched { row: whole(row), cells, height, base });
        }
        // Between two columns the higher row of the two, so that corners of neighbours meet.
        for (&column, own) in &self.cells {
            for beside in [column, column + 1] {
                let (_, beside) = self.wrapped((0, beside));
                let (row, top) = (own.row, own.row + own.cells);
                self.corners
                    .entry(beside)
                    .and_modify(|(highest, rows)| {
                        let lower_top = top.min(*highest + *rows);
                        *highest = row.max(*highest);
                        *rows = (lower_top - *highest).max(1);
                    })
                    .or_insert((row, own.cells));
            }
        }
    }

    /// Row and column of a node's cell.
    fn cell(&self, at: Vec2) -> Corner {
        let column = self.column(at.x);
        let row = match self.cells.get(&column) {
            Some(cells) if at.y < cells.base + cells.cells as f64 * cells.height => {
                cells.row + whole((at.y - cells.base) / cells.height - 0.5)
            }
            _ => whole((at.y - self.first.y) / self.model.spacing.y),
        };
        (row, column)
    }

    fn wrapped(&self, (row, column): Corner) -> Corner {
        (row, self.columns.map_or(column, |columns| column.rem_euclid(columns)))
    }

    /// Corners of a cell, counter-clockwise from the lower left. Those below the base are on it: two corners of a cell may
    /// be one.
    fn corners(&self, (row, column): Corner) -> [Corner; CORNERS] {
        [(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)].map(|corner| {
            let (row, column) = self.wrapped(corner);
            (self.corners.get(&column).map_or(row, |&(base, _)| row.max(base)), column)
        })
    }

    fn position(&self, (row, column): Corner) -> Vec2 {
        let Model { spacing, outline, .. } = self.model;
        let steps = Vec2::new(column as f64 - 0.5, row as f64 - 0.5);
        let at = self.first + steps.component_mul(spacing);
        let Some(&(base, rows)) = self.corners.get(&column) else { return at };
        let above = row - base;
        if above >= rows {
            return at;
        }
        let top = at.y + (rows - above) as f64 * spacing.y;
        let below = outline.base_elevation(at.x);
        Vec2::new(at.x, below + above as f64 / rows as f64 * (top - below))
    }
}

fn whole(value: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // far fewer cells than 2^63
    let count = value.round() as i64;
    count
}

impl DualLattice {
    /// The points of a section at rest, sorted by region, row and column.
    pub fn new(model: &Model) -> Self {
        let lattice = Lattice::new(model);
        // Volume and first node of each point.
        let mut points: BTreeMap<(u32, Corner), (f64, u32)> = BTreeMap::new();
        // Cells that touch each corner.
        let mut corners: BTreeMap<Corner, f64> = BTreeMap::new();
        for (node, (&at, &volume)) in model.position.iter().zip(&model.volume).enumerate() {
            for corner in lattice.corners(lattice.cell(at)) {
                let quarter = volume / CORNERS as f64;
                points.entry((model.region[node], corner)).or_insert((0.0, id(node))).0 += quarter;
                *corners.entry(corner).or_default() += 1.0;
            }
        }
        let index: BTreeMap<_, _> = points.keys().enumerate().map(|(point, key)| (*key, id(point))).collect();
        let place_of: BTreeMap<_, _> =
            corners.keys().enumerate().map(|(place, corner)| (*corner, id(place))).collect();
        let place: Vec<u32> = points.keys().map(|(_, corner)| place_of[corner]).collect();
        let mut first = vec![u32::MAX; corners.len()];
        for (point, place) in place.iter().enumerate() {
            let first = &mut first[*place as usize];
            *first = (*first).min(id(point));
        }
        let of_node = (0..model.nodes()).map(|node| {
            let corners = lattice.corners(lattice.cell(model.position[node]));
            corners.map(|corner| index[&(model.region[node], corner)])
        });
        let on = |corner: &Corner| OnEdges::at(model, lattice.position(*corner));
        // The part of the surroundings that is ground, with the images beyond base and sides.
        let whole: BTreeMap<Corner, f64> = corners
            .iter()
            .map(|(corner, cells)| (*corner, on(corner).parts() * cells / CORNERS as f64))
            .collect();
        let mut dual = Self {
            position: points.keys().map(|(_, corner)| lattice.position(*corner)).collect(),
            nodes_at: model.position.clone(),
            on: points.keys().map(|(_, corner)| on(corner)).collect(),
            volume: points.values().map(|(volume, _)| *volume).collect(),
            node: points.values().map(|(_, node)| *node).collect(),
            of_node: of_node.collect(),
            place,
            first,
            is_stretched: !lattice.cells.is_empty(),
            is_free: whole.values().map(|part| *part < 1.0 - ON_EDGE).collect(),
            groups: Vec::new(),
            group: vec![None; points.len()],
        };
        dual.form_groups(model, &lattice, &whole, &place_of);
        dual
    }

    /// Joins every corner that is not full to the nearest full one: a row of corners at a free surface has as many volume
    /// constraints as one inside, and half of the freedoms.
    fn form_groups(
        &mut self,
        model: &Model,
        lattice: &Lattice,
        whole: &BTreeMap<Corner, f64>,
        place_of: &BTreeMap<Corner, u32>,
    ) {
        let is_full = |corner: &Corner| whole.get(corner).is_some_and(|part| *part >= FULL);
        let mut members: BTreeMap<Corner, Vec<Corner>> = BTreeMap::new();
        for corner in whole.keys().filter(|corner| !is_full(corner)) {
            let near = (-REACH..=REACH).flat_map(|up| (-REACH..=REACH).map(move |right| (up, right)));
            let nearest = near
                .map(|(up, right)| {
                    let offset = Vec2::new(right as f64, up as f64).component_mul(&model.spacing);
                    (offset.norm_squared(), lattice.wrapped((corner.0 + up, corner.1 + right)))
                })
                .filter(|(_, other)| is_full(other))
                .min_by(|(a, first), (b, second)| a.total_cmp(b).then(first.cmp(second)));
            if let Some((_, full)) = nearest {
                members.entry(full).or_default().push(*corner);
            }
        }
        let mut at_place: Vec<Vec<u32>> = vec![Vec::new(); self.first.len()];
        for (point, place) in self.place.iter().enumerate() {
            at_place[*place as usize].push(id(point));
        }
        for (full, joined) in members {
            let places = std::iter::once(full).chain(joined).map(|corner| place_of[&corner] as usize);
            let group: Vec<u32> = places.flat_map(|place| at_place[place].iter().copied()).collect();
            for point in &group {
                self.group[*point as usize] = Some(id(self.groups.len()));
            }
            self.groups.push(group);
        }
    }

    /// Number of places.
    pub fn places(&self) -> usize {
        self.first.len()
    }

    /// Sums a value of the points over each place.
    pub fn at_places(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.places()];
        for (point, place) in self.place.iter().enumerate() {
            sums[*place as usize] += value(point);
        }
        sums
    }

    /// Present positions of the places, m.
    pub fn place_positions(&self) -> Vec<Vec2> {
        self.first.iter().map(|&point| self.position[point as usize]).collect()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.position.as_slice())
            + size_of_val(self.nodes_at.as_slice())
            + size_of_val(self.on.as_slice())
            + size_of_val(self.volume.as_slice())
            + size_of_val(self.node.as_slice())
            + size_of_val(self.of_node.as_slice())
            + size_of_val(self.place.as_slice())
            + size_of_val(self.first.as_slice())
            + size_of_val(self.group.as_slice())
            + self.is_free.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{section::outline::Outline, testing::square_block};

    fn at(dual: &DualLattice, x: f64, y: f64) -> usize {
        dual.position.iter().position(|at| (at - Vec2::new(x, y)).norm() < 1e-9).unwrap()
    }

    /// Corners take quarters of the cells around them; at a free surface they share the strain of the nearest full one.
    #[test]
    fn corners_share_cells_and_strain() {
        let dual = DualLattice::new(&square_block(3));
        assert_eq!((dual.position.len(), dual.places()), (16, 16));
        assert!((dual.volume.iter().sum::<f64>() - 9.0).abs() < 1e-14);
        let volumes = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)].map(|(x, y)| dual.volume[at(&dual, x, y)]);
        assert_eq!(volumes, [0.25, 0.5, 1.0]);
        let group = |x: f64, y: f64| dual.group[at(&dual, x, y)];
        assert_eq!(group(-0.5, -0.5), group(0.5, 0.5));
        assert_eq!(group(0.5, -0.5), group(0.5, 0.5));
        assert_ne!(group(0.5, 0.5), group(1.5, 0.5));
        assert!(dual.groups.iter().all(|group| group.len() == 4));
    }

    /// A base continues the ground: its corners are full, and belong to no group away from the sides.
    #[test]
    fn corners_on_a_base_are_full() {
        let mut model = square_block(4);
        model.outline = Outline::level(-0.5);
        let dual = DualLattice::new(&model);
        let on_base = at(&dual, 1.5, -0.5);
        assert!(dual.on[on_base].base && !dual.is_free[dual.place[on_base] as usize]);
        assert_eq!(dual.group[on_base], None);
    }

    /// Where two soils meet each has its own points, at the same places.
    #[test]
    fn soils_have_their_own_points() {
        let mut model = square_block(3);
        model.regions.push(model.regions[0].clone());
        model.region = vec![0, 0, 0, 0, 0, 0, 1, 1, 1];
        let dual = DualLattice::new(&model);
        assert_eq!((dual.position.len(), dual.places()), (20, 16));
        let both: Vec<usize> = (0..dual.position.len())
            .filter(|&s| (dual.position[s] - Vec2::new(0.5, 1.5)).norm() < 1e-9)
            .collect();
        assert_eq!(both.len(), 2);
        assert_eq!(both.iter().map(|&s| dual.volume[s]).collect::<Vec<_>>(), [0.5, 0.5]);
        assert_eq!(dual.place[both[0]], dual.place[both[1]]);
        let regions: Vec<u32> = both.iter().map(|&s| model.region[dual.node[s] as usize]).collect();
        assert_eq!(regions, [0, 1]);
    }
}
