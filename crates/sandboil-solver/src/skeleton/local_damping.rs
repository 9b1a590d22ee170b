//! Local damping (Eq. 16).

use sandboil_sph::Vec2;

/// Local damping of Eq. 16, m/s2, of a node that is accelerated and was moving before: `coefficient` of each
/// component's acceleration, against its velocity.
#[inline]
pub fn local_damping(acceleration: Vec2, before: Vec2, coefficient: f64) -> Vec2 {
    acceleration.abs().component_mul(&before.map(sign)) * -coefficient
}

/// Sign with zero for zero: a node at rest is not pushed by its damping.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}
