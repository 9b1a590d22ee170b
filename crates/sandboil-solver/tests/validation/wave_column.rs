//! Vertical shear waves in an elastic column on the compliant base against the closed form: the surface moves
//! with twice the upgoing wave, delayed by the travel time.

use crate::{
    common::{column, dual, elastic},
    waves::{amplitude, damping_ratio, ricker, surface_velocity, weightless},
};
use sandboil_solver::{Model, Operators, Vertical};
use std::f64::consts::PI;

const SPEED: f64 = 100.0;
const DENSITY: f64 = 2.0;
const HEIGHT: f64 = 20.0;
/// Time of the pulse's centre at the base, s.
const CENTRE: f64 = 0.8;
const DURATION: f64 = 2.2;

/// A uniform column of the given operators.
fn uniform(operators: Operators, spacing: f64, smoothing_ratio: f64) -> Model {
    let shear_modulus = DENSITY * SPEED * SPEED;
    let column = column(HEIGHT, spacing, 1, elastic(shear_modulus, 2.0 * shear_modulus), None);
    let mut model = weightless(if operators == Operators::Dual { dual(column) } else { column });
    model.numerics.operators = operators;
    model.numerics.smoothing_ratio = smoothing_ratio;
    model
}

fn surface_pulse(
    operators: Operators,
    spacing: f64,
    smoothing_ratio: f64,
    frequency: f64,
) -> (Vec<f64>, Vec<f64>) {
    let model = uniform(operators, spacing, smoothing_ratio);
    surface_velocity(&model, |time| ricker(frequency, time - CENTRE), DURATION, |_| ())
}

/// Phase error of the least-squares operators, `1 - c_num/c = 5.0 (h / lambda)^2`, weighted with the spectrum
/// of the pulse: the misfit by dispersion alone. It is nearly the whole misfit found, so the errors of base,
/// surface and time stepping are small.
fn dispersion_misfit(smoothing_length: f64, frequency: f64) -> f64 {
    // Root of the spectral mean of (f/f0)^6 for the spectrum f^2 exp(-(f/f0)^2).
    const SIXTH_MOMENT_ROOT: f64 = 2.218;
    let delay = 5.0 * (smoothing_length * frequency / SPEED).powi(2) * HEIGHT / SPEED;
    2.0 * PI * frequency * delay * SIXTH_MOMENT_ROOT
}

/// Largest value of a signal, from the parabola through its largest sample and the two next to it.
fn summit(signal: &[f64]) -> f64 {
    let at = (1..signal.len() - 1).max_by(|&a, &b| signal[a].total_cmp(&signal[b])).unwrap();
    let [before, top, after] = [signal[at - 1], signal[at], signal[at + 1]];
    top - 0.125 * (after - before).powi(2) / (after - 2.0 * top + before)
}

#[test]
fn ricker_pulse_on_a_compliant_base() {
    use Operators::{Conservative, Dual, Printed};
    for (operators, spacing, ratio, peaks) in [
        (Conservative, 0.2, 1.4, [(2.0, 5e-4), (5.0, 3e-3), (10.0, 1.6e-2)]),
        (Conservative, 0.2, 1.2, [(2.0, 5e-4), (5.0, 2e-3), (10.0, 1e-2)]),
        (Dual, 0.2, 1.2, [(2.0, 5e-4), (5.0, 2e-3), (10.0, 1e-2)]),
        (Dual, 0.4, 1.2, [(2.0, 2e-3), (5.0, 1.4e-2), (10.0, 0.12)]),
        (Printed, 0.2, 1.4, [(2.0, 0.03), (5.0, 0.03), (10.0, 0.03)]),
        (Conservative, 0.4, 1.4, [(2.0, 2e-3), (5.0, 1.4e-2), (10.0, 0.12)]),
    ] {
        for (frequency, bound) in peaks {
            let (times, found) = surface_pulse(operators, spacing, ratio, frequency);
            let exact: Vec<f64> =
                times.iter().map(|t| 2.0 * ricker(frequency, t - CENTRE - HEIGHT / SPEED)).collect();
            let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
            let peak = summit(&found) / 2.0 - 1.0;
            let misfit =
                norm(&mut found.iter().zip(&exact).map(|(f, e)| f - e)) / norm(&mut exact.iter().copied());
            // The base row of the printed operators takes 2.5 % of every wave.
            let allowance = if operators == Printed { 0.04 } else { 3e-3 };
            let expected = dispersion_misfit(spacing * ratio, frequency);
            // The signal after the pulse: the reflection of the base.
            let gone = CENTRE + HEIGHT / SPEED + 1.5 / frequency.min(5.0) + 0.2;
            let late = times.iter().zip(&found).filter(|(t, _)| **t > gone);
            let late = late.map(|(_, v)| v.abs()).fold(0.0, f64::max) / 2.0;
            println!(
                "{operators:?} dx {spacing} h/dx {ratio} {frequency:4.1} Hz: peak {:+.2} %, L2 {:.2} % (dispersion {:.2} %), late {:.2} %",
                100.0 * peak,
                100.0 * misfit,
                100.0 * expected,
                100.0 * late
            );
            assert!(peak.abs() <= bound, "peak {peak}");
            assert!(misfit <= 1.15 * expected + allowance, "misfit {misfit}, dispersion {expected}");
            assert!(late <= 0.02, "late {late}");
        }
    }
}

