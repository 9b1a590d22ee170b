//! Flow through ground at rest against closed forms.

use crate::common::{elastic, numerics};
use sandboil_soil::VanGenuchten;
use sandboil_solver::{
    Conductivity, HydraulicBoundary, HydraulicCondition, Model, Outline, Region, Seepage, Series, Side,
    Support, Until, Water,
};
use sandboil_sph::Vec2;

const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };

/// A rectangle between sides, its lower left corner at the origin; `region_of` gives the region at a
/// position.
fn rectangle(
    [width, height]: [f64; 2],
    spacing: f64,
    regions: Vec<Region>,
    region_of: impl Fn(Vec2) -> u32,
) -> Model {
    let [columns, rows] = [width, height].map(|x| (x / spacing).round() as usize);
    let at = |k: usize| (k as f64 + 0.5) * spacing;
    let position: Vec<Vec2> =
        (0..columns * rows).map(|k| Vec2::new(at(k % columns), at(k / columns))).collect();
    let side = |x: f64| Some(Side { x, extent: [0.0, height], support: Support::FreeSlip });
    Model {
        spacing: Vec2::repeat(spacing),
        volume: vec![spacing * spacing; position.len()],
        region: position.iter().map(|&x| region_of(x)).collect(),
        surface_elevation: vec![height; position.len()],
        vertical_effective_stress: vec![0.0; 2 * position.len()],
        pore_pressure: vec![0.0; position.len()],
        saturation: Vec::new(),
        position,
        regions,
        water: Some(WATER),
        gravity: 9.81,
        period: None,
        outline: Outline { sides: [side(0.0), side(width)], ..Outline::level(0.0) },
        numerics: numerics(),
    }
}

fn soil(conductivity: Conductivity) -> Region {
    Region { hydraulic_conductivity: conductivity, ..elastic(1e4, 2e4) }
}

fn on(line: &[[f64; 2]], condition: HydraulicCondition) -> HydraulicBoundary {
    HydraulicBoundary { line: line.iter().map(|&x| x.into()).collect(), condition }
}

fn head(value: f64) -> HydraulicCondition {
    HydraulicCondition::Head(Series::constant(value))
}

fn steady(model: &Model, boundaries: Vec<HydraulicBoundary>) -> Seepage {
    let pressure = vec![0.0; model.nodes()];
    let mut seepage = Seepage::new(model, &pressure, boundaries).unwrap();
    assert!(seepage.advance(Until::Steady, |_| true).unwrap());
    let discharge = seepage.discharge();
    let (all, net): (f64, f64) = (discharge.iter().map(|q| q.abs()).sum(), discharge.iter().sum());
    assert!(net.abs() < 1e-6 * all);
    seepage
}

/// Two layers across the flow: the flux through both resistances in series.
#[test]
fn layers_in_series() {
    for contrast in [1.0, 1e3, 1e6] {
        let regions = [1e-4, 1e-4 / contrast].map(|k| soil(Conductivity::isotropic(k))).to_vec();
        let model = rectangle([2.0, 10.0], 0.5, regions, |x| u32::from(x.y > 5.0));
        let seepage = steady(
            &model,
            vec![on(&[[0.0, 10.0], [2.0, 10.0]], head(12.0)), on(&[[0.0, 0.0], [2.0, 0.0]], head(10.0))],
        );
        let exact = 2.0 * 2.0 / (5.0 / 1e-4 + 5.0 * contrast / 1e-4);
        let error = seepage.discharge()[0] / exact - 1.0;
        println!("contrast {contrast}: flux {:+.4} %", 100.0 * error);
        assert!(error.abs() < 5e-3);
    }
}

