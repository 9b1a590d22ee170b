//! Balance of stress above a base that cuts the lattice.
//!
//! Images make the strain above any base exact for the motions that the base allows. But the stress nodes do
//! not integrate over the gap between a lattice and an inclined base. The force of a uniform stress should be
//! zero at every node; instead it changes sign among the rows above the base. Here the weights near the base
//! are changed as little as is needed to balance two fields: uniform stress, and stress proportional to depth
//! with the nodes' own weight. This is variationally consistent integration (Chen, Hillman & Ruter 2013, Int.
//! J. Numer. Meth. Engng 95, 387-418), to first order. Strain stays exact for linear fields, and force stays
//! the exact transpose of strain.

use crate::{
    linear::conjugate_gradients::{Element, Limits, Norm, conjugate_gradients},
    section::{
        description::{Model, Operators},
        outline::{Condition, EdgesView, Hand, Outline},
    },
    weights::{rows::VectorWeight, stencils::Stencils},
};
use sandboil_sph::{LeastSquaresFit, Mat2, NeighbourList, Vec2, operators::GradientWeight};
use std::collections::BTreeMap;

/// Distance from the base within which nodes are brought into balance, in kernel supports. With less, the
/// weights cannot compensate the volumes that the base has changed (at one support, errors of 2 % become
/// 30 %); with more, the result is the same.
const REACH: f64 = 1.5;
/// Compliance of each multiplier, of uniform stress and of its slopes: a small imbalance remains. Without it
/// the weights of a few nodes would become so large that they halve the time step.
const COMPLIANCE: Moments = [1e-6, 3e-3, 3e-3];
/// Residual over the imbalance at which the iteration for the multipliers ends.
const TOLERANCE: f64 = 1e-6;
/// Largest number of iterations; no slope needs more than 350.
const MOST_ITERATIONS: usize = 5000;
/// Limit of the time step with balanced weights, over that without: at least 0.75 on straight bases and bases with
/// corners, of half a degree to 45 degrees.
pub const RESPONSE: f64 = 0.75;
/// Limit of the time step on the dual lattice above a released base that is not level, over that of a free block: at least
/// 0.91 of `h/c_d`.
pub const STRETCHED_RESPONSE: f64 = 0.92;
/// Moments of a node, dimensionless: of uniform stress, and of stress proportional to x and to y.
type Moments = [f64; 3];
/// A node that is brought into balance, or its image, in the stencil of a stress node.
struct Part {
    /// Index among the nodes that are brought into balance.
    slot: usize,
    owner: u32,
    /// Map from the velocity of the node to that of the node or image.
    map: Mat2,
    /// Volume of the stress node, and volume times its distance from the node in x and in y.
    moments: Moments,
    /// Weight in the fit through the parts alone.
    weight: GradientWeight,
    /// Position relative to the weighted mean of the parts, m.
    offset: Vec2,
}

/// The parts of a stress node's stencil whose weights may change.
struct Stencil {
    stress_node: usize,
    parts: Vec<Part>,
}

/// Whether a section needs balanced weights: on a rough held base that is not even.
pub fn is_needed(model: &Model, EdgesView { outline, walls }: EdgesView) -> bool {
    let is_even = model.is_even_on(outline);
    model.numerics.operators != Operators::Printed && walls.base == Condition::NoSlip && !is_even
}

