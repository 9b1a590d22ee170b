//! Histories at points: every step enters a low-pass filter, and the filtered signal is thinned to the output
//! interval, so that thinning causes no aliasing.

use crate::{
    run::{clock::Clock, ground::Ground},
    skeleton::point::StressPoint,
    stages::stage::Output,
    weights::points::point_weights,
};
use sandboil_sph::{Csr, Vec2};
use std::{collections::VecDeque, f64::consts::PI};

/// Half-width of the filter in output intervals.
const HALF_WIDTH: f64 = 4.0;
/// Cut-off over the output rate: 6 dB down at 80 Hz for 0.005 s, 0.7 dB at 48 Hz.
const CUT_OFF: f64 = 0.4;
/// Least number of steps in an output interval; a shorter interval is widened.
const FEWEST_STEPS: f64 = 2.0;
/// Blackman-windowed sinc at a distance from the output instant, in output intervals.
fn filter_weight(distance: f64) -> f64 {
    if distance.abs() >= HALF_WIDTH {
        return 0.0;
    }
    let x = 2.0 * PI * CUT_OFF * distance;
    let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
    let phase = PI * distance / HALF_WIDTH;
    // Blackman (1958): 0.42, 0.5 and 0.08 are the window's own coefficients.
    sinc * (0.42 + 0.5 * phase.cos() + 0.08 * (2.0 * phase).cos())
}

/// Histories of a stage at its probes.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Histories {
    /// Weights of the velocity nodes: rows are probes.
    of_nodes: Csr<f64>,
    /// Weights of the stress nodes: rows are probes; `None` without stress histories.
    of_stress: Option<Csr<f64>>,
    recorder: LowPassRecorder,
    sample: Vec<f64>,
}

impl Histories {
    /// Histories at the probes of a stage that begins with a time step, s.
    pub fn new(ground: &Ground, output: &Output, dt: f64) -> Self {
        let Ground { model, layout, position, .. } = ground;
        let of_stress = output
            .stress_histories
            .then(|| point_weights(model, &layout.positions(position, model.spacing), &output.probes));
        let channels = output.probes.len() * channel_names(ground.water.is_some(), of_stress.is_some()).len();
        Self {
            of_nodes: point_weights(model, position, &output.probes),
            of_stress,
            recorder: LowPassRecorder::new(channels, output.history_interval, dt),
            sample: vec![0.0; channels],
        }
    }

    /// Names of the channels of each probe. Stress is effective, tension positive.
    pub fn channel_names(&self, ground: &Ground) -> Vec<&'static str> {
        channel_names(ground.water.is_some(), self.of_stress.is_some())
    }

    /// Takes a sample of a step, after its accelerations are known and before its nodes move: all quantities
    /// are those of the same instant.
    pub fn record(&mut self, ground: &Ground, clock: &Clock) {
        let Ground { model, position, velocity, acceleration, water, points, .. } = ground;
        let mut slot = 0;
        let mut put = |value: f64| {
            self.sample[slot] = value;
            slot += 1;
        };
        for probe in 0..self.of_nodes.rows() {
            let (mut a, mut v, mut u) = (Vec2::zeros(), Vec2::zeros(), Vec2::zeros());
            let mut excess = 0.0;
            for (j, &weight) in self.of_nodes.iter_row(probe) {
                a += acceleration[j] * weight;
                v += (velocity[j] - acceleration[j] * (0.5 * clock.dt)) * weight;
                u += (position[j] - model.position[j]) * weight;
                excess += water.as_ref().map_or(0.0, |water| water.excess(j)) * weight;
            }
            for vector in [a, v, u] {
                put(vector.x);
                put(vector.y);
            }
            if water.is_some() {
                put(excess);
            }
            if let Some(weights) = &self.of_stress {
                let mut sum = [0.0; 6];
                for (s, weight) in weights.iter_row(probe) {
                    let StressPoint { stress, strain, .. } = &points[s];
                    let read = [stress.xx, stress.yy, stress.xy, strain[0], strain[1], strain[2]];
                    for (total, value) in sum.iter_mut().zip(read) {
                        *total += weight * value;
                    }
                }
                sum.into_iter().for_each(&mut put);
            }
        }
        self.recorder.push(clock.time, clock.dt, &self.sample);
    }

    /// Completes the open samples at the end of the stage or of the run, `time` in s.
    pub fn finish(&mut self, time: f64) {
        self.recorder.finish(time);
    }

    /// Takes the finished samples out: times (s) and one row for each time, probe after probe.
    pub fn take(&mut self) -> (Vec<f64>, Vec<f64>) {
        self.recorder.take()
    }
}

