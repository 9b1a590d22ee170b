//! Darcy's law between the corners of cells: `div (k grad H)` of Eqs 3 and 7 on the dual lattice.
//!
//! Every cell is a quadrilateral of one soil with the head at its four corners. Its mean gradient is exact for linear heads
//! on any quadrilateral. What the mean gradient does not see, heads that alternate around the cell, is resisted as well
//! (Flanagan & Belytschko 1981, Int. J. Numer. Meth. Engng 17, 679-706). The exchange is symmetric and positive, carries a
//! flux across a contact of two soils and along it exactly, and ends at edges and surfaces by itself.

use crate::{
    section::{
        description::Model,
        dual_lattice::{CORNERS, DualLattice},
        node_id::id,
    },
    water::conduction::collected,
};
use sandboil_sph::{Csr, Mat2, Vec2};

/// Resistance to alternating heads, over that of conduction along the sides of a cell alone: no pair of corners of a square
/// cell then exchanges water uphill, and explicit steps may be twice as long.
const ALTERNATING: f64 = 0.5;
/// Width of a cell, over that at rest, below which its right side is that of the first column: a period to the left.
const NARROWEST: f64 = 0.1;
/// Least area of a cell that conducts, over that at rest: a cell that has been turned inside out is no longer a cell.
const LEAST_AREA: f64 = 0.1;

/// Sides of a cell whose corners are given counter-clockwise.
type Cell = [Vec2; CORNERS];

/// Area of a cell, m2; negative if it is turned inside out.
fn area(cell: &Cell) -> f64 {
    let [a, b] = [cell[2] - cell[0], cell[3] - cell[1]];
    0.5 * (a.x * b.y - a.y * b.x)
}

/// Weights of the corners in the mean gradient over a cell, 1/m.
fn mean_gradient(cell: &Cell) -> [Vec2; CORNERS] {
    let twice = 2.0 * area(cell);
    let [a, b] = [cell[1] - cell[3], cell[2] - cell[0]];
    let weight = |d: Vec2| Vec2::new(d.y, -d.x) / twice;
    [weight(a), weight(b), -weight(a), -weight(b)]
}

/// Laplacian of a wave by the exchange between corners on the undeformed lattice, 1/m2.
pub fn symbol(spacing: Vec2, wave: Vec2) -> f64 {
    let half = wave.component_mul(&spacing) * 0.5;
    let (sin, cos) = (half.map(|a| a.sin().powi(2)), half.map(|a| a.cos().powi(2)));
    let inverse = spacing.map(|length| length.powi(-2));
    4.0 * (inverse.x * sin.x * cos.y
        + inverse.y * sin.y * cos.x
        + ALTERNATING * inverse.sum() * sin.x * sin.y)
}

/// The cell of a node with its corners where they are; none if it has been turned inside out.
fn cell(model: &Model, dual: &DualLattice, node: usize) -> Option<Cell> {
    let mut cell = dual.of_node[node].map(|point| dual.position[point as usize]);
    if let Some(period) = model.period {
        // The right corners of the last column are the left ones of the first.
        for (left, right) in [(0, 1), (3, 2)] {
            if cell[right].x - cell[left].x < NARROWEST * model.spacing.x {
                cell[right].x += period.width;
            }
        }
    }
    (area(&cell) >= LEAST_AREA * model.cell()).then_some(cell)
}

fn conductivity(model: &Model, node: usize) -> Mat2 {
    model.regions[model.region[node] as usize].hydraulic_conductivity.tensor()
}