/// A dam with vertical faces, 16 m thick between 24 and 4 m of water: its discharge is exact for any phreatic
/// surface (Charny); the surface ends at 12.79 m (Hornung and Krueger 1985). Capillary flow above it adds an
/// error that decreases with the capillary rise.
#[test]
fn dam_with_vertical_faces() {
    for (spacing, alpha) in [(1.0, 4.0), (0.5, 8.0), (0.25, 16.0)] {
        let mut sand = soil(Conductivity::isotropic(1e-4));
        sand.retention = Some(VanGenuchten::new(alpha, 3.0, 0.05, 1.0).unwrap());
        let model = rectangle([16.0, 24.0], spacing, vec![sand], |_| 0);
        let level =
            |x: f64, y: f64| on(&[[x, 0.0], [x, 24.0]], HydraulicCondition::Reservoir(Series::constant(y)));
        let seepage = steady(&model, vec![level(0.0, 24.0), level(16.0, 4.0)]);
        let error = seepage.discharge()[0] / (1e-4 * 17.5) - 1.0;
        let outlets = seepage.outlets(1);
        let exit =
            outlets.iter().filter(|(_, q)| *q < 0.0).map(|(x, _)| x.y).fold(0.0, f64::max) + 0.5 * spacing;
        println!("spacing {spacing}, alpha {alpha}: discharge {:+.2} %, seepage point {exit}", 100.0 * error);
        assert!(error.abs() < 0.01 && (exit - 12.79).abs() < spacing);
    }
}

/// Complete elliptic integral of the first kind by its modulus.
fn elliptic(modulus: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - modulus * modulus).sqrt());
    while a - b > 1e-15 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}

/// A sheet pile in a layer: discharge by conformal mapping (Harr 1962), with depths stretched in anisotropic
/// soil. Half of the section is modelled: the head below the pile is the mean of both sides.
#[test]
fn sheet_pile() {
    const DEPTH: f64 = 10.0;
    // Spacings are equal in the stretched section.
    for (ratio, width, spacing) in [(1.0, 30.0, 0.25), (9.0, 60.0, 0.5), (1.0 / 9.0, 10.0, 0.1)] {
        for part in [0.25, 0.5, 0.75] {
            let k = Conductivity {
                major: 1e-5 * f64::max(ratio, 1.0),
                minor: 1e-5 * f64::min(ratio, 1.0),
                direction: if ratio < 1.0 { Vec2::new(0.0, 1.0) } else { Vec2::new(1.0, 0.0) },
            };
            let model = rectangle([width, DEPTH], spacing, vec![soil(k)], |_| 0);
            let tip = DEPTH * (1.0 - part);
            let boundaries = vec![
                on(&[[0.0, DEPTH], [width, DEPTH]], head(1.0)),
                on(&[[width, 0.0], [width, tip]], head(0.5)),
            ];
            let seepage = steady(&model, boundaries);
            let modulus = (std::f64::consts::FRAC_PI_2 * part).sin();
            let form = elliptic((1.0 - modulus * modulus).sqrt()) / (2.0 * elliptic(modulus));
            let error = seepage.discharge()[0] / ((k.major * k.minor).sqrt() * form) - 1.0;
            println!("k_h/k_v {ratio:.2}, pile to {part} of the depth: {:+.2} %", 100.0 * error);
            assert!(error.abs() < 0.02);
        }
    }
}

/// A channel of soil whose layers are inclined: far from its ends water flows along it, by the conductivity
/// `det k / k_yy`. Errors of the head beside the walls are in proportion to the spacing.
#[test]
fn channel_of_inclined_layers() {
    for (ratio, angle) in [(10.0, 30.0_f64), (100.0, -20.0), (10.0, 90.0)] {
        let errors = [0.5, 0.25].map(|spacing| {
            let (sin, cos) = angle.to_radians().sin_cos();
            let k = Conductivity { major: 1e-5 * ratio, minor: 1e-5, direction: Vec2::new(cos, sin) };
            let model = rectangle([24.0, 4.0], spacing, vec![soil(k)], |_| 0);
            let boundaries =
                vec![on(&[[0.0, 0.0], [0.0, 4.0]], head(5.0)), on(&[[24.0, 0.0], [24.0, 4.0]], head(4.0))];
            let seepage = steady(&model, boundaries);
            let heads = seepage.head();
            let cells = |length: f64| (length / spacing).round() as usize;
            let mean = |column: usize| {
                let rows = cells(4.0);
                (0..rows).map(|row| heads[cells(24.0) * row + column]).sum::<f64>() / rows as f64
            };
            let gradient = (mean(cells(9.0)) - mean(cells(15.0))) / 6.0;
            let tensor = k.tensor();
            seepage.discharge()[0] / (4.0 * gradient * tensor.determinant() / tensor[(1, 1)]) - 1.0
        });
        println!("ratio {ratio}, {angle} degrees: {:+.2}, {:+.2} %", 100.0 * errors[0], 100.0 * errors[1]);
        assert!(errors[1].abs() < 0.05 && errors[1].abs() < 0.6 * errors[0].abs().max(1e-3));
    }
}

