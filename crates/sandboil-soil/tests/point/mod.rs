//! Calibrations and strain paths shared by tests, bench and example.
#![allow(dead_code, reason = "each user needs only a part")]
#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of steps, small and positive"
)]

use sandboil_soil::pm4sand::{Options, PM4Sand, Parameters, State};
use sandboil_soil::{Integrator, SoilModel, StrainIncrement, Stress, UpdateReport};

/// Relative density, shear modulus coefficient, contraction rate of the three generic calibrations (Boulanger and
/// Ziotopoulou 2017, for 6, 14 and 26 blows).
pub const CALIBRATIONS: [(f64, f64, f64); 3] =
    [(0.35, 476.0, 0.53), (0.55, 677.0, 0.40), (0.75, 890.0, 0.63)];

/// Vertical effective stress of the check values, kPa.
pub const SIGMA_V0: f64 = 101.3;

/// A material with default secondary parameters.
pub fn sand_with((dr, g0, hpo): (f64, f64, f64), options: Options) -> PM4Sand {
    PM4Sand::new(Parameters { dr, g0, hpo, ..Parameters::default() }, options).unwrap()
}

/// A material with default secondary parameters and options.
pub fn sand(calibration: (f64, f64, f64)) -> PM4Sand {
    sand_with(calibration, Options::default())
}

/// Increment of shear strain alone.
pub fn shear(xy: f64) -> StrainIncrement {
    StrainIncrement { xy, ..StrainIncrement::default() }
}

/// Components (xx, yy, xy) of a tensor turned counter-clockwise.
pub fn rotated([xx, yy, xy]: [f64; 3], angle: f64) -> [f64; 3] {
    let (sin, cos) = (2.0 * angle).sin_cos();
    let (mean, difference) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let turned = difference * cos - xy * sin;
    [mean + turned, mean - turned, xy * cos + difference * sin]
}

/// Updates a state; panics on error.
pub fn advance(
    sand: &PM4Sand,
    state: &mut State,
    increment: &StrainIncrement,
    integrator: &Integrator,
) -> UpdateReport {
    sand.update(state, increment, integrator).unwrap()
}

/// Vertical stress `SIGMA_V0` with `K_0 = 0.5`, kPa, tension positive.
pub fn anisotropic() -> Stress {
    Stress { xx: -0.5 * SIGMA_V0, yy: -SIGMA_V0, xy: 0.0, zz: -0.5 * SIGMA_V0 }
}

/// State at [`anisotropic`] stress. The void ratio includes the strain of an elastic consolidation with `G = G_o p_A`
/// and Poisson's ratio 1/3.
pub fn consolidated(sand: &PM4Sand) -> State {
    let c = sand.parameters();
    let mean = 0.75 * SIGMA_V0;
    let strain = mean / (3.0 * c.g0 * c.p_atm);
    let e0 = c.initial_void_ratio();
    sand.initialise(anisotropic(), Some(e0 - (1.0 + e0) * strain)).unwrap()
}

/// Equal parts of `increment`, none with a component above `largest`.
pub fn parts(increment: &StrainIncrement, largest: f64) -> (u32, StrainIncrement) {
    let component = increment.xx.abs().max(increment.yy.abs()).max(increment.xy.abs());
    let count = (component / largest - 1e-4).ceil().max(1.0);
    let share = 1.0 / count;
    let part = StrainIncrement {
        xx: increment.xx * share,
        yy: increment.yy * share,
        xy: increment.xy * share,
        spin: increment.spin * share,
    };
    (count as u32, part)
}

/// One row of a reference strain path.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Number of commits of the reference up to this row.
    pub step: u32,
    /// Strain xx, yy and engineering shear, tension positive.
    pub strain: [f64; 3],
    /// Effective stress xx, yy, xy, kPa, tension positive.
    pub stress: [f64; 3],
}

/// A reference strain path; for its origin see `tests/data/pm4sand_strain_paths/README.md`.
pub struct StrainPath {
    pub name: &'static str,
    pub calibration: (f64, f64, f64),
    pub rows: Vec<Row>,
}

/// Difference of stress from a reference path, kPa, over all rows and components, and the counters of the updates.
#[derive(Debug, Default)]
pub struct Difference {
    pub rms: f64,
    pub largest: f64,
    pub report: UpdateReport,
}

impl StrainPath {
    pub fn all() -> [Self; 3] {
        let [loose, medium, dense] = CALIBRATIONS;
        let read = |name, calibration, text: &str| {
            let rows = text.lines().skip(1).map(|line| {
                let v: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
                Row { step: v[0] as u32, strain: [v[1], v[2], v[3]], stress: [v[4], v[5], v[6]] }
            });
            Self { name, calibration, rows: rows.collect() }
        };
        [
            read("sp1", medium, include_str!("../data/pm4sand_strain_paths/sp1_dss_cyclic_Dr55.csv")),
            read(
                "sp2",
                loose,
                include_str!("../data/pm4sand_strain_paths/sp2_shear_with_volume_change_Dr35.csv"),
            ),
            read("sp3", dense, include_str!("../data/pm4sand_strain_paths/sp3_multidirectional_Dr75.csv")),
        ]
    }