/// Changes of the weights that bring stress into balance, by stress node. The neighbours of the stress nodes,
/// at `points` with `volume_of` (m2), are in `list`.
pub fn corrections(
    model: &Model,
    outline: &Outline,
    stencils: &Stencils,
    list: &NeighbourList,
    points: &[Vec2],
    volume_of: impl Fn(usize) -> f64,
) -> BTreeMap<usize, Vec<(u32, VectorWeight)>> {
    let slots = slots(model, outline, stencils);
    let nodes: Vec<usize> = (0..model.nodes()).filter(|&node| slots[node].is_some()).collect();
    let (cell, length) = (model.cell(), model.mean_spacing());
    // Weights times a length are dimensionless, and so are volumes over that of a cell.
    let mut imbalance = [0, 1].map(|_| {
        let weight = |node: &usize| stencils.volume[*node] / cell;
        let own = |weight: f64| [[0.0, -weight, 0.0], [0.0, 0.0, -weight]];
        nodes.iter().map(|node| own(weight(node))).collect::<Vec<[Moments; 2]>>()
    });
    // Beside a side along which a velocity component is free, traction of the side may act on that component:
    // no balance is required.
    let mut is_free_along_side = [vec![false; nodes.len()], vec![false; nodes.len()]];
    let mut changing = Vec::new();
    for (s, &at) in points.iter().enumerate() {
        let members = stencils.all(list, s, at);
        let slot = |owner: u32| slots[owner as usize];
        if !members.iter().any(|m| slot(m.owner).is_some()) {
            continue;
        }
        let Ok(fit) = LeastSquaresFit::new(&members, stencils.kernel) else { continue };
        let volume = volume_of(s) / cell;
        let (mut inner, mut parts) = (Vec::new(), Vec::new());
        for (k, m) in members.iter().enumerate() {
            let Some(slot) = slot(m.owner) else { continue };
            let sources = &stencils.around.sources;
            let image = sources[m.source as usize].position - sources[m.owner as usize].position;
            let place = (image - m.offset) / length;
            let moments = [volume, volume * place.x, volume * place.y];
            let (map, gradient) = (stencils.map(m), fit.weight(k, m).gradient * length);
            let beside = stencils.around.image(m.source).is_some_and(|image| !image.below);
            for c in [0, 1] {
                for (imbalance, gradient) in imbalance[c][slot].iter_mut().zip(gradient.iter()) {
                    for (sum, moment) in imbalance.iter_mut().zip(moments) {
                        *sum -= map[(c, c)] * moment * gradient;
                    }
                }
                is_free_along_side[c][slot] |= beside && map[(c, c)] > 0.0;
            }
            inner.push(*m);
            let (weight, offset) = (GradientWeight::default(), m.offset);
            parts.push(Part { slot, owner: m.owner, map, moments, weight, offset });
        }
        let Ok(fit) = LeastSquaresFit::new(&inner, stencils.kernel) else { continue };
        for (k, (part, m)) in parts.iter_mut().zip(&inner).enumerate() {
            part.weight = fit.weight(k, m);
        }
        let mean: Vec2 = parts.iter().map(|part| part.offset * part.weight.share).sum();
        for part in &mut parts {
            part.offset -= mean;
        }
        changing.push(Stencil { stress_node: s, parts });
    }
    let mut corrections: BTreeMap<usize, Vec<(u32, VectorWeight)>> = BTreeMap::new();
    for component in [0, 1] {
        let multipliers = [0, 1].map(|direction| {
            let is_free = |slot: usize| direction == 0 && is_free_along_side[component][slot];
            let required = imbalance[component].iter().enumerate();
            let required: Vec<Moments> =
                required.map(|(slot, both)| if is_free(slot) { [0.0; 3] } else { both[direction] }).collect();
            solve_multipliers(&changing, component, is_free, &required)
        });
        for stencil in &changing {
            let [x, y] = [0, 1].map(|direction| stencil.change(component, &multipliers[direction]));
            let row = corrections.entry(stencil.stress_node).or_default();
            row.extend(stencil.parts.iter().zip(x.into_iter().zip(y)).map(|(part, (x, y))| {
                (part.owner, VectorWeight::of_component(component, Vec2::new(x, y) / length, part.map))
            }));
        }
    }
    corrections
}

