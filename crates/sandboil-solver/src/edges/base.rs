//! Description of a base: the half-space below it and the waves that arrive through it.

use crate::section::{description::Operators, outline::Condition};

/// Velocity history of the upgoing waves at the base: half of an outcrop motion, m/s.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct UpgoingWave {
    /// Sampling interval, s.
    pub interval: f64,
    /// Horizontal velocity (shear wave), m/s, first sample at time zero; at rest after the last.
    pub horizontal: Vec<f64>,
    /// Vertical velocity (compression wave), m/s; empty: none.
    pub vertical: Vec<f64>,
}

impl UpgoingWave {
    /// A shear wave alone, of horizontal velocities in m/s.
    pub fn shear(interval: f64, horizontal: Vec<f64>) -> Self {
        Self { interval, horizontal, vertical: Vec::new() }
    }

    /// Horizontal velocity at a time, m/s.
    pub fn horizontal_at(&self, time: f64) -> f64 {
        interpolated(&self.horizontal, time / self.interval)
    }

    /// Vertical velocity at a time, m/s.
    pub fn vertical_at(&self, time: f64) -> f64 {
        interpolated(&self.vertical, time / self.interval)
    }
}

/// Linear interpolation between samples, zero outside the record, at `place` in sampling intervals.
pub fn interpolated(samples: &[f64], place: f64) -> f64 {
    if !(place >= 0.0) {
        return 0.0;
    }
    let before = place.floor();
    let fraction = place - before;
    let sample = |index: f64| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and not negative
        samples.get(index as usize).copied().unwrap_or(0.0)
    };
    sample(before) * (1.0 - fraction) + sample(before + 1.0) * fraction
}

/// Vertical condition of a shaken base.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Vertical {
    /// Held: compression waves are reflected.
    Roller,
    /// Carried by the stored reaction only: compression waves leave, and may enter.
    Absorbing,
}

/// A half-space given by its own properties.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HalfSpace {
    /// Shear-wave speed, m/s.
    pub shear_speed: f64,
    /// Compression-wave speed, m/s; needed if the base is absorbing or inclined.
    pub compression_speed: Option<f64>,
    /// Density, Mg/m3.
    pub density: f64,
}

/// Impedances `rho C_s` and `rho C_p` (kPa s/m) and the speeds (m/s) of the half-space below a point of the base.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Impedance {
    /// Density, Mg/m3.
    pub density: f64,
    /// Shear-wave speed, m/s.
    pub shear_speed: f64,
    /// Compression-wave speed, undrained where there is water, m/s.
    pub compression_speed: f64,
}

/// The wave that arrives at a segment of the base, and when.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BaseSegment {
    /// Left and right end, m; the outermost segments also apply beyond their outer ends.
    pub extent: [f64; 2],
    /// Index of the wave; `None`: no motion.
    pub wave: Option<usize>,
    /// Time at which the wave's first sample arrives at the left end, s.
    pub delay: f64,
    /// Additional delay per metre to the right, s/m.
    pub slowness: f64,
}

impl BaseSegment {
    /// The same wave along the whole base, without delay.
    pub fn everywhere(wave: Option<usize>) -> Self {
        Self { extent: [f64::NEG_INFINITY, f64::INFINITY], wave, delay: 0.0, slowness: 0.0 }
    }
}

/// The base of a shaking stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Base {
    /// Vertical condition.
    pub vertical: Vertical,
    /// The half-space; `None`: one with the properties of the soil above the base.
    pub half_space: Option<HalfSpace>,
    /// The waves, to which the segments refer.
    pub waves: Vec<UpgoingWave>,
    /// Segments from left to right.
    pub segments: Vec<BaseSegment>,
    /// Elevation to which the arrival times of the waves refer, m; `None`: the lowest point of the base.
    pub datum: Option<f64>,
}

impl Base {
    /// A compliant roller base under one wave, or none.
    pub fn shaken_by(wave: Option<UpgoingWave>) -> Self {
        let segment = BaseSegment::everywhere(wave.as_ref().map(|_| 0));
        Self {
            vertical: Vertical::Roller,
            half_space: None,
            waves: wave.into_iter().collect(),
            segments: vec![segment],
            datum: None,
        }
    }

    /// Whether the waves differ along the base, or arrive at different times.
    pub fn has_passage(&self) -> bool {
        self.segments.len() > 1 || self.segments.iter().any(|s| s.slowness != 0.0 || s.delay != 0.0)
    }

    /// The wave that arrives at `x` and its delay, as a segment along the whole base.
    pub fn at(&self, x: f64) -> BaseSegment {
        let segment = self.segments.iter().find(|s| x <= s.extent[1]).or(self.segments.last());
        segment.map_or(BaseSegment::everywhere(None), |segment| {
            let travel =
                if segment.slowness == 0.0 { 0.0 } else { segment.slowness * (x - segment.extent[0]) };
            BaseSegment { delay: segment.delay + travel, ..BaseSegment::everywhere(segment.wave) }
        })
    }
}

/// Edge condition of the compliant base for a set of operators.
pub fn base_condition(operators: Operators, absorbs_vertically: bool) -> Condition {
    match (operators, absorbs_vertically) {
        (_, true) => Condition::Traction,
        (Operators::Conservative | Operators::Dual, false) => Condition::VerticalRoller,
        // Free slip, with the odd shear stress of the images (Section 4.2).
        (Operators::Printed, false) => Condition::FreeSlip,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wave_is_linear_between_samples_and_zero_outside() {
        let wave = UpgoingWave { interval: 0.5, horizontal: vec![1.0, 3.0], vertical: Vec::new() };
        let times = [-0.1, 0.0, 0.25, 0.5, 0.75, 1.1];
        assert_eq!(times.map(|t| wave.horizontal_at(t)), [0.0, 1.0, 2.0, 3.0, 1.5, 0.0]);
        assert_eq!(times.map(|t| wave.vertical_at(t)), [0.0; 6]);
        assert_eq!(wave.horizontal_at(f64::NAN), 0.0);
    }

    #[test]
    fn a_wave_arrives_with_the_delay_and_slowness_of_its_segment() {
        let segment = |from: f64, to: f64, delay: f64, slowness: f64| BaseSegment {
            extent: [from, to],
            wave: Some(0),
            delay,
            slowness,
        };
        let segments = vec![segment(0.0, 10.0, 0.0, 0.01), segment(10.0, 20.0, 0.5, 0.0)];
        let base = Base { segments, ..Base::shaken_by(Some(UpgoingWave::default())) };
        let delay = |x: f64| base.at(x).delay;
        assert_eq!([0.0, 5.0, 10.0, 11.0, 25.0].map(delay), [0.0, 0.05, 0.1, 0.5, 0.5]);
    }
}
