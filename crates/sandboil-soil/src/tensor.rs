//! In-plane tensors. A symmetric plane tensor is stored as its mean and its deviator, which has two components.

use crate::error::{SoilError, finite};
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Effective stress, kPa, tension positive; `x` horizontal, `y` up, `zz` out of plane.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stress {
    /// Horizontal normal stress, kPa.
    pub xx: f64,
    /// Vertical normal stress, kPa.
    pub yy: f64,
    /// Shear stress, kPa.
    pub xy: f64,
    /// Out-of-plane normal stress, kPa.
    pub zz: f64,
}

impl Stress {
    /// In-plane mean `(xx + yy)/2`, kPa.
    #[inline]
    pub fn plane_mean(&self) -> f64 {
        0.5 * (self.xx + self.yy)
    }

    /// In-plane deviator, kPa.
    #[inline]
    pub fn plane_deviator(&self) -> Deviator {
        Deviator { half_difference: 0.5 * (self.xx - self.yy), xy: self.xy }
    }

    /// Radius of Mohr's circle in the plane: the largest in-plane shear stress, kPa.
    #[inline]
    pub fn radius(&self) -> f64 {
        f64::hypot(0.5 * (self.xx - self.yy), self.xy)
    }

    /// First invariant `I1 = xx + yy + zz`, kPa.
    #[inline]
    pub fn first_invariant(&self) -> f64 {
        self.xx + self.yy + self.zz
    }

    /// Square root of the second deviatoric invariant J2, kPa. In pure shear it equals the shear stress.
    #[inline]
    pub fn root_j2(&self) -> f64 {
        let [a, b, c] = [self.xx - self.yy, self.yy - self.zz, self.zz - self.xx];
        ((a * a + b * b + c * c) / 6.0 + self.xy * self.xy).sqrt()
    }

    /// Stress from its in-plane mean, in-plane deviator and out-of-plane component, kPa.
    #[inline]
    pub(crate) fn of_plane(mean: f64, deviator: Deviator, zz: f64) -> Self {
        let Deviator { half_difference, xy } = deviator;
        Self { xx: mean + half_difference, yy: mean - half_difference, xy, zz }
    }

    /// The stress with the given first invariant, kPa, and with its three-dimensional deviator multiplied by a factor.
    #[inline]
    pub(crate) fn with(&self, first_invariant: f64, factor: f64) -> Self {
        let (old, new) = (self.first_invariant() / 3.0, first_invariant / 3.0);
        let moved = |component: f64| new + (component - old) * factor;
        Self { xx: moved(self.xx), yy: moved(self.yy), xy: self.xy * factor, zz: moved(self.zz) }
    }

    /// Returns the stress, or an error if a component is not a finite number.
    pub(crate) fn finite(self, quantity: &'static str) -> Result<Self, SoilError> {
        for component in [self.xx, self.yy, self.xy, self.zz] {
            finite(quantity, component)?;
        }
        Ok(self)
    }
}

/// Strain increment of a plane-strain point, tension positive.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StrainIncrement {
    /// Horizontal normal strain.
    pub xx: f64,
    /// Vertical normal strain.
    pub yy: f64,
    /// Engineering shear strain, `dv_x/dy + dv_y/dx` times the time increment.
    pub xy: f64,
    /// Rotation, `(dv_x/dy - dv_y/dx)/2` times the time increment: clockwise positive, radians.
    pub spin: f64,
}

/// Largest strain component accepted in one increment, 1000 %. A larger one is always an input error.
const MAX_STRAIN_INCREMENT: f64 = 10.0;

impl StrainIncrement {
    /// Refuses an increment with a component that is not finite, or a strain or spin of more than 1000 %.
    pub(crate) fn bounded(&self) -> Result<(), SoilError> {
        self.within(MAX_STRAIN_INCREMENT)
    }

    /// Refuses an increment with a component that is not finite, or with a strain or spin above the smaller of 1000 %
    /// and `limit`.
    pub(crate) fn within(&self, limit: f64) -> Result<(), SoilError> {
        let limit = limit.min(MAX_STRAIN_INCREMENT);
        // `f64::max` ignores NaN; a sum does not.
        let sum = finite("strain increment", self.xx + self.yy + self.xy + self.spin)?;
        let largest = self.xx.abs().max(self.yy.abs()).max(self.xy.abs()).max(self.spin.abs());
        if !(largest <= limit) {
            let value = if largest.is_finite() { largest } else { sum };
            return Err(SoilError::StrainIncrementTooLarge { value, limit });
        }
        Ok(())
    }
}

/// Deviator of a symmetric plane tensor: `xx = -yy = half_difference`.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Deviator {
    /// `(xx - yy)/2`.
    pub half_difference: f64,
    /// Shear component of the tensor (for strain, half of the engineering shear strain).
    pub xy: f64,
}

impl Deviator {
    /// The zero tensor.
    pub const ZERO: Self = Self { half_difference: 0.0, xy: 0.0 };

    /// Double contraction `A:B`.
    #[inline]
    pub fn contract(self, other: Self) -> f64 {
        2.0 * (self.half_difference * other.half_difference + self.xy * other.xy)
    }

    /// `sqrt(A:A)`.
    #[inline]
    pub fn norm(self) -> f64 {
        self.contract(self).sqrt()
    }

    /// Components of the tensor in axes rotated counter-clockwise, given cosine and sine of twice the angle.
    #[inline]
    pub(crate) fn in_axes_turned(self, (cos2, sin2): (f64, f64)) -> Self {
        Self {
            half_difference: self.half_difference * cos2 + self.xy * sin2,
            xy: self.xy * cos2 - self.half_difference * sin2,
        }
    }
}

impl Add for Deviator {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { half_difference: self.half_difference + other.half_difference, xy: self.xy + other.xy }
    }
}

impl AddAssign for Deviator {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Deviator {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { half_difference: self.half_difference - other.half_difference, xy: self.xy - other.xy }
    }
}

impl Neg for Deviator {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { half_difference: -self.half_difference, xy: -self.xy }
    }
}

impl Mul<f64> for Deviator {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self { half_difference: self.half_difference * factor, xy: self.xy * factor }
    }
}
