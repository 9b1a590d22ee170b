//! Integration error for several part sizes and tolerances, as CSV:
//! `cargo run --release -p sandboil-soil --example step_error`.
//!
//! Columns: difference of stress (kPa) after first loading from a very fine solution, stress differences (rms, kPa)
//! along the three reference strain paths, cycles to 3 % shear strain in the cyclic test of the middle calibration, and
//! evaluations of the rate equations per unit of shear strain. Every increment is one part.

#[path = "../tests/point/mod.rs"]
mod point;

use point::{CALIBRATIONS, StrainPath, advance, consolidated, cyclic_shear, parts, sand, shear};
use sandboil_soil::{Integrator, SoilModel, Stress};

const PARTS: [f64; 8] = [5e-7, 1e-6, 2.5e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4];
const TOLERANCES: [f64; 5] = [1e-6, 1e-5, 3e-5, 1e-4, 1e-3];
/// Cyclic stress ratio of the middle calibration.
const CSR: f64 = 0.147;
/// Shear strain of the first loading, a multiple of every part.
const FIRST_LOADING: f64 = 4e-4;
/// Part size of the very fine solution.
const FINE_PART: f64 = 1.25e-7;

/// Stress of the middle calibration at the end of a first loading.
fn first_loading(integrator: &Integrator, largest: f64) -> Stress {
    let sand = sand(CALIBRATIONS[1]);
    let mut state = consolidated(&sand);
    let (count, part) = parts(&shear(FIRST_LOADING), largest);
    for _ in 0..count {
        advance(&sand, &mut state, &part, integrator);
    }
    sand.stress(&state)
}

#[expect(clippy::print_stdout, reason = "the program prints a table")]
fn print_row(name: &str, tolerance: f64, part: f64, integrator: &Integrator, exact: Stress) {
    let end = first_loading(integrator, part);
    let first = (end.xx - exact.xx).hypot(end.yy - exact.yy).hypot(end.xy - exact.xy);
    let paths = StrainPath::all().map(|path| {
        let difference = path.compare(&sand(path.calibration), integrator, part);
        let report = difference.report;
        format!("{:.4},{},{}", difference.rms, report.reversals, report.near_neutral_reversals)
    });
    let test = cyclic_shear(&sand(CALIBRATIONS[1]), CSR, integrator, part);
    let evaluations = test.report.evaluations as f64 / test.travel;
    println!(
        "{name},{tolerance:e},{part:e},{first:.3e},{},{:.3},{:.2},{evaluations:.2e},{}",
        paths.join(","),
        test.cycles,
        test.cumulative_fabric,
        test.report.forced_acceptances
    );
}

#[expect(clippy::print_stdout, reason = "the program prints a table")]
fn main() {
    println!(
        "integrator,tolerance,part,first_loading_kPa,sp1_rms_kPa,sp1_reversals,sp1_near_neutral,sp2_rms_kPa,\
         sp2_reversals,sp2_near_neutral,sp3_rms_kPa,sp3_reversals,sp3_near_neutral,cycles_to_3_percent,\
         cumulative_fabric,evaluations_per_strain,forced_acceptances"
    );
    let exact = first_loading(&Integrator::RungeKutta4 { max_increment: FINE_PART }, FINE_PART);
    for tolerance in TOLERANCES.into_iter().chain([f64::INFINITY]) {
        for max_increment in PARTS {
            let integrator = Integrator::ModifiedEuler { tolerance, max_increment };
            print_row("modified Euler", tolerance, max_increment, &integrator, exact);
        }
    }
    for max_increment in PARTS {
        print_row("Runge-Kutta", f64::NAN, max_increment, &Integrator::RungeKutta4 { max_increment }, exact);
    }
    for part in PARTS.into_iter().filter(|part| *part <= Integrator::REFERENCE_INCREMENT) {
        print_row("reference", f64::NAN, part, &Integrator::Reference, exact);
    }
}