/// Exchange of water between the places of the corners: inflow of a place per metre of head, m/s. `relative` is the
/// conductivity of each cell over that of the saturated soil.
pub fn cell_conduction(model: &Model, dual: &DualLattice, relative: impl Fn(usize) -> f64) -> Csr<f64> {
    let mut rows = vec![Vec::new(); dual.places()];
    for (node, corners) in dual.of_node.iter().enumerate() {
        let Some(cell) = cell(model, dual, node) else { continue };
        let (area, gradient) = (area(&cell), mean_gradient(&cell));
        let conductivity = conductivity(model, node) * relative(node);
        let flux = gradient.map(|g| conductivity * g);
        let alternating = {
            let sign = [1.0, -1.0, 1.0, -1.0];
            let slope: Vec2 = cell.iter().zip(sign).map(|(at, sign)| at * sign).sum();
            let residual = |corner: usize| sign[corner] - gradient[corner].dot(&slope);
            [0, 1, 2, 3].map(residual)
        };
        let sides: f64 = gradient.iter().zip(&flux).map(|(g, q)| g.dot(q)).sum();
        let stiffness = 0.25 * ALTERNATING * area * sides;
        let places = corners.map(|point| dual.place[point as usize]);
        for i in 0..CORNERS {
            for j in 0..CORNERS {
                let along = area * gradient[i].dot(&flux[j]);
                let exchange = along + stiffness * alternating[i] * alternating[j];
                rows[places[i] as usize].push((places[j], -exchange));
            }
        }
    }
    for (place, row) in rows.iter_mut().enumerate() {
        row.push((id(place), 0.0));
    }
    collected(rows)
}

