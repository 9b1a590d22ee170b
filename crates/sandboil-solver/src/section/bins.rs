//! Finding the nearest of many points.

use sandboil_sph::Vec2;
use std::collections::BTreeMap;

/// Points in square bins, to find the nearest within the size of a bin.
pub struct Bins {
    size: f64,
    bins: BTreeMap<[i64; 2], Vec<usize>>,
}

impl Bins {
    /// Sorts points into bins; `size` (m) is at least the search distance.
    pub fn new(points: &[Vec2], size: f64) -> Self {
        let mut bins = Self { size, bins: BTreeMap::new() };
        for (k, &at) in points.iter().enumerate() {
            bins.bins.entry(bins.bin(at)).or_default().push(k);
        }
        bins
    }

    #[allow(clippy::cast_possible_truncation)] // sections end far below 2^63 bins
    fn bin(&self, at: Vec2) -> [i64; 2] {
        [at.x, at.y].map(|x| (x / self.size).floor() as i64)
    }

    /// Index of the allowed point nearest to a place, within the size of a bin; the first of several at the
    /// same distance.
    pub fn nearest(&self, points: &[Vec2], at: Vec2, allowed: impl Fn(usize) -> bool) -> Option<usize> {
        let [column, row] = self.bin(at);
        let distance = |k: usize| (points[k] - at).norm_squared();
        (column - 1..=column + 1)
            .flat_map(|c| (row - 1..=row + 1).map(move |r| [c, r]))
            .filter_map(|bin| self.bins.get(&bin))
            .flatten()
            .copied()
            .filter(|&k| distance(k) < self.size * self.size && allowed(k))
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))
    }
}
