//! The specimen: mixed control, turns at the prescribed stress, and the number of cycles.

mod point;

use point::{CALIBRATIONS, SIGMA_V0, anisotropic, sand};
use sandboil_soil::elastic::Elastic;
use sandboil_soil::laboratory::{Ending, Path, Record, Resolution, Shear, Specimen, Turn, Turns};
use sandboil_soil::{Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport};

const STEP: f64 = 1e-5;

#[expect(clippy::unwrap_used, reason = "every model accepts this stress")]
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
fn stress_turns_at_the_prescribed_values_and_each_turn_is_half_a_cycle() {
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
fn a_stress_path_reproduces_the_strain_of_the_strain_path() {
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
fn a_stress_that_the_sand_cannot_carry_ends_the_path() {
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
fn a_copy_continues_as_the_specimen_would_and_does_not_change_it() {
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

fn simple_shear(turns: Vec<Turn>, drained: bool) -> Shear {
    Shear { drained, turns: Turns::Each(turns), strain_step: STEP, strain_limit: 0.05 }
}

/// A model with two straight branches: shear stress rises with strain to a peak and then falls to zero.
#[derive(Debug, Clone)]
struct Softening;

const PEAK_STRAIN: f64 = 1e-3;
const SHEAR_MODULUS: f64 = 1e4;

impl SoilModel for Softening {
    type State = (Stress, f64);

    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<Self::State, SoilError> {
        Ok((stress, 0.0))
    }

    fn update(
        &self,
        (stress, strain): &mut Self::State,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        *strain += de.xy;
        let size = strain.abs();
        stress.xy = SHEAR_MODULUS * size.min(2.0 * PEAK_STRAIN - size).max(0.0).copysign(*strain);
        Ok(UpdateReport::default())
    }

    fn stress(&self, state: &Self::State) -> Stress {
        state.0
    }

    fn moduli(&self, _state: &Self::State) -> Moduli {
        Moduli { bulk: 2.0 * SHEAR_MODULUS, shear: SHEAR_MODULUS }
    }

    fn static_shear_modulus(&self) -> f64 {
        SHEAR_MODULUS
    }
}

#[test]
fn a_softening_soil_that_never_reaches_the_turn_ends_at_the_strain_limit_and_its_cycles_do_not_decrease() {
    let mut specimen = specimen(&Softening);
    let mut record = Record::new(Resolution::EVERY);
    let peak = SHEAR_MODULUS * PEAK_STRAIN;
    let test = simple_shear(vec![Turn::Stress(0.5 * peak), Turn::Stress(-2.0 * peak)], false);
    assert_eq!(specimen.shear(&test, &mut record, &mut never), Ending::StrainLimit);
    let rows = record.rows();
    assert_eq!(rows.last().unwrap().turns, 1);
    assert!((specimen.strain()[2] + 0.05).abs() <= STEP);
    assert!(rows.iter().all(|row| (0.0..=0.75).contains(&row.cycle)));
}

/// The turn equals the peak of a softening branch, to round-off.
#[test]
fn a_turn_exactly_at_the_peak_is_met() {
    let mut specimen = specimen(&Softening);
    let mut record = Record::new(Resolution::TURNS);
    let peak = SHEAR_MODULUS * PEAK_STRAIN;
    let test = simple_shear(vec![Turn::Stress(peak), Turn::Strain(0.0)], false);
    assert_eq!(specimen.shear(&test, &mut record, &mut never), Ending::Complete);
    assert!((record.rows()[1].stress.xy - peak).abs() <= 1e-9 * peak);
    assert!(record.rows()[2].strain[2].abs() <= 1e-9 * PEAK_STRAIN);
}

#[test]
fn turns_may_be_at_the_present_stress_or_behind_it() {
    for drained in [false, true] {
        let mut specimen = specimen(&sand(CALIBRATIONS[1]));
        let mut record = Record::new(Resolution::TURNS);
        let turns = [5.0, 5.0, 2.0, 1.0, 0.0, 0.0, -3.0].map(Turn::Stress).to_vec();
        assert_eq!(specimen.shear(&simple_shear(turns, drained), &mut record, &mut never), Ending::Complete);
        let found: Vec<f64> = record.rows().iter().map(|row| row.stress.xy).collect();
        for (ours, expected) in found.iter().zip([0.0, 5.0, 5.0, 2.0, 1.0, 0.0, 0.0, -3.0]) {
            assert!((ours - expected).abs() < 1e-6, "{found:?}");
        }
        assert_eq!(record.rows().len(), 8);
        assert_eq!(record.rows().last().unwrap().cycle, 3.25);
    }
}

/// A second test continues from the strain and stress of the first; its strain limit is relative to its start.
#[test]
fn alternating_turns_behind_the_start_first_shear_backwards() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::TURNS);
    let test = simple_shear(vec![Turn::Stress(12.0)], false);
    assert_eq!(specimen.shear(&test, &mut record, &mut never), Ending::Complete);
    let before = specimen.strain()[2];
    let turns = Turns::Alternating { odd: Turn::Stress(8.0), even: Turn::Stress(-8.0), count: 4 };
    let test = Shear { turns, strain_limit: 1e-3, ..test };
    assert_eq!(specimen.shear(&test, &mut record, &mut never), Ending::Complete);
    assert_eq!(record.rows().len(), 6);
    assert!(record.rows()[2].strain[2] < before);
    for (row, expected) in record.rows()[2..].iter().zip([8.0, -8.0, 8.0, -8.0]) {
        assert!((row.stress.xy - expected).abs() < 1e-6, "{row:?}");
    }
}

/// Distances between turns down to the round-off of the stress, and below.
#[test]
fn turns_very_close_together_are_completed() {
    for drained in [false, true] {
        let mut specimen = specimen(&sand(CALIBRATIONS[1]));
        let mut record = Record::new(Resolution::TURNS);
        let turns =
            [1.0, 1.0 + 1e-3, 1.0, 1.0 + 1e-6, 1.0, 1.0 + 1e-9, 1.0, 1.0 + 1e-12, 1.0, 1.0 + 1e-15, 1.0];
        let turns = turns.map(|share| Turn::Stress(10.0 * share)).to_vec();
        let mut calls = 0;
        let mut stop = || {
            calls += 1;
            calls > 100
        };
        let ending = specimen.shear(&simple_shear(turns, drained), &mut record, &mut stop);
        assert_eq!(ending, Ending::Complete, "drained {drained}");
        assert!(record.rows().iter().skip(1).all(|row| (row.stress.xy - 10.0).abs() < 0.011), "{record:?}");
    }
}

/// Below `2 p_min`, here 1 kPa, dilatancy of the model jumps at the dilatancy surface, and perhaps no strain gives the
/// prescribed stress. The test then ends with [`Ending::StressNotCarried`], and all recorded rows are correct.
#[test]
fn drained_shear_at_low_pressure_keeps_its_vertical_stress_or_ends_with_an_error() {
    for (pressure, may_fail) in [(0.6, true), (5.0, false)] {
        let start = Stress { xx: -0.5 * pressure, yy: -pressure, xy: 0.0, zz: -0.5 * pressure };
        let model = sand(CALIBRATIONS[1]);
        let mut specimen = Specimen::new(&model, start, None, Integrator::default()).unwrap();
        let mut record = Record::new(Resolution::EVERY);
        let turns = [5e-4, -5e-4].map(Turn::Strain).to_vec();
        let ending = specimen.shear(&simple_shear(turns, true), &mut record, &mut never);
        let failed = matches!(ending, Ending::StressNotCarried { .. });
        assert!(ending == Ending::Complete || may_fail && failed, "{pressure} kPa: {ending:?}");
        let held = record.rows().iter().map(|row| (row.stress.yy + pressure).abs());
        assert!(held.fold(0.0, f64::max) <= 1e-7 * (1.0 + 2.0 * pressure));
    }
}

#[test]
fn invalid_numbers_are_refused_before_the_first_increment() {
    let refused = |ending: Ending| assert!(matches!(ending, Ending::Refused(_)), "{ending:?}");
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::EVERY);
    let good = simple_shear(vec![Turn::Strain(1e-3)], false);
    for strain_step in [0.0, -1e-5, f64::NAN, f64::INFINITY] {
        refused(specimen.shear(&Shear { strain_step, ..good.clone() }, &mut record, &mut never));
        let path = Path { by_stress: [false; 3], rows: vec![[1e-3; 3]], strain_step };
        refused(specimen.path(&path, &mut record, &mut never));
    }
    for strain_limit in [-1.0, f64::NAN] {
        refused(specimen.shear(&Shear { strain_limit, ..good.clone() }, &mut record, &mut never));
    }
    for turn in [Turn::Stress(f64::NAN), Turn::Strain(f64::NAN), Turn::Strain(f64::INFINITY)] {
        refused(specimen.shear(
            &simple_shear(vec![Turn::Strain(1e-4), turn], false),
            &mut record,
            &mut never,
        ));
    }
    for by_stress in [[false; 3], [true; 3]] {
        for bad in [f64::NAN, f64::INFINITY] {
            let rows = vec![[-50.0, bad, 0.0]];
            refused(specimen.path(&Path { by_stress, rows, strain_step: STEP }, &mut record, &mut never));
        }
    }
    assert_eq!(specimen.strain(), [0.0; 3]);
}

/// `stop` is also called where every leg has fewer increments than the interval between two calls.
#[test]
fn many_short_legs_and_one_long_leg_can_be_interrupted() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::TURNS);
    let test = cyclic(0.02, false, 100_000);
    assert_eq!(specimen.shear(&test, &mut record, &mut || true), Ending::Interrupted);
    assert!(record.rows().len() < 1000, "{}", record.rows().len());
    let mut calls = 0;
    let mut second = || {
        calls += 1;
        calls > 1
    };
    let path = Path { by_stress: [false; 3], rows: vec![[0.0, 0.0, 1.0]], strain_step: STEP };
    assert_eq!(specimen.path(&path, &mut record, &mut second), Ending::Interrupted);
    assert!(specimen.strain()[2] < 0.5);
}

