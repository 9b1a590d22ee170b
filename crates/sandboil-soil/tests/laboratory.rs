//! The specimen: mixed control, turns at the stress asked for, and cycles as they are counted.

mod point;

use point::{CALIBRATIONS, SIGMA_V0, anisotropic, sand};
use sandboil_soil::elastic::Elastic;
use sandboil_soil::laboratory::{Ending, Path, Record, Resolution, Shear, Specimen, Turn, Turns};
use sandboil_soil::{Integrator, SoilModel};

const STEP: f64 = 1e-5;

#[expect(clippy::unwrap_used, reason = "the stress is one that every model takes")]
fn specimen<M: SoilModel + 'static>(model: &M) -> Specimen {
    Specimen::new(model, anisotropic(), None, Integrator::default()).unwrap()
}

fn never() -> bool {
    false
}

fn cyclic(csr: f64, drained: bool, count: usize) -> Shear {
    let tau = csr * SIGMA_V0;
    let turns = Turns::Alternating { odd: Turn::Stress(tau), even: Turn::Stress(-tau), count };
    Shear { drained, turns, strain_step: STEP, strain_limit: 0.05 }
}

#[test]
fn stress_turns_where_it_is_told_to_and_cycles_count_halves() {
    for drained in [false, true] {
        let mut specimen = specimen(&sand(CALIBRATIONS[1]));
        let mut record = Record::new(Resolution::TURNS);
        let ending = specimen.shear(&cyclic(0.147, drained, 7), &mut record, &mut never);
        assert_eq!(ending, Ending::Complete);
        let rows = record.rows();
        assert_eq!(rows.len(), 8);
        for (k, row) in rows.iter().enumerate().skip(1) {
            let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
            assert!((row.stress.xy - sign * 0.147 * SIGMA_V0).abs() < 1e-7 * SIGMA_V0, "{row:?}");
            assert_eq!(row.cycle, 0.5 * k as f64 - 0.25);
            let held = if drained { row.stress.yy + SIGMA_V0 } else { row.strain[1] };
            assert!(held.abs() < 1e-6 * SIGMA_V0, "{row:?}");
        }
    }
}

#[test]
fn a_stress_path_gives_back_the_strain_that_made_it() {
    let rock = Elastic::new(4.0e4, 8.7e4).unwrap();
    let strains = vec![[1e-4, -2e-4, 3e-4], [-2e-4, -1e-4, -1e-4]];
    let mut record = Record::new(Resolution::TURNS);
    let path = Path { by_stress: [false; 3], rows: strains.clone(), strain_step: STEP };
    assert_eq!(specimen(&rock).path(&path, &mut record, &mut never), Ending::Complete);
    let stresses: Vec<[f64; 3]> =
        record.rows()[1..].iter().map(|row| [row.stress.xx, row.stress.yy, row.stress.xy]).collect();
    for by_stress in [[true; 3], [true, false, true]] {
        let rows =
            (0..2).map(|r| [0, 1, 2].map(|k| if by_stress[k] { stresses[r][k] } else { strains[r][k] }));
        let path = Path { by_stress, rows: rows.collect(), strain_step: STEP };
        let mut record = Record::new(Resolution::TURNS);
        assert_eq!(specimen(&rock).path(&path, &mut record, &mut never), Ending::Complete);
        for (row, strain) in record.rows()[1..].iter().zip(&strains) {
            for (ours, given) in row.strain.iter().zip(strain) {
                assert!((ours - given).abs() < 1e-9, "{row:?}");
            }
        }
    }
}

#[test]
fn a_stress_that_the_sand_cannot_carry_ends_the_path_there() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::TURNS);
    let rows = vec![[-0.5 * SIGMA_V0, -SIGMA_V0, 10.0], [-0.5 * SIGMA_V0, -SIGMA_V0, 90.0]];
    let path = Path { by_stress: [true; 3], rows, strain_step: STEP };
    let ending = specimen.path(&path, &mut record, &mut never);
    let Ending::StressNotCarried { wanted, reached } = ending else { panic!("{ending:?}") };
    assert_eq!(wanted.xy, 90.0);
    assert!(reached.xy > 10.0 && reached.xy < 90.0, "{reached:?}");
    assert_eq!(record.rows().len(), 3);
}

#[test]
fn a_copy_goes_on_as_the_specimen_would_have_and_leaves_it() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    specimen.shear(&cyclic(0.147, false, 3), &mut Record::new(Resolution::TURNS), &mut never);
    let (before, mut copy) = (specimen.stress(), specimen.copy());
    let more = cyclic(0.1, true, 4);
    let mut records = [Record::new(Resolution::TURNS), Record::new(Resolution::TURNS)];
    copy.shear(&more, &mut records[0], &mut never);
    assert_eq!(specimen.stress(), before);
    specimen.shear(&more, &mut records[1], &mut never);
    assert_eq!(records[0].rows(), records[1].rows());
}
