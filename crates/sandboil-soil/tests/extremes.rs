//! PM4Sand at the ends of its range. Verdict of every test here: stable and finite, the bound stated.

mod point;

use point::{CALIBRATIONS, advance, anisotropic, consolidated, sand, shear};
use sandboil_soil::pm4sand::{PM4Sand, State};
use sandboil_soil::{Integrator, SoilModel, StrainIncrement, Stress};

fn integrators() -> [Integrator; 3] {
    let rk4 = Integrator::RungeKutta4 { max_increment: Integrator::DEFAULT_INCREMENT };
    [Integrator::default(), rk4, Integrator::Reference]
}

/// Shear modulus coefficient at a relative density (Boulanger and Ziotopoulou 2017: `N = 46 D_R^2`).
fn calibration_at(dr: f64) -> (f64, f64, f64) {
    (dr, 167.0 * (46.0 * dr * dr + 2.5).sqrt(), 0.5)
}

/// Fails unless the state is finite, above its pressure floor and inside its yield surface.
fn assert_admissible(sand: &PM4Sand, state: &State, context: &str) {
    let stress = sand.stress(state);
    let p = state.mean_stress();
    assert!(p >= 0.2 * state.minimum_pressure() * (1.0 - 1e-12), "{context}: p = {p} kPa");
    let alpha = state.back_stress_ratio();
    let (difference, xy) = (-0.5 * (stress.xx - stress.yy), -stress.xy);
    let outward = (difference - p * alpha.half_difference).hypot(xy - p * alpha.xy) * 2.0_f64.sqrt();
    let f = outward - sand.parameters().m / 2.0_f64.sqrt() * p;
    assert!(f <= 1e-8 * 101.3 + 1e-14 * p, "{context}: f = {f} kPa at p = {p} kPa");
}

#[test]
fn loosest_and_densest_sand() {
    for dr in [0.05, 1.0] {
        let sand = sand(calibration_at(dr));
        for integrator in integrators() {
            let mut state = consolidated(&sand);
            for step in 0..400 {
                let sign = if step / 40 % 2 == 0 { 1.0 } else { -1.0 };
                advance(&sand, &mut state, &shear(sign * 2e-4), &integrator);
                assert_admissible(&sand, &state, &format!("D_R {dr}, {integrator:?}"));
            }
        }
    }
}

/// Contraction ends at `2 p_min` and dilation is forced below it: the pressure can only recover towards that.
#[test]
fn hundred_thousand_tiny_cycles_at_the_smallest_pressure() {
    let sand = sand(CALIBRATIONS[1]);
    let pressure = 0.005 * sand.parameters().p_atm;
    let start = Stress { xx: -pressure, yy: -pressure, xy: 0.0, zz: -pressure };
    for amplitude in [1e-6, 1e-5] {
        let mut state = sand.initialise(start, None).unwrap();
        for _ in 0..100_000 {
            for sign in [1.0, -1.0, -1.0, 1.0] {
                advance(&sand, &mut state, &shear(sign * amplitude), &Integrator::default());
            }
            let p = state.mean_stress();
            assert!(p > 0.99 * pressure && p < 2.1 * pressure, "{p} kPa");
        }
        assert_admissible(&sand, &state, &format!("amplitude {amplitude}"));
    }
}

#[test]
fn steps_from_1e_9_to_1e_2_reversed_every_time() {
    for calibration in CALIBRATIONS {
        let sand = sand(calibration);
        for integrator in integrators() {
            for exponent in -9..=-2 {
                let step = 10.0_f64.powi(exponent);
                let mut state = consolidated(&sand);
                for sign in [1.0, -1.0].into_iter().cycle().take(30) {
                    let size = sign * step;
                    let de = StrainIncrement { xx: 0.1 * size, yy: -0.1 * size, xy: size, spin: 0.0 };
                    advance(&sand, &mut state, &de, &integrator);
                    assert_admissible(&sand, &state, &format!("step {step}, {integrator:?}"));
                }
            }
        }
    }
}

/// Inside the yield surface only the stress-dependent moduli keep a loop from closing: from an isotropic stress by
/// round-off, from `K_0 = 0.5` by less than a tenth of the yield surface.
#[test]
fn a_million_tiny_cycles_drift_little() {
    let sand = sand(CALIBRATIONS[1]);
    let isotropic = Stress { xx: -76.0, yy: -76.0, xy: 0.0, zz: -76.0 };
    for (start, allowed) in [(isotropic, 1e-6), (anisotropic(), 0.05)] {
        let mut state = sand.initialise(start, None).unwrap();
        for _ in 0..1_000_000 {
            for sign in [1.0, -1.0] {
                advance(&sand, &mut state, &shear(sign * 1e-6), &Integrator::default());
            }
        }
        let stress = sand.stress(&state);
        let drift = (stress.xx - start.xx).abs().max((stress.yy - start.yy).abs()).max(stress.xy.abs());
        assert!(drift < allowed, "{drift} kPa");
    }
}

/// Plastic cycles of 0.001 % amplitude: pressure falls and never below what liquefaction leaves.
#[test]
fn a_hundred_thousand_small_plastic_cycles_stay_bounded() {
    let sand = sand(CALIBRATIONS[1]);
    let mut state = consolidated(&sand);
    let start = state.mean_stress();
    for _ in 0..100_000 {
        for sign in [1.0, -1.0, -1.0, 1.0] {
            advance(&sand, &mut state, &shear(sign * 1e-5), &Integrator::default());
        }
        assert!(state.mean_stress() <= start && state.mean_stress() > 2.0 * state.minimum_pressure());
    }
    assert_admissible(&sand, &state, "small plastic cycles");
}
