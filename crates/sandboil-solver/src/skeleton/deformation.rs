//! Deformation since the geometry was built. This total-Lagrangian form needs no new weights while strains
//! are moderate, and on a strained lattice it is as consistent as on the lattice before.

use sandboil_soil::Stress;
use sandboil_sph::Vec2;

/// Deformation gradient `F = dx/dX` in the plane, rows in space, columns in the geometry's frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Deformation {
    /// `dx/dX`.
    pub xx: f64,
    /// `dx/dY`.
    pub xy: f64,
    /// `dy/dX`.
    pub yx: f64,
    /// `dy/dY`.
    pub yy: f64,
}

impl Default for Deformation {
    fn default() -> Self {
        Self { xx: 1.0, xy: 0.0, yx: 0.0, yy: 1.0 }
    }
}

/// `J F^-T`: maps areas from the geometry's frame to space. Rows in space.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cofactor([f64; 4]);
impl Deformation {
    /// Present volume over that when the geometry was built.
    #[inline]
    pub fn volume_ratio(&self) -> f64 {
        self.xx * self.yy - self.xy * self.yx
    }

    /// `J F^-T`.
    #[inline]
    pub fn cofactor(&self) -> Cofactor {
        Cofactor([self.yy, -self.yx, -self.xy, self.xx])
    }

    /// Largest difference of a component from that without deformation.
    pub fn magnitude(&self) -> f64 {
        (self.xx - 1.0).abs().max((self.yy - 1.0).abs()).max(self.xy.abs()).max(self.yx.abs())
    }

    /// Mean of two deformations.
    #[inline]
    pub fn mean(&self, other: &Self) -> Self {
        Self {
            xx: 0.5 * (self.xx + other.xx),
            xy: 0.5 * (self.xy + other.xy),
            yx: 0.5 * (self.yx + other.yx),
            yy: 0.5 * (self.yy + other.yy),
        }
    }

    /// Adds a displacement gradient, given by its dimensionless rows.
    #[inline]
    pub fn moved(&self, x: Vec2, y: Vec2) -> Self {
        Self { xx: self.xx + x.x, xy: self.xy + x.y, yx: self.yx + y.x, yy: self.yy + y.y }
    }

    /// The gradient, in space, of a field whose gradient in the geometry's frame is `g`: `F^-T g`.
    #[inline]
    pub fn in_space(&self, g: Vec2) -> Vec2 {
        self.cofactor().carry(g) / self.volume_ratio()
    }
}

impl Cofactor {
    /// `J F^-T w`.
    #[inline]
    pub fn carry(&self, w: Vec2) -> Vec2 {
        let [xx, xy, yx, yy] = self.0;
        Vec2::new(xx * w.x + xy * w.y, yx * w.x + yy * w.y)
    }

    /// `J tr(G F^-1)` for the rows `G` of a velocity gradient in the geometry's frame: `J div v`.
    #[inline]
    pub fn contract(&self, x: Vec2, y: Vec2) -> f64 {
        let [xx, xy, yx, yy] = self.0;
        xx * x.x + xy * x.y + yx * y.x + yy * y.y
    }

    /// The components times a factor, `[xX, xY, yX, yY]`.
    pub fn scaled(&self, factor: f64) -> [f64; 4] {
        self.0.map(|component| factor * component)
    }

    /// Nominal stress `J sigma F^-T` as `[xX, xY, yX, yY]`, kPa: force in space on areas of the geometry's frame.
    #[inline]
    pub fn nominal(&self, stress: &Stress) -> [f64; 4] {
        let [xx, xy, yx, yy] = self.0;
        [
            stress.xx * xx + stress.xy * yx,
            stress.xx * xy + stress.xy * yy,
            stress.xy * xx + stress.yy * yx,
            stress.xy * xy + stress.yy * yy,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEARED: Deformation = Deformation { xx: 1.1, xy: 0.3, yx: -0.2, yy: 0.9 };

    #[test]
    fn in_space_inverts_the_deformation() {
        // The gradient of the field f = 2 x - 3 y in the geometry's frame.
        let in_frame = Vec2::new(2.0 * SHEARED.xx - 3.0 * SHEARED.yx, 2.0 * SHEARED.xy - 3.0 * SHEARED.yy);
        assert!((SHEARED.in_space(in_frame) - Vec2::new(2.0, -3.0)).norm() < 1e-14);
    }

    #[test]
    fn nominal_stress_does_the_work_of_the_stress() {
        let stress = Stress { xx: 5.0, yy: -2.0, xy: 3.0, zz: 0.0 };
        let rows = [Vec2::new(0.7, -0.1), Vec2::new(0.4, 0.2)];
        let [xx, xy, yx, yy] = SHEARED.cofactor().nominal(&stress);
        let nominal = xx * rows[0].x + xy * rows[0].y + yx * rows[1].x + yy * rows[1].y;
        let space = rows.map(|row| SHEARED.in_space(row));
        let work = stress.xx * space[0].x + stress.yy * space[1].y + stress.xy * (space[0].y + space[1].x);
        assert!((nominal - SHEARED.volume_ratio() * work).abs() < 1e-13);
        let divergence = SHEARED.cofactor().contract(rows[0], rows[1]);
        assert!((divergence - SHEARED.volume_ratio() * (space[0].x + space[1].y)).abs() < 1e-13);
    }
}