/// What the acceleration of the soil in the cell of each node drives into the places of its corners: inflow per
/// acceleration, m s (last term of Eq. 7).
pub fn driven_by_acceleration(
    model: &Model,
    dual: &DualLattice,
    relative: impl Fn(usize) -> f64,
) -> Csr<Vec2> {
    let mut rows = vec![Vec::new(); dual.places()];
    for (node, corners) in dual.of_node.iter().enumerate() {
        let Some(cell) = cell(model, dual, node) else { continue };
        let mobility = conductivity(model, node) * (relative(node) / model.gravity);
        for (point, gradient) in corners.iter().zip(mean_gradient(&cell)) {
            let weight = mobility * gradient * -area(&cell);
            rows[dual.place[*point as usize] as usize].push((id(node), weight));
        }
    }
    let mut table = Csr::with_capacity(rows.len(), CORNERS * dual.of_node.len());
    for row in &mut rows {
        table.push_row(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        section::description::{Conductivity, Operators},
        testing::square_block,
    };
    use sandboil_sph::Period;

    const SIDE: usize = 6;

    /// A block whose upper `rows` rows have a conductivity of their own, with its corners displaced by an affine map.
    fn block(conductivities: [Conductivity; 2], rows: usize) -> (Model, DualLattice) {
        let mut model = square_block(SIDE);
        model.numerics.operators = Operators::Dual;
        model.regions.push(model.regions[0].clone());
        for (region, conductivity) in model.regions.iter_mut().zip(conductivities) {
            region.hydraulic_conductivity = conductivity;
        }
        model.region = (0..model.nodes()).map(|node| u32::from(node / SIDE >= SIDE - rows)).collect();
        let mut dual = DualLattice::new(&model);
        for x in &mut dual.position {
            *x = Vec2::new(1.1 * x.x + 0.3 * x.y, 0.9 * x.y - 0.2 * x.x);
        }
        (model, dual)
    }

    fn inflow(table: &Csr<f64>, head: &[f64], place: usize) -> f64 {
        table.iter_row(place).map(|(j, weight)| weight * head[j]).sum()
    }

    /// A linear head moves no water into a corner inside, in isotropic and in anisotropic soil, on deformed cells; the
    /// exchange is symmetric, and its energy is that of the gradient.
    #[test]
    fn linear_heads_are_exact() {
        let direction = Vec2::new(0.6, 0.8);
        for conductivity in [Conductivity::isotropic(2.0), Conductivity { major: 5.0, minor: 0.5, direction }]
        {
            let (model, dual) = block([conductivity; 2], 0);
            let table = cell_conduction(&model, &dual, |_| 1.0);
            let gradient = Vec2::new(0.7, -0.4);
            let head: Vec<f64> = dual.place_positions().iter().map(|x| gradient.dot(x)).collect();
            let mut energy = 0.0;
            for place in 0..dual.places() {
                let net = inflow(&table, &head, place);
                assert!(dual.is_free[place] || net.abs() < 1e-13, "{place}: {net}");
                energy -= head[place] * net;
                for (other, weight) in table.iter_row(place) {
                    let back = table.iter_row(other).find(|(j, _)| *j == place).map_or(0.0, |(_, w)| *w);
                    assert!((weight - back).abs() < 1e-14);
                }
            }
            let area = (1.1 * 0.9 + 0.3 * 0.2) * (SIDE * SIDE) as f64;
            let exact = area * gradient.dot(&(conductivity.tensor() * gradient));
            assert!((energy / exact - 1.0).abs() < 1e-12, "{energy} {exact}");
        }
    }

    /// The kinked head of a steady flux across a contact, and a head along it, move no water into corners inside.
    #[test]
    fn contacts_are_exact() {
        let soils = [1.0, 1e-3].map(Conductivity::isotropic);
        let (model, _) = block(soils, 3);
        let dual = DualLattice::new(&model);
        let table = cell_conduction(&model, &dual, |_| 1.0);
        let contact = 2.5;
        let across = |x: &Vec2| if x.y < contact { x.y - contact } else { 1e3 * (x.y - contact) };
        let along = |x: &Vec2| x.x;
        let places = dual.place_positions();
        for head in [places.iter().map(across).collect::<Vec<f64>>(), places.iter().map(along).collect()] {
            for place in (0..dual.places()).filter(|&place| !dual.is_free[place]) {
                let net = inflow(&table, &head, place);
                assert!(net.abs() < 1e-12, "{place}: {net}");
            }
        }
    }

    /// A linear field of accelerations drives its divergence times the conductivity over gravity into every place inside.
    #[test]
    fn linear_accelerations_are_exact() {
        let anisotropic = Conductivity { major: 5.0, minor: 0.5, direction: Vec2::new(0.6, 0.8) };
        let (model, _) = block([anisotropic; 2], 0);
        let dual = DualLattice::new(&model);
        let table = driven_by_acceleration(&model, &dual, |_| 1.0);
        let rate = Mat2::new(0.3, -0.7, 0.2, 0.9);
        let acceleration: Vec<Vec2> =
            model.position.iter().map(|x| rate * x + Vec2::new(2.0, -1.0)).collect();
        let expected = (anisotropic.tensor() * rate).trace() / model.gravity;
        for place in (0..dual.places()).filter(|&place| !dual.is_free[place]) {
            let found: f64 = table.iter_row(place).map(|(j, w)| w.dot(&acceleration[j])).sum();
            assert!((found - expected).abs() < 1e-13, "{place}: {found} {expected}");
        }
    }

    /// A section one column wide between periodic sides conducts as a wide one.
    #[test]
    fn one_periodic_column_conducts() {
        let mut model = square_block(SIDE);
        model.numerics.operators = Operators::Dual;
        model.regions[0].hydraulic_conductivity = Conductivity::isotropic(1.0);
        let column: Vec<usize> = (0..SIDE).map(|row| row * SIDE).collect();
        model.position = column.iter().map(|&node| model.position[node]).collect();
        (model.volume, model.region) = (vec![1.0; SIDE], vec![0; SIDE]);
        model.period = Some(Period { width: 1.0 });
        let dual = DualLattice::new(&model);
        assert_eq!(dual.places(), SIDE + 1);
        let table = cell_conduction(&model, &dual, |_| 1.0);
        let head: Vec<f64> = dual.place_positions().iter().map(|x| x.y * x.y).collect();
        for place in (0..dual.places()).filter(|&place| !dual.is_free[place]) {
            assert!((inflow(&table, &head, place) - 2.0).abs() < 1e-13);
        }
    }
}