/// A bank between two ditches under rain, with and without a drain in its middle: all the rain flows out; a
/// drain takes a part of it and lowers the water table; rain beyond the capacity of the soil runs off.
#[test]
fn rain_drains_and_runoff() {
    let bank = |rain: f64, drained: bool| {
        let mut sand = soil(Conductivity::isotropic(1e-5));
        sand.retention = Some(VanGenuchten::new(3.5, 2.5, 0.1, 1.0).unwrap());
        let model = rectangle([20.0, 5.0], 0.5, vec![sand], |_| 0);
        let ditch = |x: f64| on(&[[x, 0.0], [x, 5.0]], HydraulicCondition::Reservoir(Series::constant(1.0)));
        let mut boundaries = vec![
            ditch(0.0),
            ditch(20.0),
            on(&[[0.0, 5.0], [20.0, 5.0]], HydraulicCondition::Rain(Series::constant(rain))),
        ];
        if drained {
            boundaries.push(on(&[[9.0, 1.0], [11.0, 1.0]], HydraulicCondition::Drain));
        }
        let seepage = steady(&model, boundaries);
        let pressure = seepage.pore_pressure();
        (seepage.discharge(), pressure.iter().copied().fold(f64::MIN, f64::max))
    };
    let (open, high) = bank(1e-7, false);
    let (drained, low) = bank(1e-7, true);
    println!("rain {open:?}, {high:.1} kPa; with a drain {drained:?}, {low:.1} kPa");
    assert!((open[2] / (20.0 * 1e-7) - 1.0).abs() < 1e-9 && (open[0] / open[1] - 1.0).abs() < 1e-6);
    assert!(drained[3] < 0.2 * -drained[2] && low < high);
    let (flooded, _) = bank(1e-3, false);
    println!("storm {flooded:?}");
    assert!(flooded[2] > 0.0 && flooded[2] < 0.05 * 20.0 * 1e-3);
}

/// One-dimensional Richards equation by finite volumes on a fine grid with lagged conductivities and short
/// steps, independent of the solver: saturation in each of `cells` from the base upwards. The top takes
/// `rain`, or is at zero pressure if `rain` is infinite; the base is at zero pressure or closed.
fn richards(
    curve: &VanGenuchten,
    (height, cells): (f64, usize),
    (k, porosity): (f64, f64),
    start: f64,
    rain: f64,
    open_base: bool,
    duration: f64,
) -> Vec<f64> {
    let dz = height / cells as f64;
    let mut h = vec![start; cells];
    let mut time = 0.0;
    let step = 1e-3 * duration / (cells as f64 / 100.0);
    while time < duration {
        let dt = step.min(duration - time);
        let old: Vec<_> = h.iter().map(|&h| curve.at(h)).collect();
        for _ in 0..200 {
            let (mut lower, mut main, mut upper, mut right) =
                (vec![0.0; cells], vec![0.0; cells], vec![0.0; cells], vec![0.0; cells]);
            for i in 0..cells {
                let now = curve.at(h[i]);
                let storage = porosity * dz / dt;
                // A small compressibility, as that of water.
                let slope = now.capacity + 1e-5;
                main[i] += storage * slope;
                right[i] -= storage * (now.saturation - old[i].saturation);
            }
            for i in 0..cells - 1 {
                let conductance =
                    k * 0.5 * (old[i].relative_conductivity + old[i + 1].relative_conductivity) / dz;
                let up = conductance * (h[i] - h[i + 1] - dz);
                right[i] -= up;
                right[i + 1] += up;
                main[i] += conductance;
                main[i + 1] += conductance;
                upper[i] -= conductance;
                lower[i + 1] -= conductance;
            }
            if rain.is_infinite() {
                let conductance = 2.0 * k / dz;
                right[cells - 1] += conductance * (0.5 * dz - h[cells - 1]);
                main[cells - 1] += conductance;
            } else {
                right[cells - 1] += rain;
            }
            if open_base {
                let conductance = 2.0 * k * old[0].relative_conductivity / dz;
                right[0] += conductance * (-0.5 * dz - h[0]);
                main[0] += conductance;
            }
            for i in 1..cells {
                let factor = lower[i] / main[i - 1];
                main[i] -= factor * upper[i - 1];
                right[i] -= factor * right[i - 1];
            }
            let mut largest = 0.0_f64;
            for i in (0..cells).rev() {
                let next = if i + 1 < cells { upper[i] * right[i + 1] } else { 0.0 };
                right[i] = (right[i] - next) / main[i];
                h[i] += right[i].clamp(-0.5, 0.5);
                largest = largest.max(right[i].abs());
            }
            if largest < 1e-8 {
                break;
            }
        }
        time += dt;
    }
    h.iter().map(|&h| curve.at(h).saturation).collect()
}