    /// State at the first row.
    pub fn start(&self, sand: &PM4Sand) -> State {
        let [xx, yy, xy] = self.rows[0].stress;
        sand.initialise(Stress { xx, yy, xy, zz: xx }, None).unwrap()
    }

    /// Strain increments between rows, each with the row at its end.
    pub fn legs(&self) -> impl Iterator<Item = (StrainIncrement, &Row)> {
        self.rows.windows(2).map(|pair| {
            let [xx, yy, xy] = [0, 1, 2].map(|i| pair[1].strain[i] - pair[0].strain[i]);
            (StrainIncrement { xx, yy, xy, spin: 0.0 }, &pair[1])
        })
    }

    /// Updates a point along the path with increments of at most `host_increment`.
    pub fn compare(&self, sand: &PM4Sand, integrator: &Integrator, host_increment: f64) -> Difference {
        let mut state = self.start(sand);
        let mut difference = Difference::default();
        let mut squares = 0.0;
        for (increment, row) in self.legs() {
            let (count, part) = parts(&increment, host_increment);
            for _ in 0..count {
                difference.report += advance(sand, &mut state, &part, integrator);
            }
            let stress = sand.stress(&state);
            for (ours, theirs) in [stress.xx, stress.yy, stress.xy].into_iter().zip(row.stress) {
                squares += (ours - theirs).powi(2);
                difference.largest = difference.largest.max((ours - theirs).abs());
            }
        }
        difference.rms = (squares / (3 * (self.rows.len() - 1)) as f64).sqrt();
        difference
    }
}

/// Results of cyclic simple shear at constant volume, reversed exactly where the shear stress reaches `csr * SIGMA_V0`.
#[derive(Debug, Default)]
pub struct CyclicShear {
    /// Vertical effective stress at the end of each half cycle, kPa, compression positive.
    pub vertical_stress: Vec<f64>,
    /// Cycles until the shear strain first reaches 3 %; the last half cycle is interpolated in shear stress.
    pub cycles: f64,
    /// Cumulative fabric when the shear strain first reaches 3.5 %.
    pub cumulative_fabric: f64,
    /// Accumulated absolute shear strain up to 3.5 %.
    pub travel: f64,
    pub report: UpdateReport,
}

/// Cyclic shear from [`consolidated`] to 3.5 % shear strain, in steps of `step`, first towards positive stress. A test
/// without liquefaction ends after 60 half cycles, with an infinite number of cycles.
pub fn cyclic_shear(sand: &PM4Sand, csr: f64, integrator: &Integrator, step: f64) -> CyclicShear {
    const COUNTED: f64 = 0.03;
    const LAST: f64 = 0.035;
    let target = csr * SIGMA_V0;
    let mut test = CyclicShear { cycles: f64::INFINITY, ..CyclicShear::default() };
    let mut state = consolidated(sand);
    let (mut strain, mut direction, mut stress) = (0.0_f64, 1.0, 0.0);
    while strain.abs() < LAST && test.vertical_stress.len() < 60 {
        // State after a share of a step, and its shear stress beyond the target.
        let moved = |share: f64| {
            let mut next = state;
            let report = advance(sand, &mut next, &shear(direction * share * step), integrator);
            (next, report, direction * sand.stress(&next).xy - target)
        };
        let (mut next, mut report, mut excess) = moved(1.0);
        let (mut low, mut high, mut share) = (0.0, 1.0, 1.0);
        let reverses = excess >= 0.0;
        while reverses && excess.abs() > 1e-9 * target && high - low > 1e-12 {
            share = 0.5 * (low + high);
            (next, report, excess) = moved(share);
            if excess >= 0.0 { high = share } else { low = share }
        }
        let (before, stress_before) = (strain, stress);
        strain += direction * share * step;
        stress = sand.stress(&next).xy;
        test.report += report;
        test.travel += share * step;
        state = next;
        if strain.abs() >= COUNTED && test.cycles.is_infinite() {
            let within = (COUNTED - before.abs()) / (strain.abs() - before.abs());
            let tau = direction * (stress_before + within * (stress - stress_before));
            test.cycles = 0.5 * (test.vertical_stress.len() as f64 + 0.5 * (tau / target + 1.0));
        }
        if reverses {
            test.vertical_stress.push(-sand.stress(&state).yy);
            direction = -direction;
        }
    }
    test.cumulative_fabric = state.cumulative_fabric();
    test
}
