//! PM4Sand along the reference strain paths (OpenSees 3.7.1; `tests/data/pm4sand_strain_paths/README.md`).

mod point;

use point::{StrainPath, parts, sand};
use sandboil_soil::Integrator;

/// Allowed rms difference of stress, kPa: ten times the reference's own uncertainty on the first two paths.
const ALLOWED_RMS: f64 = 0.01;

#[test]
fn reference_integrator_gives_the_reference_stresses() {
    for path in StrainPath::all() {
        let difference =
            path.compare(&sand(path.calibration), &Integrator::Reference, Integrator::REFERENCE_INCREMENT);
        println!("{}: rms {:.5} kPa, largest {:.4} kPa", path.name, difference.rms, difference.largest);
        assert!(difference.rms <= ALLOWED_RMS, "{}: {} kPa", path.name, difference.rms);
    }
}

#[test]
fn rows_are_whole_commits_apart() {
    for path in StrainPath::all() {
        let mut commits = 0;
        for (increment, row) in path.legs() {
            commits += parts(&increment, Integrator::REFERENCE_INCREMENT).0;
            assert_eq!(commits, row.step, "{}", path.name);
        }
    }
}

/// On the third path a reversal is nearly neutral: the reference itself moves by 0.1 kPa with twice its commit.
#[test]
fn default_part_finds_the_reversals_of_the_reference() {
    let rk4 = Integrator::RungeKutta4 { max_increment: Integrator::DEFAULT_INCREMENT };
    for integrator in [Integrator::default(), rk4] {
        for (path, (allowed_rms, reversals)) in
            StrainPath::all().into_iter().zip([(0.01, 28), (0.01, 12), (0.2, 12)])
        {
            let difference = path.compare(&sand(path.calibration), &integrator, 1e-4);
            assert!(difference.rms <= allowed_rms, "{}: {} kPa", path.name, difference.rms);
            assert_eq!(difference.report.reversals, reversals, "{}", path.name);
        }
    }
}
