//! Neighbour search with a counting sort into cells; compressed neighbour lists with a skin.
//!
//! Mirror images (at walls) are ordinary sources. In a domain with a lateral period, a pair is listed once for each
//! periodic image inside the radius. A domain narrower than the support, even one particle wide, is therefore exact.

use crate::{Vec2, sparse::index};

/// A lateral period: the domain repeats in `x` every `width` metres.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Period {
    /// Width of the repeating domain, m.
    pub width: f64,
}

/// A node that can be a neighbour: a real node, or its mirror image in a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Index of the real node.
    pub owner: u32,
    /// Position of this node or image, m.
    pub position: Vec2,
    /// Whether this is a mirror image.
    pub mirrored: bool,
}

/// One listed pair, seen from the query point.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Neighbour {
    /// Index of the source in the slice given to [`NeighbourList::build`].
    pub source: u32,
    /// Multiple of the period to add to the source's `x`.
    pub wraps: i32,
}

/// Neighbours of every query point within a radius plus a skin.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NeighbourList {
    start: Vec<u32>,
    pairs: Vec<Neighbour>,
}

/// Largest number of cells per source, so that one particle far away does not exhaust the memory.
const CELLS_PER_SOURCE: usize = 4;
/// Number of cells that is always allowed, also with few sources.
const MINIMUM_CELL_BUDGET: usize = 64;

impl NeighbourList {
    /// Lists, for each query point, every source at a distance `<= radius + skin`, m.
    ///
    /// Pairs of a query are ordered by source, then by wrap. Positions must be finite.
    pub fn build(
        queries: &[Vec2],
        sources: &[Source],
        radius: f64,
        skin: f64,
        period: Option<Period>,
    ) -> Self {
        let reach = radius + skin;
        let cells = Cells::build(sources, reach, period);
        let mut start = Vec::with_capacity(queries.len() + 1);
        start.push(0);
        let mut pairs = Vec::new();
        for &query in queries {
            let first = pairs.len();
            cells.visit(query, reach, |slot| {
                let (source, base_wraps) = cells.member[slot];
                let delta = cells.wrapped[slot] - query;
                for wraps in wraps_within(delta, reach, period).into_iter().flatten() {
                    pairs.push(Neighbour { source, wraps: base_wraps + wraps });
                }
            });
            pairs[first..].sort_unstable_by_key(|pair| (pair.source, pair.wraps));
            // With a narrow period, a cell may be visited from both sides.
            let mut kept = first;
            for k in first..pairs.len() {
                if k == first || pairs[k] != pairs[kept - 1] {
                    pairs[kept] = pairs[k];
                    kept += 1;
                }
            }
            pairs.truncate(kept);
            start.push(index(pairs.len()));
        }
        Self { start, pairs }
    }

    /// Number of query points.
    pub fn queries(&self) -> usize {
        self.start.len() - 1
    }

    /// Total number of listed pairs, skin included.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// The listed pairs of one query.
    pub fn of(&self, query: usize) -> &[Neighbour] {
        &self.pairs[self.start[query] as usize..self.start[query + 1] as usize]
    }
}

impl Neighbour {
    /// `x_ji = x_j - x_i` to the periodic image of the source, m.
    pub fn offset(&self, query: Vec2, sources: &[Source], period: Option<Period>) -> Vec2 {
        let mut offset = sources[self.source as usize].position - query;
        if let Some(period) = period {
            offset.x += f64::from(self.wraps) * period.width;
        }
        offset
    }
}

/// Wraps (multiples of the period) that bring a source at `delta` from the query inside `reach`.
fn wraps_within(delta: Vec2, reach: f64, period: Option<Period>) -> Option<std::ops::RangeInclusive<i32>> {
    let half_squared = reach * reach - delta.y * delta.y;
    if half_squared < 0.0 {
        return None;
    }
    let half = half_squared.sqrt();
    match period {
        None => (delta.x.abs() <= half).then_some(0..=0),
        Some(Period { width }) => {
            Some(whole(((-half - delta.x) / width).ceil())..=whole(((half - delta.x) / width).floor()))
        }
    }
}