fn channel_names(water: bool, stress: bool) -> Vec<&'static str> {
    let mut names = vec![
        "acceleration_x",
        "acceleration_y",
        "velocity_x",
        "velocity_y",
        "displacement_x",
        "displacement_y",
    ];
    if water {
        names.push("excess_pore_pressure");
    }
    if stress {
        names.extend(["stress_xx", "stress_yy", "stress_xy", "strain_xx", "strain_yy", "gamma_xy"]);
    }
    names
}

/// Filtered, thinned samples of a fixed set of channels.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct LowPassRecorder {
    interval: f64,
    channels: usize,
    /// Open samples: index, sum of weights, weighted sums of the values.
    open: VecDeque<(u64, f64, Vec<f64>)>,
    spare: Vec<Vec<f64>>,
    next: u64,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl LowPassRecorder {
    /// A recorder of `channels` values each step, thinned to `interval` seconds (or to [`FEWEST_STEPS`] steps).
    pub fn new(channels: usize, interval: f64, dt: f64) -> Self {
        Self {
            interval: interval.max(FEWEST_STEPS * dt),
            channels,
            open: VecDeque::new(),
            spare: Vec::new(),
            next: 0,
            times: Vec::new(),
            values: Vec::new(),
        }
    }

    /// Takes the values of one step of length `dt` at `time`.
    pub fn push(&mut self, time: f64, dt: f64, values: &[f64]) {
        let place = time / self.interval;
        while self.next as f64 <= place + HALF_WIDTH {
            let mut sum = self.spare.pop().unwrap_or_else(|| vec![0.0; self.channels]);
            sum.fill(0.0);
            self.open.push_back((self.next, 0.0, sum));
            self.next += 1;
        }
        while self.open.front().is_some_and(|&(sample, ..)| (sample as f64) < place - HALF_WIDTH) {
            self.close_front();
        }
        for (sample, total, sum) in &mut self.open {
            let weight = dt * filter_weight(place - *sample as f64);
            *total += weight;
            for (s, value) in sum.iter_mut().zip(values) {
                *s += weight * value;
            }
        }
    }

    fn close_front(&mut self) {
        if let Some((sample, total, sum)) = self.open.pop_front() {
            if total > 0.0 {
                self.times.push(sample as f64 * self.interval);
                self.values.extend(sum.iter().map(|s| s / total));
            }
            self.spare.push(sum);
        }
    }

    /// Completes the samples up to `time`, the end of the stage; one-sided windows are normalised.
    pub fn finish(&mut self, time: f64) {
        while self.open.front().is_some_and(|&(sample, ..)| sample as f64 * self.interval <= time) {
            self.close_front();
        }
        self.open.clear();
    }

    /// Takes the finished samples out: times (s) and values, one row of channels for each time.
    pub fn take(&mut self) -> (Vec<f64>, Vec<f64>) {
        (std::mem::take(&mut self.times), std::mem::take(&mut self.values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(frequency: f64) -> (Vec<f64>, Vec<f64>) {
        let (dt, interval) = (4e-4, 0.005);
        let mut recorder = LowPassRecorder::new(1, interval, dt);
        for step in 0..5000 {
            let time = f64::from(step) * dt;
            recorder.push(time, dt, &[(2.0 * PI * frequency * time).cos()]);
        }
        recorder.finish(2.0);
        recorder.take()
    }

    #[test]
    fn low_frequencies_pass_without_phase_shift() {
        for frequency in [0.5, 5.0, 10.0, 25.0] {
            let (times, values) = recorded(frequency);
            assert!((times[1] - 0.005).abs() < 1e-15);
            let worst = times.iter().zip(&values).skip(8).take(380);
            let worst = worst.map(|(t, v)| (v - (2.0 * PI * frequency * t).cos()).abs()).fold(0.0, f64::max);
            assert!(worst < 0.005, "{frequency} Hz: {worst}");
        }
    }

    #[test]
    fn frequencies_that_would_alias_are_stopped() {
        for frequency in [160.0, 210.0, 390.0] {
            let (_, values) = recorded(frequency);
            let worst = values.iter().skip(8).take(380).fold(0.0_f64, |a, v| a.max(v.abs()));
            assert!(worst < 0.02, "{frequency} Hz: {worst}");
        }
    }
}
