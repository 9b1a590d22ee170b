//! Still water around ground with large displacements: its pressure at the present places of the nodes.

use crate::{
    error::SolverError,
    section::description::{Model, Water},
};
use sandboil_sph::Vec2;
use std::collections::BTreeMap;

/// The surface of still water and the hydrostatic pressure below it, `gamma_f (y_w(x) - y)`.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StillWater {
    unit_weight: f64,
    /// Points of the surface from left to right, m; level beyond its ends. None: no water.
    line: Vec<Vec2>,
}

impl StillWater {
    /// Water below a line.
    ///
    /// # Errors
    /// A line whose points are not finite or do not run from left to right.
    pub fn new(water: Water, line: &[Vec2]) -> Result<Self, SolverError> {
        let is_finite = |point: &Vec2| point.x.is_finite() && point.y.is_finite();
        let bad = line.iter().find(|point| !is_finite(point));
        if let Some(point) = bad.or_else(|| line.windows(2).find(|p| !(p[1].x > p[0].x)).map(|p| &p[1])) {
            return Err(SolverError::InvalidInput {
                name: "run_out.still_water",
                value: if point.x.is_finite() { point.x } else { point.y },
                expected: "finite points in the order of rising x",
            });
        }
        Ok(Self { unit_weight: water.unit_weight, line: line.to_vec() })
    }

    /// The water as it stood at rest: over every column of the lattice at the head of its uppermost node that is below
    /// water, which is the level of a pond, and the water table in ground that rises above it.
    pub fn at_rest(model: &Model, water: Water) -> Self {
        let mut tops: BTreeMap<i64, usize> = BTreeMap::new();
        for (node, at) in model.position.iter().enumerate() {
            if !(model.pore_pressure[node] > 0.0 && model.saturation(node) >= 1.0) {
                continue;
            }
            #[allow(clippy::cast_possible_truncation)] // far fewer columns than 2^63
            let column = (at.x / model.spacing.x).floor() as i64;
            let top = tops.entry(column).or_insert(node);
            if at.y > model.position[*top].y {
                *top = node;
            }
        }
        let head = |node: usize| model.position[node].y + model.pore_pressure[node] / water.unit_weight;
        let line = tops.into_values().map(|node| Vec2::new(model.position[node].x, head(node)));
        Self { unit_weight: water.unit_weight, line: line.collect() }
    }

    /// Elevation of the surface and its slope, if there is water.
    fn surface(&self, x: f64) -> Option<(f64, f64)> {
        let (first, last) = (self.line.first()?, self.line.last()?);
        if x <= first.x {
            return Some((first.y, 0.0));
        }
        let right = self.line.partition_point(|point| point.x < x);
        let Some(right) = self.line.get(right) else { return Some((last.y, 0.0)) };
        let left = self.line[self.line.partition_point(|point| point.x < x) - 1];
        let slope = (right.y - left.y) / (right.x - left.x);
        Some((left.y + slope * (x - left.x), slope))
    }

    /// Pressure at a place, kPa.
    pub fn pressure(&self, at: Vec2) -> f64 {
        self.surface(at.x).map_or(0.0, |(level, _)| self.unit_weight * (level - at.y).max(0.0))
    }

    /// Its gradient, kPa/m.
    pub fn gradient(&self, at: Vec2) -> Vec2 {
        match self.surface(at.x) {
            Some((level, slope)) if level > at.y => Vec2::new(slope, -1.0) * self.unit_weight,
            _ => Vec2::zeros(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.line.as_slice())
    }
}

/// Suction and pressure at rest of every node as parts of the stress, kPa: negative or zero, and positive or zero.
pub fn suction_and_pressure(model: &Model) -> (Vec<f64>, Vec<f64>) {
    model.neutral_stress().into_iter().map(|p| (p.min(0.0), p.max(0.0))).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::square_block;

    const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e5 };

    #[test]
    fn pressure_is_hydrostatic_below_the_line() {
        let line = [Vec2::new(0.0, 4.0), Vec2::new(2.0, 4.0), Vec2::new(4.0, 3.0)];
        let still = StillWater::new(WATER, &line).unwrap();
        for (x, level) in [(-9.0, 4.0), (1.0, 4.0), (3.0, 3.5), (9.0, 3.0)] {
            assert!((still.pressure(Vec2::new(x, 1.0)) - 10.0 * (level - 1.0)).abs() < 1e-12, "{x}");
            assert_eq!(still.pressure(Vec2::new(x, level + 0.1)), 0.0);
        }
        assert_eq!(still.gradient(Vec2::new(3.0, 1.0)), Vec2::new(-5.0, -10.0));
        assert_eq!(still.gradient(Vec2::new(9.0, 1.0)), Vec2::new(0.0, -10.0));
        assert_eq!(StillWater::new(WATER, &[]).unwrap().pressure(Vec2::zeros()), 0.0);
        assert!(StillWater::new(WATER, &[line[1], line[0]]).is_err());
    }

    /// Half the columns under a pond, the others with a water table inside.
    #[test]
    fn the_line_is_that_of_the_state_at_rest() {
        let mut model = square_block(4);
        model.water = Some(WATER);
        let level = |x: f64| if x < 2.0 { 7.0 } else { 1.6 };
        model.pore_pressure = model.position.iter().map(|at| 10.0 * (level(at.x) - at.y).max(0.0)).collect();
        let still = StillWater::at_rest(&model, WATER);
        for (at, pressure) in model.position.iter().zip(&model.pore_pressure) {
            assert!((still.pressure(*at) - pressure).abs() < 1e-12, "{at}");
        }
    }
}