/// Infiltration from a pond and by rain into dry sand, and drainage of a full column, against the fine solution.
#[test]
fn infiltration_and_drainage_of_columns() {
    const SPACING: f64 = 0.05;
    const HEIGHT: f64 = 1.0;
    const K: f64 = 1e-4;
    let curve = VanGenuchten::new(3.5, 2.0, 0.1, 1.0).unwrap();
    let pond = f64::INFINITY;
    for (name, start, rain, open, duration) in [
        ("pond on dry sand", -8.0, pond, false, 1200.0),
        ("rain on dry sand", -8.0, 2e-5, false, 5000.0),
        ("drainage", 0.0, 0.0, true, 3000.0),
    ] {
        let mut sand = soil(Conductivity::isotropic(K));
        sand.retention = Some(curve);
        let model = rectangle([2.0 * SPACING, HEIGHT], SPACING, vec![sand], |_| 0);
        let top = [[0.0, HEIGHT], [2.0 * SPACING, HEIGHT]];
        let mut boundaries = vec![on(
            &top,
            if rain == pond { head(HEIGHT) } else { HydraulicCondition::Rain(Series::constant(rain)) },
        )];
        if open {
            boundaries.push(on(&[[0.0, 0.0], [2.0 * SPACING, 0.0]], head(0.0)));
        }
        let pressure = vec![10.0 * start; model.nodes()];
        let mut seepage = Seepage::new(&model, &pressure, boundaries).unwrap();
        assert!(seepage.advance(Until::Time(duration), |_| true).unwrap());
        let fine = richards(&curve, (HEIGHT, 400), (K, 0.4), start, rain, open, duration);
        let saturation = seepage.saturation();
        let rows = (HEIGHT / SPACING).round() as usize;
        let per = fine.len() / rows;
        let mean = |row: usize| fine[per * row..per * (row + 1)].iter().sum::<f64>() / per as f64;
        let rms =
            ((0..rows).map(|r| (saturation[2 * r] - mean(r)).powi(2)).sum::<f64>() / rows as f64).sqrt();
        // Position error of a front: the difference of the water contents over the jump of saturation.
        let difference: f64 = (0..rows).map(|r| saturation[2 * r] - mean(r)).sum::<f64>() * SPACING;
        let span = saturation.iter().fold(0.0_f64, |a, b| a.max(*b))
            - saturation.iter().fold(1.0_f64, |a, b| a.min(*b));
        let front = difference / span / SPACING;
        let balance = seepage.balance();
        let inflow: f64 = balance.inflow.iter().sum();
        let lost = (balance.stored - inflow).abs() / balance.inflow.iter().map(|q| q.abs()).sum::<f64>();
        println!(
            "{name}: rms S_r {rms:.4}, front {front:+.2} spacings, lost {lost:.1e}, {:?}",
            seepage.counters()
        );
        assert!(lost < 1e-6 && front.abs() < 1.0);
    }
}