/// A float that is already whole, as an integer.
#[allow(clippy::cast_possible_truncation)] // a small number of wraps or cells, bounded by the callers
fn whole(value: f64) -> i32 {
    value as i32
}

/// Sources in a dense grid of square cells, sorted by cell.
struct Cells {
    origin: Vec2,
    size: f64,
    columns: usize,
    rows: usize,
    period: Option<Period>,
    start: Vec<u32>,
    /// Source, and the number of wraps that moves it into the first period.
    member: Vec<(u32, i32)>,
    /// Position of each member in the first period, m.
    wrapped: Vec<Vec2>,
}

impl Cells {
    fn build(sources: &[Source], reach: f64, period: Option<Period>) -> Self {
        let into_first_period = |position: Vec2| match period {
            None => (position, 0),
            Some(Period { width }) => {
                let wraps = -whole((position.x / width).floor());
                (Vec2::new(position.x + f64::from(wraps) * width, position.y), wraps)
            }
        };
        let mut low = Vec2::repeat(f64::INFINITY);
        let mut high = Vec2::repeat(f64::NEG_INFINITY);
        let wrapped: Vec<(Vec2, i32)> = sources.iter().map(|s| into_first_period(s.position)).collect();
        for (position, _) in &wrapped {
            low = low.inf(position);
            high = high.sup(position);
        }
        if sources.is_empty() {
            (low, high) = (Vec2::zeros(), Vec2::zeros());
        }
        let budget = (CELLS_PER_SOURCE * sources.len()).max(MINIMUM_CELL_BUDGET) as f64;
        let extent = high - low;
        let mut size = reach;
        while (extent.x / size + 1.0) * (extent.y / size + 1.0) > budget {
            size *= 2.0;
        }
        let columns = count(extent.x / size);
        let rows = count(extent.y / size);
        let mut cells = Self {
            origin: low,
            size,
            columns,
            rows,
            period,
            start: vec![0; columns * rows + 1],
            member: vec![(0, 0); sources.len()],
            wrapped: vec![Vec2::zeros(); sources.len()],
        };
        let cell_of: Vec<usize> = wrapped.iter().map(|(position, _)| cells.cell(*position)).collect();
        for &cell in &cell_of {
            cells.start[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            cells.start[cell + 1] += cells.start[cell];
        }
        let mut next = cells.start.clone();
        for (source, (&cell, &(position, wraps))) in cell_of.iter().zip(&wrapped).enumerate() {
            let slot = next[cell] as usize;
            cells.member[slot] = (index(source), wraps);
            cells.wrapped[slot] = position;
            next[cell] += 1;
        }
        cells
    }

    fn cell(&self, position: Vec2) -> usize {
        let column = bounded((position.x - self.origin.x) / self.size, self.columns);
        let row = bounded((position.y - self.origin.y) / self.size, self.rows);
        row * self.columns + column
    }

    /// Calls `visit` with each slot whose cell can hold a source, or an image of one, within `reach`.
    fn visit(&self, query: Vec2, reach: f64, mut visit: impl FnMut(usize)) {
        let (bottom, top) = (query.y - reach - self.origin.y, query.y + reach - self.origin.y);
        if self.member.is_empty() || top < 0.0 || bottom > self.size * self.rows as f64 {
            return;
        }
        let rows = bounded(bottom / self.size, self.rows)..=bounded(top / self.size, self.rows);
        for row in rows {
            let mut columns = |from: f64, to: f64| {
                if to < 0.0 || from > self.size * self.columns as f64 {
                    return;
                }
                let first = row * self.columns + bounded(from / self.size, self.columns);
                let last = row * self.columns + bounded(to / self.size, self.columns);
                (self.start[first] as usize..self.start[last + 1] as usize).for_each(&mut visit);
            };
            match self.period {
                None => columns(query.x - reach - self.origin.x, query.x + reach - self.origin.x),
                // The period is not wider than the search window, so every column is within reach.
                Some(Period { width }) if width <= 2.0 * reach => {
                    columns(0.0, self.size * self.columns as f64);
                }
                Some(Period { width }) => {
                    let x = query.x - width * (query.x / width).floor();
                    for shift in [-width, 0.0, width] {
                        columns(x + shift - reach - self.origin.x, x + shift + reach - self.origin.x);
                    }
                }
            }
        }
    }
}

/// Number of cells needed for an extent of `cells` cell sizes.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // non-negative and below the cell budget
fn count(cells: f64) -> usize {
    cells.floor() as usize + 1
}

/// Cell coordinate clamped to the grid.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to the grid before the cast
fn bounded(cell: f64, cells: usize) -> usize {
    cell.floor().clamp(0.0, (cells - 1) as f64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(
        queries: &[Vec2],
        sources: &[Source],
        reach: f64,
        period: Option<Period>,
    ) -> Vec<Vec<Neighbour>> {
        let span = if period.is_some() { -60..=60 } else { 0..=0 };
        queries
            .iter()
            .map(|&query| {
                let mut found = Vec::new();
                for source in 0..sources.len() {
                    for wraps in span.clone() {
                        let pair = Neighbour { source: index(source), wraps };
                        if pair.offset(query, sources, period).norm_squared() <= reach * reach {
                            found.push(pair);
                        }
                    }
                }
                found
            })
            .collect()
    }

    fn sources(points: &[(f64, f64)]) -> Vec<Source> {
        points
            .iter()
            .enumerate()
            .map(|(i, &(x, y))| Source { owner: index(i), position: Vec2::new(x, y), mirrored: false })
            .collect()
    }

    proptest! {
        #[test]
        fn equals_brute_force(points in prop::collection::vec((-3.0_f64..5.0, 0.0_f64..9.0), 1..60),
                              reach in 0.3_f64..3.0, width in prop::option::of(0.2_f64..6.0)) {
            let sources = sources(&points);
            let queries: Vec<Vec2> = sources.iter().map(|s| s.position + Vec2::new(0.05, -0.03)).collect();
            let period = width.map(|width| Period { width });
            let list = NeighbourList::build(&queries, &sources, reach, 0.0, period);
            for (query, expected) in brute_force(&queries, &sources, reach, period).into_iter().enumerate() {
                prop_assert_eq!(list.of(query), expected.as_slice());
            }
        }
    }

    #[test]
    fn a_source_exactly_at_the_radius_is_listed() {
        let sources = sources(&[(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)]);
        let list = NeighbourList::build(&[Vec2::zeros()], &sources, 1.0, 0.0, None);
        assert_eq!(list.of(0).len(), 2);
    }

    #[test]
    fn one_far_particle_keeps_the_grid_bounded() {
        let mut points = vec![(1e9, -1e9)];
        points.extend((0..100).map(|i| (f64::from(i) * 0.1, 0.0)));
        let sources = sources(&points);
        let cells = Cells::build(&sources, 0.3, None);
        assert!(cells.start.len() <= CELLS_PER_SOURCE * sources.len() + 1);
        let list = NeighbourList::build(&[Vec2::new(5.0, 0.0)], &sources, 0.25, 0.0, None);
        assert_eq!(list.of(0).len(), 5);
    }

    #[test]
    fn a_column_one_particle_wide_lists_all_its_images() {
        let sources = sources(&[(0.1, 0.0)]);
        let list =
            NeighbourList::build(&[Vec2::new(0.1, 0.0)], &sources, 0.56, 0.0, Some(Period { width: 0.2 }));
        let wraps: Vec<i32> = list.of(0).iter().map(|pair| pair.wraps).collect();
        assert_eq!(wraps, [-2, -1, 0, 1, 2]);
    }
}
