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
use sandboil_sph::{Csr, Vec2};

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

/// Exchange of water between the places of the corners: inflow of a place per metre of head, m/s.
pub fn cell_conduction(model: &Model, dual: &DualLattice) -> Csr<f64> {
    let mut rows = vec![Vec::new(); dual.places()];
    for (node, corners) in dual.of_node.iter().enumerate() {
        let conductivity = model.regions[model.region[node] as usize].hydraulic_conductivity.tensor();
        let mut cell = corners.map(|point| dual.position[point as usize]);
        if let Some(period) = model.period {
            // The right corners of the last column are the left ones of the first.
            for (left, right) in [(0, 1), (3, 2)] {
                if cell[right].x - cell[left].x < NARROWEST * model.spacing.x {
                    cell[right].x += period.width;
                }
            }
        }
        let area = area(&cell);
        if area < LEAST_AREA * model.cell() {
            continue;
        }
        let gradient = mean_gradient(&cell);
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