/// Index of every node that is brought into balance: nodes near the base whose stencils no free surface cuts.
fn slots(model: &Model, outline: &Outline, stencils: &Stencils) -> Vec<Option<usize>> {
    let support = stencils.kernel.support();
    let position = &stencils.around.sources[..model.nodes()];
    let mut surface: Vec<Vec2> = position
        .iter()
        .zip(&model.surface_elevation)
        .map(|(source, &elevation)| Vec2::new(source.position.x, elevation))
        .collect();
    surface.sort_by(|a, b| a.x.total_cmp(&b.x));
    surface.dedup();
    let ends = [surface.first(), surface.last()].map(|end| end.map_or(0.0, |end| end.x));
    let ends_freely = |hand: Hand| model.period.is_none() && outline.sides[hand as usize].is_none();
    let is_covered = |node: usize, at: Vec2| {
        let is_near = |end: &[Vec2]| (at - nearest_on_segment(at, end[0], end[1])).norm() < support;
        model.surface_elevation[node] - at.y >= support
            && !surface.windows(2).any(is_near)
            && !Hand::BOTH
                .iter()
                .any(|&hand| ends_freely(hand) && (at.x - ends[hand as usize]).abs() < support)
    };
    let mut count = 0;
    position
        .iter()
        .enumerate()
        .map(|(node, source)| {
            let at = source.position;
            let (foot, _) = outline.nearest_on_base(at)?;
            ((foot - at).norm() < REACH * support && is_covered(node, at)).then(|| {
                count += 1;
                count - 1
            })
        })
        .collect()
}

/// The point of a segment nearest to `at`.
fn nearest_on_segment(at: Vec2, from: Vec2, to: Vec2) -> Vec2 {
    let along = to - from;
    let length = along.norm_squared();
    if length > 0.0 { from + along * ((at - from).dot(&along) / length).clamp(0.0, 1.0) } else { from }
}

impl Stencil {
    /// Change of every part's weight by the multipliers of the nodes: their residual after a weighted linear
    /// fit, times the weights of the parts.
    fn change(&self, component: usize, multipliers: &[Moments]) -> Vec<f64> {
        let mut change: Vec<f64> = self
            .parts
            .iter()
            .map(|part| part.map[(component, component)] * part.moments.dot(&multipliers[part.slot]))
            .collect();
        let (mut mean, mut gradient) = (0.0, Vec2::zeros());
        for (part, value) in self.parts.iter().zip(&change) {
            mean += part.weight.share * value;
            gradient += part.weight.gradient * *value;
        }
        for (part, value) in self.parts.iter().zip(&mut change) {
            *value = part.weight.share * (*value - mean - gradient.dot(&part.offset));
        }
        change
    }
}