/// A drain across a column takes the flow from the head above. It acts at nodes, so the length of the path
/// has an error of a part of a spacing.
#[test]
fn drain_across_a_column() {
    let errors = [0.5, 0.25, 0.125].map(|spacing| {
        let sand = soil(Conductivity::isotropic(1e-4));
        let model = rectangle([2.0, 10.0], spacing, vec![sand], |_| 0);
        let drain = on(&[[0.0, 5.0], [2.0, 5.0]], HydraulicCondition::Drain);
        let seepage = steady(&model, vec![on(&[[0.0, 10.0], [2.0, 10.0]], head(12.0)), drain]);
        seepage.discharge()[0] / (2.0 * 1e-4 * (12.0 - 5.0) / 5.0) - 1.0
    });
    println!("drain: {errors:.4?}");
    for (error, spacing) in errors.iter().zip([0.5, 0.25, 0.125]) {
        assert!((error / (spacing / 5.0)).abs() < 0.8, "{error} at {spacing} m");
    }
}

/// Extreme input: each case ends with a closed water balance and heads between those of the conditions.
#[test]
fn extreme_input_keeps_the_water_balance() {
    let clay = VanGenuchten::new(0.8, 1.09, 0.2, 1.0).unwrap();
    let sand = VanGenuchten::new(14.5, 2.68, 0.1, 1.0).unwrap();
    // Name, curve, conductivity, porosity, factor on the water's stiffness, duration in seconds.
    let day = 86_400.0;
    for (name, curve, k, porosity, softness, duration) in [
        ("k 1e-12 m/s", sand, 1e-12, 0.4, 1.0, 1e4 * day),
        ("k 1 m/s", sand, 1.0, 0.4, 1.0, 60.0),
        ("clay", clay, 1e-9, 0.4, 1.0, 100.0 * day),
        ("K_f x 0.01", sand, 1e-5, 0.4, 0.01, day),
        ("K_f x 100", sand, 1e-5, 0.4, 100.0, day),
        ("porosity 0.05", sand, 1e-5, 0.05, 1.0, day),
        ("porosity 0.95", sand, 1e-5, 0.95, 1.0, day),
    ] {
        let mut region = soil(Conductivity::isotropic(k));
        (region.retention, region.porosity) = (Some(curve), porosity);
        let mut model = rectangle([6.0, 4.0], 0.5, vec![region], |_| 0);
        model.water = Some(Water { bulk_modulus: softness * WATER.bulk_modulus, ..WATER });
        let level = |value: f64| HydraulicCondition::Reservoir(Series::constant(value));
        // Saturated at first, then a sudden drawdown on one side; rain on dry ground.
        let drawn =
            vec![on(&[[0.0, 0.0], [0.0, 4.0]], level(0.5)), on(&[[6.0, 0.0], [6.0, 4.0]], level(4.0))];
        let storm = HydraulicCondition::Rain(Series::constant(1e-5));
        let rained = vec![
            on(&[[0.0, 4.0], [6.0, 4.0]], storm),
            on(&[[0.0, 0.0], [6.0, 0.0]], HydraulicCondition::SeepageFace),
        ];
        let full = model.position.iter().map(|x| 10.0 * (4.0 - x.y)).collect();
        let dry = vec![-1e4; model.nodes()];
        for (case, pressure, boundaries) in [("drawdown", full, drawn), ("rain on dry ground", dry, rained)] {
            let mut seepage = Seepage::new(&model, &pressure, boundaries).unwrap();
            assert!(seepage.advance(Until::Time(duration), |_| true).unwrap());
            let balance = seepage.balance();
            let inflow: f64 = balance.inflow.iter().sum();
            let moved: f64 = balance.inflow.iter().map(|q| q.abs()).sum();
            let heads = seepage.head();
            let (low, high) = heads.iter().fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(*h), b.max(*h)));
            let lost = (balance.stored - inflow).abs() / moved.max(1e-12);
            println!(
                "{name}, {case}: heads {low:.2} to {high:.2} m, lost {lost:.1e}, {:?}",
                seepage.counters()
            );
            assert!(lost < 1e-6 && low > -1001.0 && high < 4.0 + 0.01);
        }
    }
}