/// Surface over outcrop motion is one at every frequency, within 1.2 % (h = 1.4 dx) and 0.7 % (1.2) below 10 Hz.
#[test]
fn transfer_function_of_the_matched_column_is_one() {
    use Operators::{Conservative, Dual};
    for (operators, ratio, bound) in
        [(Conservative, 1.4, 0.012), (Conservative, 1.2, 0.007), (Dual, 1.2, 0.007)]
    {
        let (times, found) = surface_pulse(operators, 0.2, ratio, 5.0);
        let outcrop: Vec<f64> = times.iter().map(|t| 2.0 * ricker(5.0, t - CENTRE)).collect();
        let worst = [0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0]
            .map(|f| amplitude(&times, &found, f) / amplitude(&times, &outcrop, f) - 1.0)
            .into_iter()
            .fold(0.0_f64, |a, b| a.max(b.abs()));
        println!(
            "{operators:?}, h/dx {ratio}: transfer function differs from one by at most {:.2} %",
            100.0 * worst
        );
        assert!(worst <= bound, "{worst}");
    }
}

/// Largest difference of a matched column's transfer function from one, at multiples of 0.1 Hz below 5 Hz and
/// below 10 Hz: the reflection of its base. Compression waves enter through an absorbing base.
fn base_errors(model: &Model, compression: bool) -> [f64; 2] {
    const FREQUENCY: f64 = 5.0;
    let upgoing = |time: f64| ricker(FREQUENCY, time - CENTRE);
    let (times, found) = surface_velocity(model, upgoing, 2.0 * DURATION, |stage| {
        if compression {
            stage.base.vertical = Vertical::Absorbing;
            for wave in &mut stage.base.waves {
                std::mem::swap(&mut wave.horizontal, &mut wave.vertical);
            }
        }
    });
    let outcrop: Vec<f64> = times.iter().map(|time| 2.0 * upgoing(*time)).collect();
    [(2, 50), (50, 100)].map(|(from, to)| {
        (from..=to)
            .map(|tenths| 0.1 * f64::from(tenths))
            .map(|f| amplitude(&times, &found, f) / amplitude(&times, &outcrop, f) - 1.0)
            .fold(0.0_f64, |a, b| a.max(b.abs()))
    })
}

/// The base of a column with corrected inertia reflects at most 1 % of a wave below 5 Hz and 2 % below 10 Hz,
/// where a shear wavelength is 50 spacings. A pulse of 10 Hz is not delayed in the column.
#[test]
fn the_base_reflects_little_with_corrected_inertia() {
    use Operators::{Conservative, Dual};
    for (operators, ratio) in [(Conservative, 1.4), (Conservative, 1.2), (Conservative, 1.0), (Dual, 1.2)] {
        let mut model = uniform(operators, 0.2, ratio);
        model.numerics.dispersion_correction = true;
        for compression in [false, true] {
            let [low, high] = base_errors(&model, compression);
            println!(
                "{operators:?}, h/dx {ratio}, {} waves: off one by {:.2} % to 5 Hz, {:.2} % to 10 Hz",
                if compression { "compression" } else { "shear" },
                100.0 * low,
                100.0 * high
            );
            assert!(low <= 0.01 && high <= 0.02, "{low} {high}");
        }
        let (times, found) = surface_velocity(&model, |time| ricker(10.0, time - CENTRE), DURATION, |_| ());
        let exact: Vec<f64> = times.iter().map(|t| 2.0 * ricker(10.0, t - CENTRE - HEIGHT / SPEED)).collect();
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
        let misfit =
            norm(&mut found.iter().zip(&exact).map(|(f, e)| f - e)) / norm(&mut exact.iter().copied());
        let uncorrected = dispersion_misfit(0.2 * ratio, 10.0);
        println!(
            "{operators:?}, h/dx {ratio}, 10 Hz: L2 {:.2} %, uncorrected {:.2} %",
            100.0 * misfit,
            100.0 * uncorrected
        );
        assert!(misfit < 0.25 * uncorrected, "{misfit} {uncorrected}");
    }
}

/// Corrected inertia neither takes nor gives energy.
#[test]
fn corrected_inertia_does_not_damp() {
    for (operators, ratio) in [(Operators::Conservative, 1.4), (Operators::Dual, 1.2)] {
        let mut model = uniform(operators, 0.4, ratio);
        model.numerics.dispersion_correction = true;
        model.numerics.velocity_filter = 0.0;
        let ratio = damping_ratio(&model, 4.0 * HEIGHT / SPEED, |_| ());
        println!("{operators:?}: damping ratio {ratio:.1e}");
        assert!(ratio.abs() < 1e-5, "{ratio}");
    }
}

/// Local damping (Eq. 16) of strength `xi` is a damping ratio `xi / pi` at any frequency, besides the small
/// radiation through the nearly rigid base.
#[test]
fn local_damping_is_a_ratio_of_xi_over_pi() {
    const XI: f64 = 0.05;
    let model = uniform(Operators::Conservative, 0.4, 1.4);
    let period = 4.0 * HEIGHT / SPEED;
    let ratio = |xi: f64| damping_ratio(&model, period, |stage| stage.local_damping = xi);
    let (without, with) = (ratio(0.0), ratio(XI));
    println!(
        "damping ratio {:.3} % without, {:.3} % with, xi/pi {:.3} %",
        100.0 * without,
        100.0 * with,
        100.0 * XI / PI
    );
    assert!(without < 2e-4, "{without}");
    assert!(((with - without) * PI / XI - 1.0).abs() < 0.05, "{with}");
}