/// Multipliers that change the weights by the required moments, by conjugate gradients; zero at nodes whose
/// balance is not required.
fn solve_multipliers(
    stencils: &[Stencil],
    component: usize,
    is_free: impl Fn(usize) -> bool,
    imbalance: &[Moments],
) -> Vec<Moments> {
    let moments = |multipliers: &[Moments]| {
        let mut sum: Vec<Moments> =
            multipliers.iter().map(|own| [0, 1, 2].map(|e| COMPLIANCE[e] * own[e])).collect();
        for stencil in stencils {
            for (part, change) in stencil.parts.iter().zip(stencil.change(component, multipliers)) {
                if !is_free(part.slot) {
                    let factor = part.map[(component, component)] * change;
                    sum[part.slot] = sum[part.slot].plus(factor, &part.moments);
                }
            }
        }
        sum
    };
    let mut stiffness = vec![COMPLIANCE; imbalance.len()];
    for part in stencils.iter().flat_map(|stencil| &stencil.parts) {
        let own = part.weight.share * (1.0 - part.weight.share - part.weight.gradient.dot(&part.offset));
        for (sum, moment) in stiffness[part.slot].iter_mut().zip(part.moments) {
            *sum += own * moment * moment;
        }
    }
    let preconditioned = |residual: &[Moments]| -> Vec<Moments> {
        residual.iter().zip(&stiffness).map(|(r, k)| [0, 1, 2].map(|e| r[e] / k[e])).collect()
    };
    let limits = Limits { norm: Norm::Residual, tolerance: TOLERANCE, iterations: MOST_ITERATIONS };
    // Where the limit of iterations ends the search, weights that are nearly in balance are still better than others.
    conjugate_gradients(moments, preconditioned, imbalance, limits).unwrap_or_else(|nearly| nearly)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        run::time_step::{DRAINED_COEFFICIENT, DUAL_DRAINED_COEFFICIENT},
        section::{
            outline::{Side, Support, Walls},
            stress_layout::{StressLayout, stress_positions},
        },
        skeleton::{
            point::StressPoint,
            strain_and_force::{conservative_force, motion},
        },
        testing::square_block,
        weights::{geometry::Geometry, images::Surroundings},
    };
    use sandboil_soil::Stress;

    const WIDTH: usize = 28;
    const HEIGHT: f64 = 10.0;
    /// Rows that take up the distance of the base from the lattice, as in scenes.
    const STRETCHED_ROWS: f64 = 3.0;
    /// Slope below which a uniform stress is balanced less well.
    const GENTLE: f64 = 0.11;

    /// Ground of unit weight, unit spacing and level surface on a base between smooth sides, with nodes
    /// placed as in scenes.
    fn on_base(base: &[Vec2]) -> Model {
        let mut model = square_block(WIDTH);
        model.outline = Outline {
            base: base.to_vec(),
            sides: [0.0, WIDTH as f64].map(|x| {
                let support = Support::FreeSlip;
                Some(Side { x, extent: [-1e3, 1e3], support })
            }),
            ..Outline::none()
        };
        let outline = &model.outline;
        let top = (outline.relief() + HEIGHT).round();
        let place = |k: usize| Vec2::new((k % WIDTH) as f64, (k / WIDTH) as f64).add_scalar(0.5);
        let lattice = (0..WIDTH * WIDTH).map(place).filter(|x| x.y < top);
        let nodes = lattice.filter(|x| x.y >= outline.base_elevation(x.x)).map(|x| {
            let base = outline.base_elevation(x.x);
            let top = (base - 0.5).ceil() + STRETCHED_ROWS;
            let height = (top - base) / STRETCHED_ROWS;
            if x.y < top { (Vec2::new(x.x, top - (top - x.y) * height), height) } else { (x, 1.0) }
        });
        (model.position, model.volume) = nodes.unzip();
        model.surface_elevation = vec![top; model.nodes()];
        model.region = vec![0; model.nodes()];
        model
    }

    /// Bases of several slopes up to 45 degrees: rising, falling, and with corners.
    fn bases() -> Vec<Model> {
        let end = WIDTH as f64;
        let straight = |slope: f64| {
            vec![Vec2::new(0.0, (-slope * end).max(0.0)), Vec2::new(end, (slope * end).max(0.0))]
        };
        let mut bases: Vec<Vec<Vec2>> = [0.016, 0.05, -0.1, 0.27].map(straight).into();
        let at = Vec2::new;
        bases.push(vec![at(0.0, 0.0), at(10.2, 0.0), at(18.2, 8.0), at(end, 8.0)]);
        bases.push(vec![at(0.0, 5.0), at(13.1, 0.0), at(end, 3.0)]);
        bases.push(vec![at(0.0, 0.0), at(6.0, 0.0), at(14.0, 8.0), at(22.0, 0.0), at(end, 0.0)]);
        let conservative = bases.iter().map(|base| on_base(base));
        let dual = conservative.clone().map(|mut model| {
            model.numerics.operators = Operators::Dual;
            model.numerics.smoothing_ratio = 1.2;
            model
        });
        conservative.chain(dual).collect()
    }

    fn build_geometry(model: &Model) -> Geometry {
        Geometry::build(model, &model.position, &model.volume, EdgesView::statics(&model.outline))
    }

    /// Points under a stress `(xx, yy)` that depends on the position.
    fn stressed(model: &Model, stress: impl Fn(Vec2) -> [f64; 2]) -> Vec<StressPoint> {
        let layout = StressLayout::new(model);
        let places = layout.positions(&model.position, model.spacing);
        let point = |(s, &at): (usize, &Vec2)| {
            let [xx, yy] = stress(at);
            let volume = layout.volume(s, &model.volume);
            StressPoint {
                stress: Stress { xx, yy, ..Stress::default() },
                volume,
                density: 1.0,
                ..StressPoint::default()
            }
        };
        places.iter().enumerate().map(point).collect()
    }

    /// Forces over volumes of the nodes that are brought into balance; kN/m3.
    fn forces(model: &Model, points: &[StressPoint]) -> Vec<Vec2> {
        let geometry = build_geometry(model);
        assert!(geometry.is_balanced);
        let still = vec![Vec2::zeros(); model.nodes()];
        let share = |s: usize| motion(&geometry, s, &still).share(&points[s], geometry.covariance[s], 0.0);
        let shares: Vec<_> = (0..points.len()).map(share).collect();
        let kernel = sandboil_sph::WendlandQuintic::new(model.smoothing_length());
        let around = Surroundings::bare(&model.position);
        let slots = slots(
            model,
            &model.outline,
            &Stencils { around: &around, volume: &model.volume, kernel, period: None },
        );
        let near = (0..model.nodes()).filter(|&node| slots[node].is_some());
        near.map(|j| conservative_force(&geometry, j, Vec2::zeros(), &shares, points) / model.volume[j])
            .collect()
    }

    /// A uniform stress exerts almost no force on a node (with unchanged weights up to 0.5 over the spacing),
    /// and the stress of level ground carries the nodes' weight.
    #[test]
    fn uniform_stress_and_weight_are_in_balance() {
        for model in bases() {
            let uniform = forces(&model, &stressed(&model, |_| [-1.0, -1.0]));
            assert!(uniform.len() > 2 * WIDTH);
            let largest = uniform.iter().map(Vec2::norm).fold(0.0, f64::max);
            let top = model.surface_elevation[0];
            let weight = forces(&model, &stressed(&model, |at| [0.5, 1.0].map(|k| k * (at.y - top))));
            let left = weight.iter().map(|force| (force - Vec2::y()).norm()).fold(0.0, f64::max);
            println!(
                "{:?} {:?}: force of a uniform stress {largest:.1e}, error of the weight {left:.3}",
                model.numerics.operators, model.outline.base[1]
            );
            // On a gentle slope rows end far apart, and few weights can balance what an end leaves.
            let is_gentle = model.outline.base.len() == 2 && model.outline.relief() < GENTLE * WIDTH as f64;
            let bound = match (is_gentle, model.numerics.operators) {
                (false, _) => 1e-3,
                (true, Operators::Dual) => 0.015,
                (true, _) => 5e-3,
            };
            assert!(largest < bound && left < 0.12, "{largest} {left}");
        }
    }

    /// Strain is exact at every stress node for linear motions that a rough straight base allows.
    #[test]
    fn linear_fields_stay_exact() {
        for model in bases().into_iter().filter(|model| model.outline.base.len() == 2) {
            let geometry = build_geometry(&model);
            let [from, to] = [model.outline.base[0], model.outline.base[1]];
            let along = (to - from).normalize();
            let away = Vec2::new(-along.y, along.x);
            let velocity: Vec<Vec2> =
                model.position.iter().map(|x| Vec2::new(0.0, 0.3) * (x - from).dot(&away)).collect();
            let places = stress_positions(&model);
            // Smooth sides mirror the field: it is linear only in the middle.
            for s in (0..places.len()).filter(|&s| (places[s].x - 0.5 * WIDTH as f64).abs() < 10.0) {
                let (x, y) = motion(&geometry, s, &velocity).gradient();
                let error = x.norm() + (y - away * 0.3).norm();
                assert!(error < 1e-11, "{error}");
            }
        }
    }

    /// Limit of the time step of elastic ground from its fastest vibration, in `h/c_d`.
    fn limit(model: &Model, walls: Walls) -> f64 {
        const ITERATIONS: usize = 150;
        let (lame, shear) = (2.0, 1.0);
        let geometry = Geometry::build(
            model,
            &model.position,
            &model.volume,
            EdgesView { outline: &model.outline, walls },
        );
        let mut velocity: Vec<Vec2> =
            (0..model.nodes()).map(|k| Vec2::new((0.7 * k as f64).sin(), (1.3 * k as f64).cos())).collect();
        let mut points = stressed(model, |_| [0.0; 2]);
        let mut squared: f64 = 0.0;
        for _ in 0..ITERATIONS {
            let mut shares = Vec::with_capacity(points.len());
            for (s, point) in points.iter_mut().enumerate() {
                let motion = motion(&geometry, s, &velocity);
                let (x, y) = motion.gradient();
                let pressure = lame * (x.x + y.y);
                point.stress = Stress {
                    xx: pressure + 2.0 * shear * x.x,
                    yy: pressure + 2.0 * shear * y.y,
                    xy: shear * (x.y + y.x),
                    zz: 0.0,
                };
                shares.push(motion.share(point, geometry.covariance[s], 0.0));
            }
            let next =
                |j: usize| -conservative_force(&geometry, j, velocity[j], &shares, &points) / model.volume[j];
            let response: Vec<Vec2> = (0..model.nodes()).map(next).collect();
            let size = |field: &[Vec2]| field.iter().map(Vec2::norm_squared).sum::<f64>().sqrt();
            squared = size(&response) / size(&velocity);
            velocity = response.iter().map(|v| v / size(&response)).collect();
        }
        2.0 / squared.sqrt() * (lame + 2.0 * shear).sqrt() / model.smoothing_length()
    }

    /// Statics use a shorter limit. On a released base, cells of half a row have the limit of free surfaces,
    /// and at least 0.95 of it at a corner of 45 degrees.
    #[test]
    fn limit_of_the_time_step() {
        for model in bases() {
            let released = |condition| limit(&model, Walls::shaken(&model.outline, condition, [false; 2]));
            let held = limit(&model, Walls::statics(&model.outline));
            let free = [Condition::VerticalRoller, Condition::Traction].map(released);
            let operators = model.numerics.operators;
            println!("{operators:?} {:?}: {held:.3} h/c_d, released {free:.3?}", model.outline.base[1]);
            let (own, released) = match operators {
                Operators::Dual => (DUAL_DRAINED_COEFFICIENT, STRETCHED_RESPONSE),
                _ => (DRAINED_COEFFICIENT, 1.0),
            };
            let is_stable = free.iter().all(|&limit| limit > own * released);
            assert!(held > own * RESPONSE && is_stable, "{held} {free:?}");
        }
    }

    /// Weights above a level base half a row below the nodes, and above a released base, are not changed.
    #[test]
    fn weights_above_a_level_base_are_unchanged() {
        let level = on_base(&[Vec2::zeros(), Vec2::new(WIDTH as f64, 0.0)]);
        assert!(!build_geometry(&level).is_balanced);
        let mut high = level.clone();
        high.volume[3] = 1.1;
        assert!(build_geometry(&high).is_balanced);
        let slope = &bases()[0];
        for released in [Condition::VerticalRoller, Condition::Traction, Condition::FreeSlip] {
            let walls = Walls::shaken(&slope.outline, released, [false; 2]);
            assert!(!is_needed(slope, EdgesView { outline: &slope.outline, walls }));
        }
    }
}
