//! PM4Sand in simple shear at constant volume against tables of check values: OpenSees 3.7.1 for monotonic loading,
//! an independent program with exact load reversals for cyclic loading.

mod point;

use point::{CALIBRATIONS, advance, consolidated, cyclic_shear, sand, shear};
use sandboil_soil::{Integrator, SoilModel};

/// Shear strain, then `s_xx`, `s_yy`, `tau` (kPa, compression positive) of each calibration.
const MONOTONIC: [(f64, [[f64; 3]; 3]); 5] = [
    (0.001, [[55.36, 95.13, 13.82], [57.31, 93.96, 20.20], [58.88, 93.00, 26.65]]),
    (0.005, [[55.99, 71.20, 28.25], [68.40, 80.56, 41.10], [94.56, 107.56, 63.79]]),
    (0.01, [[53.86, 58.77, 30.56], [95.05, 100.33, 59.80], [170.81, 177.71, 117.49]]),
    (0.02, [[66.02, 66.41, 37.82], [159.09, 159.49, 98.23], [350.97, 351.70, 232.57]]),
    (0.05, [[100.42, 100.42, 56.79], [372.89, 372.89, 222.82], [1016.88, 1016.88, 632.55]]),
];

/// Cyclic stress ratio; vertical stress (kPa) after 4, 8, 12 and 20 half cycles; cycles to 3 %; cumulative fabric at
/// 3.5 % shear strain.
const CYCLIC: [(f64, [f64; 4], f64, f64); 3] = [
    (0.090, [84.87, 74.62, 68.02, 55.87], 14.48, 4.95),
    (0.147, [79.64, 70.25, 64.18, 46.89], 14.47, 36.06),
    (0.312, [73.33, 67.84, 62.03, 51.44], 13.96, 158.5),
];

/// Calls `compare` with each stress of the monotonic tests and the tabulated one, kPa.
fn monotonic(integrator: &Integrator, host_increment: f64, compare: impl Fn(f64, f64)) {
    for (row, calibration) in CALIBRATIONS.into_iter().enumerate() {
        let sand = sand(calibration);
        let mut state = consolidated(&sand);
        let mut steps = 0;
        for (strain, expected) in MONOTONIC {
            while f64::from(steps) * host_increment < strain - 0.5 * host_increment {
                advance(&sand, &mut state, &shear(host_increment), integrator);
                steps += 1;
            }
            let stress = sand.stress(&state);
            for (ours, theirs) in [-stress.xx, -stress.yy, stress.xy].into_iter().zip(expected[row]) {
                compare(ours, theirs);
            }
        }
    }
}

#[test]
fn monotonic_reference() {
    monotonic(&Integrator::Reference, 1e-6, |ours, theirs| {
        assert!((ours - theirs).abs() <= 0.02, "{ours} kPa instead of {theirs}");
    });
}

/// By default the plastic modulus is clamped during dilation (version 3.3); this changes the results slightly near the
/// bounding surface.
#[test]
fn monotonic_default() {
    monotonic(&Integrator::default(), 1e-5, |ours, theirs| {
        assert!((ours - theirs).abs() <= 1e-3 * theirs, "{ours} kPa instead of {theirs}");
    });
}

/// Load reversals are exact, so the result depends neither on the caller's increment nor on the integrator.
#[test]
fn cyclic() {
    let rk4 = Integrator::RungeKutta4 { max_increment: Integrator::DEFAULT_INCREMENT };
    for integrator in [Integrator::Reference, Integrator::default(), rk4] {
        for step in [2e-6, 1e-4] {
            for (calibration, (csr, vertical_stress, cycles, fabric)) in CALIBRATIONS.into_iter().zip(CYCLIC)
            {
                let test = cyclic_shear(&sand(calibration), csr, &integrator, step);
                let context = format!("{integrator:?}, step {step}, CSR {csr}");
                for (half_cycle, expected) in [4, 8, 12, 20].into_iter().zip(vertical_stress) {
                    let ours = test.vertical_stress[half_cycle - 1];
                    assert!((ours - expected).abs() <= 0.03, "{context}: {ours} kPa instead of {expected}");
                }
                assert!((test.cycles - cycles).abs() <= 0.01, "{context}: {} cycles", test.cycles);
                let ours = test.cumulative_fabric;
                assert!((ours - fabric).abs() <= 2e-3 * fabric, "{context}: {ours} instead of {fabric}");
            }
        }
    }
}
