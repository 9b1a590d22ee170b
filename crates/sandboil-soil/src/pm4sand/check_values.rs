//! Constants, initial values and single evaluations against the printed digits of an independent program (in Python,
//! with the same equations; its stress paths agree with OpenSees 3.7.1).

use super::{
    PM4Sand, Parameters, State,
    rates::{Memory, Point, Reading, direction},
    reversal,
    state::{Components, Strain},
    surfaces::stress_ratio,
};
use crate::{Deviator, Moduli, SoilModel, Stress, UpdateReport};

/// Fails unless `value` rounds to the printed number; a printed zero must be exact.
fn agrees(name: &str, value: f64, printed: &str) {
    let (mantissa, exponent) = printed.split_once('e').unwrap_or((printed, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, after)| after.len());
    let unit = 10.0_f64.powi(exponent.parse::<i32>().unwrap() - i32::try_from(decimals).unwrap());
    let expected: f64 = printed.parse().unwrap();
    let allowed = if expected == 0.0 { 0.0 } else { 0.501 * unit };
    assert!((value - expected).abs() <= allowed, "{name}: {value} instead of {printed}");
}

fn sand(dr: f64, g0: f64, hpo: f64) -> PM4Sand {
    PM4Sand::new(Parameters { dr, g0, hpo, ..Parameters::default() }, super::Options::default()).unwrap()
}

/// State at a vertical stress of one atmosphere and half of it horizontally.
fn start(sand: &PM4Sand) -> State {
    sand.initialise(Stress { xx: -50.65, yy: -101.3, xy: 0.0, zz: -50.65 }, None).unwrap()
}

fn traceless(half_difference: f64, xy: f64) -> Deviator {
    Deviator { half_difference, xy }
}

#[test]
fn constants_and_initial_values() {
    #[rustfmt::skip]
    let rows = [
        (0.35, 476.0, 0.53, ["0.30", "0.5", "5.0000", "5.1604", "0.07453", "-0.086032", "1.18308", "1.137157",
            "1.079947", "1.259314", "2.912926", "39292.27", "85133.25"]),
        (0.55, 677.0, 0.40, ["0.40", "0.5", "10.0000", "10.3656", "0.12536", "-0.286032", "4.00732", "1.256753",
            "1.058563", "1.305635", "15.008788", "57040.67", "123588.11"]),
        (0.75, 890.0, 0.63, ["0.50", "0.2", "10.0000", "30.8828", "0.21086", "-0.486032", "13.57353", "1.388927",
            "1.037602", "1.364229", "282.529064", "76006.12", "164679.92"]),
    ];
    for (dr, g0, hpo, expected) in rows {
        let sand = sand(dr, g0, hpo);
        let state = start(&sand);
        let c = sand.parameters();
        let surfaces = sand.surfaces(state.mean, c.initial_void_ratio());
        let values = [
            ("h_o", c.ho),
            ("c_eps", c.ce),
            ("C_DR", c.c_dr),
            ("C_kaf", c.c_kaf),
            ("F_sed,min", c.f_sed_min),
            ("xi_R0", surfaces.state_index),
            ("z_max", state.fabric_limit),
            ("M^b", surfaces.bounding),
            ("M^d", surfaces.dilatancy),
            ("A_do", state.dilatancy_scale),
            ("h_p", sand.contraction_resistance(surfaces.state_index)),
            ("G", state.moduli.shear),
            ("K", state.moduli.bulk),
        ];
        for ((name, value), printed) in values.into_iter().zip(expected) {
            agrees(name, value, printed);
        }
        agrees("M", c.critical_ratio, "1.089278");
        agrees("p_min", state.p_min, "0.5065");
    }
}