/// Rows before a failure stay recorded, and the specimen can continue from its last state.
#[test]
fn a_path_that_fails_midway_leaves_a_usable_specimen() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::TURNS);
    let rows = vec![[-50.65, -SIGMA_V0, 10.0], [-50.65, -SIGMA_V0, 80.0], [-50.65, -SIGMA_V0, 0.0]];
    let path = Path { by_stress: [true; 3], rows, strain_step: STEP };
    assert!(matches!(specimen.path(&path, &mut record, &mut never), Ending::StressNotCarried { .. }));
    assert_eq!(record.rows().iter().map(|row| row.turns).collect::<Vec<_>>(), [0, 1, 1]);
    let last = *record.rows().last().unwrap();
    assert_eq!((last.strain, last.stress), (specimen.strain(), specimen.stress()));
    let back = Path { rows: vec![[-50.65, -SIGMA_V0, 0.0]], ..path };
    assert_eq!(specimen.path(&back, &mut record, &mut never), Ending::Complete);
    assert!(specimen.stress().xy.abs() < 1e-4);
}

#[test]
fn a_leg_of_no_length_is_one_row() {
    let mut specimen = specimen(&sand(CALIBRATIONS[1]));
    let mut record = Record::new(Resolution::EVERY);
    let here = specimen.stress();
    let path = Path { by_stress: [true; 3], rows: vec![[here.xx, here.yy, here.xy]; 2], strain_step: STEP };
    assert_eq!(specimen.path(&path, &mut record, &mut never), Ending::Complete);
    assert_eq!(record.rows().len(), 3);
    assert_eq!(specimen.strain(), [0.0; 3]);
}

