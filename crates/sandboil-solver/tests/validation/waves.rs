//! Shear waves in columns without weight: input and output.

use crate::common::shaking;
use sandboil_solver::{HalfSpace, Model, Shaking, Simulation, UpgoingWave};
use sandboil_sph::Vec2;
use std::f64::consts::PI;

/// Ricker pulse of a central frequency (Hz), peak one at time zero.
pub fn ricker(frequency: f64, time: f64) -> f64 {
    let x = (PI * frequency * time).powi(2);
    (1.0 - 2.0 * x) * (-x).exp()
}

/// The same column without weight: initial stress, which rotates with the soil, would change its wave speed.
pub fn weightless(mut model: Model) -> Model {
    const LITTLE: f64 = 1e-9;
    model.gravity *= LITTLE;
    model.vertical_effective_stress.fill(0.0);
    // Water keeps its density.
    if let Some(water) = &mut model.water {
        water.unit_weight *= LITTLE;
        model.pore_pressure.fill(0.0);
    }
    model
}

/// Velocity at the surface of a column under an upgoing wave, horizontal, or vertical if `adjust` makes the
/// wave vertical: times and values.
pub fn surface_velocity(
    model: &Model,
    upgoing: impl Fn(f64) -> f64,
    duration: f64,
    adjust: impl Fn(&mut Shaking),
) -> (Vec<f64>, Vec<f64>) {
    // Sampling of the incoming wave, s.
    const INTERVAL: f64 = 1e-3;
    let samples = (duration / INTERVAL) as usize;
    let velocity = (0..samples).map(|k| upgoing(k as f64 * INTERVAL)).collect();
    let mut simulation = Simulation::new(model, 1).unwrap();
    let surface = Vec2::new(model.position[0].x, model.surface_elevation[0]);
    let mut stage = shaking(Some(UpgoingWave::shear(INTERVAL, velocity)), duration, vec![surface]);
    adjust(&mut stage);
    let rising = stage.base.waves.iter().any(|wave| !wave.vertical.is_empty());
    let channel = if rising { "velocity_y" } else { "velocity_x" };
    simulation.begin(stage).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    let (times, values) = simulation.take_histories();
    let channels = simulation.channel_names();
    let place = channels.iter().position(|name| *name == channel).unwrap();
    (times, values.chunks(channels.len()).map(|row| row[place]).collect())
}

/// Amplitude of a signal at a frequency, Hz, times half its number of samples.
pub fn amplitude(times: &[f64], values: &[f64], frequency: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (time, value) in times.iter().zip(values) {
        let (sin, cos) = (2.0 * PI * frequency * time).sin_cos();
        re += value * cos;
        im += value * sin;
    }
    f64::hypot(re, im)
}

/// Damping ratio of a column's free vibration on a nearly rigid base, after weak excitation at the period of
/// its first mode.
pub fn damping_ratio(model: &Model, period: f64, adjust: impl Fn(&mut Shaking)) -> f64 {
    // Velocity for which strains stay small in resonance, m/s.
    const SMALL: f64 = 1e-3;
    const RIGID: HalfSpace = HalfSpace { shear_speed: 1e8, compression_speed: None, density: 2.0 };
    const CYCLES: f64 = 5.0;
    // Excitation starts and ends smoothly, so that higher modes stay at rest: they would disturb the sign of
    // v.
    let driven = 8.0 * period;
    let push = |time: f64| {
        let envelope = if time < driven { (PI * time / driven).sin().powi(2) } else { 0.0 };
        SMALL * envelope * (2.0 * PI * time / period).sin()
    };
    let (times, velocity) = surface_velocity(model, push, driven + 8.0 * period, |stage| {
        stage.base.half_space = Some(RIGID);
        adjust(stage);
    });
    let cycle = |number: f64| {
        let from = driven + number * period;
        let inside = |time: &f64| (from..from + period).contains(time);
        let (times, values): (Vec<f64>, Vec<f64>) =
            times.iter().zip(&velocity).filter(|(time, _)| inside(time)).unzip();
        amplitude(&times, &values, 1.0 / period)
    };
    (cycle(1.0) / cycle(1.0 + CYCLES)).ln() / (2.0 * PI * CYCLES)
}
