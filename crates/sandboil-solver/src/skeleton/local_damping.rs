//! Local damping (Eq. 16).

use sandboil_sph::Vec2;

/// Acceleration of a node by local damping (Eq. 16), m/s2: `coefficient` times the size of each component of
/// its acceleration, against its velocity `before`.
#[inline]
pub fn local_damping(acceleration: Vec2, before: Vec2, coefficient: f64) -> Vec2 {
    acceleration.abs().component_mul(&before.map(sign)) * -coefficient
}

/// Sign of a value, zero for zero: damping does not accelerate a node at rest.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}