/// A row is recorded where stress or strain has changed enough since the last one; turns and the end always.
#[test]
fn a_row_is_recorded_after_enough_change_of_stress_or_strain() {
    let run = |resolution: Resolution| {
        let mut record = Record::new(resolution);
        let rock = Elastic::new(4.0e4, 8.7e4).unwrap();
        let test = simple_shear(vec![Turn::Strain(1e-3)], false);
        assert_eq!(specimen(&rock).shear(&test, &mut record, &mut never), Ending::Complete);
        record.rows().len()
    };
    // The start, and a hundred increments of 1e-5, or 0.4 kPa.
    assert_eq!(run(Resolution::EVERY), 101);
    assert_eq!(run(Resolution::TURNS), 2);
    assert_eq!(run(Resolution { stress: f64::INFINITY, strain: 0.95e-4 }), 11);
    assert_eq!(run(Resolution { stress: 3.9, strain: f64::INFINITY }), 11);
    assert_eq!(run(Resolution { stress: 3.9, strain: 0.45e-4 }), 21);
}

#[test]
fn the_strain_limit_is_relative_to_the_start_of_each_shear() {
    let mut specimen = specimen(&Elastic::new(4.0e4, 8.7e4).unwrap());
    for end in [0.04, 0.08, 0.0] {
        let turns = Turns::Each(vec![Turn::Strain(end)]);
        let test = Shear { drained: false, turns, strain_step: STEP, strain_limit: 0.05 };
        let ending = specimen.shear(&test, &mut Record::new(Resolution::TURNS), &mut never);
        // From 8 % back to 0 is a change of more than 5 %.
        assert_eq!(ending, if end == 0.0 { Ending::StrainLimit } else { Ending::Complete });
    }
}
