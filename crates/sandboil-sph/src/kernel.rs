//! The quintic Wendland (C2) kernel in two dimensions (Wendland 1995, Adv. Comput. Math. 4).

use crate::Vec2;
use std::f64::consts::PI;

/// Quintic Wendland kernel of smoothing length `h` (m) and support radius `2 h`:
/// `W(r) = 7/(4 pi h^2) (1 - q/2)^4 (1 + 2 q)` with `q = r/h < 2`, zero outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WendlandQuintic {
    smoothing_length: f64,
    normalisation: f64,
}

impl WendlandQuintic {
    /// Support radius over smoothing length.
    pub const SUPPORT_RATIO: f64 = 2.0;

    /// A kernel of smoothing length `h`, m, which must be positive and finite.
    pub fn new(smoothing_length: f64) -> Self {
        debug_assert!(smoothing_length > 0.0 && smoothing_length.is_finite());
        Self { smoothing_length, normalisation: 7.0 / (4.0 * PI * smoothing_length * smoothing_length) }
    }

    /// Smoothing length `h`, m.
    pub fn smoothing_length(&self) -> f64 {
        self.smoothing_length
    }

    /// Support radius `2 h`, m.
    pub fn support(&self) -> f64 {
        Self::SUPPORT_RATIO * self.smoothing_length
    }

    /// `W(r)`, 1/m2, at a distance in m.
    pub fn value(&self, distance: f64) -> f64 {
        let q = distance / self.smoothing_length;
        if q >= Self::SUPPORT_RATIO {
            return 0.0;
        }
        let t = 1.0 - 0.5 * q;
        let t2 = t * t;
        self.normalisation * t2 * t2 * (1.0 + 2.0 * q)
    }

    /// Gradient of `W` with respect to `x_i`, 1/m3, for `x_ji = x_j - x_i`, m.
    pub fn gradient(&self, x_ji: Vec2) -> Vec2 {
        let q = x_ji.norm() / self.smoothing_length;
        if q >= Self::SUPPORT_RATIO {
            return Vec2::zeros();
        }
        // dW/dr = -5 q (1 - q/2)^3 norm/h and grad_i r = -x_ji/r, so the division by r cancels.
        let t = 1.0 - 0.5 * q;
        let scale = 5.0 * self.normalisation * t * t * t / (self.smoothing_length * self.smoothing_length);
        x_ji * scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn integrates_to_one() {
        let kernel = WendlandQuintic::new(0.28);
        let n = 20_000;
        let dr = kernel.support() / f64::from(n);
        let integral: f64 = (0..n)
            .map(|i| {
                let r = (f64::from(i) + 0.5) * dr;
                2.0 * PI * r * kernel.value(r) * dr
            })
            .sum();
        assert!((integral - 1.0).abs() < 1e-8, "{integral}");
    }

    proptest! {
        #[test]
        fn gradient_is_the_derivative_of_the_value(h in 0.1_f64..3.0, qx in -2.2_f64..2.2, qy in -2.2_f64..2.2) {
            let kernel = WendlandQuintic::new(h);
            let x_ji = Vec2::new(qx * h, qy * h);
            let step = 1e-6 * h;
            // A positive change of x_i is a negative change of x_ji.
            let slope = |e: Vec2| (kernel.value((x_ji - e).norm()) - kernel.value((x_ji + e).norm())) / (2.0 * step);
            let numeric = Vec2::new(slope(Vec2::new(step, 0.0)), slope(Vec2::new(0.0, step)));
            let scale = kernel.value(0.0) / h;
            prop_assert!((kernel.gradient(x_ji) - numeric).norm() < 1e-6 * scale);
        }

        #[test]
        fn vanishes_outside_the_support(h in 0.1_f64..3.0, q in 2.0_f64..10.0) {
            let kernel = WendlandQuintic::new(h);
            prop_assert_eq!(kernel.value(q * h * (1.0 + 1e-12)), 0.0);
            prop_assert_eq!(kernel.gradient(Vec2::new(0.0, q * h * (1.0 + 1e-12))), Vec2::zeros());
        }
    }
}