/// A state of the middle calibration and the expected values of the rate equations.
struct Evaluation {
    /// (mean, half difference, xy), kPa, compression positive.
    stress: (f64, f64, f64),
    fabric: Deviator,
    fabric_in: Deviator,
    alpha_in: Deviator,
    alpha_in_previous: Deviator,
    /// `z_cum`, `z_peak`, `p_zp`.
    history: (f64, f64, f64),
    surfaces: [&'static str; 4],
    moduli: [&'static str; 2],
    /// D, `K_p`, h, `b:n`, `(alpha^d - alpha):n`.
    flow: [&'static str; 5],
    /// L, then the change of stress (xx, yy, xy), of alpha (xx, xy) and of z (xx, xy) per 1e-6 of shear strain.
    change: [&'static str; 8],
}

impl Evaluation {
    fn check(&self) {
        let sand = sand(0.55, 677.0, 0.40);
        let mut state = start(&sand);
        let n = traceless(0.1, 0.7);
        let (mean, half_difference, xy) = self.stress;
        state.mean = mean;
        state.deviator = traceless(half_difference, xy);
        state.alpha = state.deviator * (1.0 / mean) - n * (0.01 / std::f64::consts::SQRT_2);
        (state.fabric, state.fabric_in) = (self.fabric, self.fabric_in);
        state.alpha_in = Components::of(self.alpha_in);
        state.alpha_in_true = self.alpha_in;
        state.alpha_in_previous = Components::of(self.alpha_in_previous);
        (state.fabric_cumulative, state.fabric_peak, state.p_zp) = self.history;

        let void_ratio = state.void_ratio_at(state.volumetric_strain);
        let surfaces = sand.surfaces(mean.max(state.p_min), void_ratio);
        state.bounding_ratio = surfaces.bounding;
        sand.refresh_moduli(&mut state);
        let Moduli { bulk, shear } = state.moduli;
        let ratio = stress_ratio(mean, state.deviator);
        let names = ["xi_R", "M^b", "M^d", "M_cur"];
        let values = [surfaces.state_index, surfaces.bounding, surfaces.dilatancy, ratio];
        for ((name, value), printed) in names.into_iter().zip(values).zip(self.surfaces) {
            agrees(name, value, printed);
        }
        agrees("G", shear, self.moduli[0]);
        agrees("K", bulk, self.moduli[1]);

        let at = Point::of(&state);
        let memory = Memory::of(&sand, &state);
        let found = direction(at.p, at.s, at.alpha, sand.constants.p_atm);
        assert!((found - n).norm() < 1e-12);
        let flow = sand.flow(n, &at, &memory, surfaces, shear, true);
        let names = ["D", "K_p", "h", "b:n", "distance"];
        let values =
            [flow.dilatancy, flow.plastic_modulus, flow.hardening, flow.b_n, flow.dilatancy_distance];
        for ((name, value), printed) in names.into_iter().zip(values).zip(self.flow) {
            agrees(name, value, printed);
        }

        let step = Strain { volume: 0.0, deviator: traceless(0.0, 0.5e-6) };
        let reading = Reading { held_moduli: None, clamp: true };
        let mut bounding = f64::NAN;
        let change = sand.change(&at, &memory, void_ratio, step, reading, &mut bounding).unwrap();
        let names = ["L", "ds_xx", "ds_yy", "ds_xy", "dalpha_xx", "dalpha_xy", "dz_xx", "dz_xy"];
        let values = [
            change.loading_index,
            change.p + change.s.half_difference,
            change.p - change.s.half_difference,
            change.s.xy,
            change.alpha.half_difference,
            change.alpha.xy,
            change.fabric.half_difference,
            change.fabric.xy,
        ];
        for ((name, value), printed) in names.into_iter().zip(values).zip(self.change) {
            agrees(name, value, printed);
        }
        assert_eq!(bounding, surfaces.bounding);
    }
}

#[test]
fn evaluation_while_contracting() {
    Evaluation {
        stress: (59.0, -11.0, 9.0),
        fabric: traceless(0.3, 0.6),
        fabric_in: traceless(0.1, 0.2),
        alpha_in: traceless(-0.2, -0.10),
        alpha_in_previous: traceless(-0.25, 0.12),
        history: (2.0, 1.2, 60.0),
        surfaces: ["-0.297278", "1.263839", "1.057373", "0.481785"],
        moduli: ["38851.0595", "84177.2956"],
        flow: ["0.07401091", "65665.785", "2327.1163", "0.71739822", "0.57140429"],
        change: [
            "3.823124e-7",
            "-5.352469e-3",
            "5.888275e-4",
            "1.805652e-2",
            "1.635880e-4",
            "2.805630e-4",
            "0",
            "0",
        ],
    }
    .check();
}

#[test]
fn evaluation_while_dilating() {
    Evaluation {
        stress: (22.0, -2.0, 12.5),
        fabric: traceless(-0.6, -2.2),
        fabric_in: traceless(0.2, 0.5),
        alpha_in: traceless(0.02, -0.35),
        alpha_in_previous: traceless(0.0, 0.30),
        history: (14.0, 4.5, 50.0),
        surfaces: ["-0.333296", "1.286806", "1.053571", "1.150817"],
        moduli: ["12229.5526", "26497.3641"],
        flow: ["-0.01584791", "731.0597", "375.8018", "0.13263635", "-0.03228535"],
        change: [
            "6.709906e-7",
            "-1.359415e-3",
            "1.922951e-3",
            "7.412722e-4",
            "3.057854e-5",
            "1.155807e-5",
            "1.913597e-5",
            "-5.811045e-5",
        ],
    }
    .check();
}

#[test]
fn evaluation_near_the_pressure_floor() {
    Evaluation {
        stress: (0.85, -0.05, 0.3),
        fabric: traceless(-0.6, -2.2),
        fabric_in: traceless(0.2, 0.5),
        alpha_in: traceless(0.02, -0.35),
        alpha_in_previous: traceless(0.0, 0.30),
        history: (14.0, 4.5, 50.0),
        surfaces: ["-0.402586", "1.332169", "1.046296", "0.715619"],
        moduli: ["3387.1422", "7338.8081"],
        flow: ["0", "448.1804", "1720.7367", "0.45963260", "0.25749023"],
        change: [
            "6.565624e-7",
            "-4.447741e-4",
            "4.447741e-4",
            "2.737238e-4",
            "1.152533e-4",
            "2.308112e-4",
            "0",
            "0",
        ],
    }
    .check();
}

/// Between the rotated and the unrotated dilatancy surface a point may dilate, but fabric grows only beyond the
/// unrotated one.
#[test]
fn fabric_grows_only_beyond_the_unrotated_dilatancy_surface() {
    let sand = sand(0.55, 677.0, 0.40);
    let mut state = start(&sand);
    let n = traceless(0.1, 0.7);
    (state.fabric, state.fabric_in) = (traceless(-0.6, -2.2), traceless(-0.3, -1.8));
    (state.fabric_cumulative, state.fabric_peak, state.p_zp) = (14.0, 4.5, 50.0);
    let surfaces = sand.surfaces(20.0, state.void_ratio_at(state.volumetric_strain));
    let image = (surfaces.dilatancy - 0.01) / std::f64::consts::SQRT_2;
    let at = |inside: f64| {
        let alpha = n * (image - inside);
        let s = (alpha + n * (0.01 / std::f64::consts::SQRT_2)) * 20.0;
        Point { p: 20.0, s, out_of_plane: 20.0, alpha, fabric: state.fabric }
    };
    let memory = Memory::of(&sand, &state);
    let step = Strain { volume: 0.0, deviator: n * 1e-6 };
    let reading = Reading { held_moduli: None, clamp: true };
    for (inside, grows) in [(0.01, false), (-0.01, true)] {
        let point = at(inside);
        let flow = sand.flow(n, &point, &memory, surfaces, 1.0e4, true);
        assert!(flow.dilatancy < 0.0, "D = {} at {inside}", flow.dilatancy);
        let mut bounding = f64::NAN;
        let change = sand.change(
            &point,
            &memory,
            state.void_ratio_at(state.volumetric_strain),
            step,
            reading,
            &mut bounding,
        );
        assert_eq!(change.unwrap().fabric != Deviator::ZERO, grows, "{inside}");
    }
}

/// A state after forward shear, just before a reversal.
fn before_reversal(sand: &PM4Sand) -> State {
    let mut state = start(sand);
    state.before_first_reversal = false;
    state.alpha_in_true = traceless(-0.1, -0.1);
    state.alpha = traceless(-0.05, 0.2);
    state
}

fn reversed(mut state: State, trial_direction: Deviator) -> State {
    reversal::detect(&mut state, trial_direction, &mut UpdateReport::default());
    state
}

/// After the first reversal, `p_zp` changes only where both `|z| p` and `p` exceed their earlier largest values.
#[test]
fn p_zp_is_updated_at_a_reversal_where_fabric_and_pressure_have_increased() {
    let sand = sand(0.55, 677.0, 0.40);
    let back = traceless(0.0, -0.7);
    let mut state = before_reversal(&sand);
    state.fabric = traceless(0.3, 0.4);
    let zp = state.fabric.norm() * state.mean;
    for (zp_max, p_zp, updated) in [
        (0.9 * zp, 0.9 * state.mean, true),
        (1.1 * zp, 0.9 * state.mean, false),
        (0.9 * zp, 1.1 * state.mean, false),
    ] {
        (state.zp_max, state.p_zp) = (zp_max, p_zp);
        let after = reversed(state, back);
        let expected = if updated { (zp, state.mean) } else { (zp_max, p_zp) };
        assert_eq!((after.zp_max, after.p_zp), expected);
        assert_eq!((after.fabric_in, after.alpha_in_true), (state.fabric, state.alpha));
    }
    let forward = reversed(state, -back);
    assert_eq!(forward, state, "continued loading is no reversal");
}

/// After a small loop the origin of each component is its minimum (loading up) or maximum (loading down), limited to
/// the same sign. After a loop through zero shear the origin is the turning point.
#[test]
fn a_small_loop_keeps_the_older_origin_component_by_component() {
    let sand = sand(0.55, 677.0, 0.40);
    let mut state = before_reversal(&sand);
    state.alpha_in = Components::of(traceless(-0.1, 0.1));
    state.alpha_min = Components([-0.3, 0.02, 0.15]);
    state.alpha_max = Components([0.1, 0.3, 0.25]);
    // A component with a positive origin updates its minimum, the others their maximum.
    let after = reversed(state, traceless(0.1, -0.7));
    assert_eq!(after.alpha_min, Components([-0.3, 0.02, 0.15]));
    assert_eq!(after.alpha_max, Components([0.1, 0.3, 0.25]));
    // xx increases, yy and xy decrease.
    assert_eq!(after.alpha_in, Components([0.0, 0.0, 0.0]));
    // yy increases: its minimum is positive and kept.
    let after = reversed(state, traceless(-0.1, -0.7));
    assert_eq!(after.alpha_in, Components([0.0, 0.02, 0.0]));
    assert_eq!(after.alpha_in_previous, state.alpha_in);
    // The last origin has shear of the opposite sign.
    state.alpha_in = Components::of(traceless(-0.1, -0.1));
    assert_eq!(reversed(state, traceless(-0.1, -0.7)).alpha_in, Components::of(state.alpha));
}

/// Loose of critical, the exponent of the bounding surface is `n^b/4` and that of the dilatancy surface `4 n^d`.
#[test]
fn surfaces_of_sand_loose_of_critical() {
    let sand = sand(0.15, 320.0, 0.5);
    let c = sand.parameters();
    let surfaces = sand.surfaces(101.3, c.initial_void_ratio());
    let state_index = 1.5 / (10.0 - 100.0_f64.ln()) - 0.15;
    assert!((surfaces.state_index - state_index).abs() < 1e-12 && state_index > 0.0);
    let ratio = |exponent: f64| c.critical_ratio * (exponent * state_index).exp();
    assert!((surfaces.bounding - ratio(-0.125)).abs() < 1e-12);
    assert!((surfaces.dilatancy - ratio(0.4)).abs() < 1e-12);
    assert_eq!(start(&sand).dilatancy_scale, 1.24);
}

/// The limits of the default formulas.
#[test]
fn limits_of_the_defaults() {
    assert_eq!(sand(0.05, 270.0, 0.5).parameters().c_dr, 5.0);
    assert_eq!(sand(0.05, 270.0, 0.5).parameters().c_kaf, 4.0);
    let densest = sand(1.0, 1160.0, 0.5);
    assert_eq!((densest.parameters().c_kaf, start(&densest).fabric_limit), (35.0, 20.0));
    let steep = Parameters { dr: 1.0, g0: 1160.0, hpo: 0.5, nb: Some(1.0), ..Parameters::default() };
    let steep = PM4Sand::new(steep, super::Options::default()).unwrap();
    assert!(steep.surfaces_of(&start(&steep)).bounding > 2.0);
    assert_eq!(start(&steep).dilatancy_scale, 1.5);
}

/// The reduction of stiffness by stress ratio is at most one half, also beyond the bounding surface.
#[test]
fn stress_ratio_reduces_the_stiffness_by_at_most_half() {
    let sand = sand(0.55, 677.0, 0.40);
    let shear = |ratio: f64| {
        let s = traceless(0.0, 0.5 * ratio * 100.0);
        sand.elastic_moduli(100.0, s, 0.5, 1.2, 1.0).shear
    };
    assert!((shear(1.2) / shear(0.0) - 0.5).abs() < 1e-12);
    assert_eq!(shear(1.2), shear(1.5));
}

/// Within a long step, fabric may exceed its peak at the last commit. The factor of `C_eps` then does not reduce
/// dilation, and does not increase it either.
#[test]
fn fabric_beyond_its_peak_leaves_dilation_unchanged() {
    let dilatancy = |ce: f64| {
        let given = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ce: Some(ce), ..Parameters::default() };
        let sand = PM4Sand::new(given, super::Options::default()).unwrap();
        let mut state = start(&sand);
        let n = traceless(0.0, std::f64::consts::FRAC_1_SQRT_2);
        (state.fabric, state.fabric_in) = (n * -4.0, n * -1.0);
        (state.fabric_cumulative, state.fabric_peak, state.p_zp) = (14.0, 1.5, 50.0);
        let surfaces = sand.surfaces(20.0, state.void_ratio_at(state.volumetric_strain));
        let alpha = n * ((surfaces.dilatancy + 0.05) / std::f64::consts::SQRT_2);
        let at = Point { p: 20.0, s: alpha * 20.0, out_of_plane: 20.0, alpha, fabric: state.fabric };
        sand.flow(n, &at, &Memory::of(&sand, &state), surfaces, 1.0e4, true).dilatancy
    };
    assert!(dilatancy(0.5) < 0.0);
    assert_eq!(dilatancy(0.5), dilatancy(0.0));
}
