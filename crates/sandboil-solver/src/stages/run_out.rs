//! Run-out: a stage of large displacements, its input and what it keeps beside strain and force.

use crate::{
    error::SolverError,
    run::simulation::Shaking,
    section::{
        description::{Model, Operators},
        outline::Outline,
    },
    skeleton::viscosity::Viscosity,
};
use sandboil_sph::Vec2;

/// How ground is let go to flow: on the base and between the walls of statics, under its own weight.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RunOut {
    /// Coefficient `alpha` of the artificial viscosity.
    pub viscosity: f64,
    /// Whether the left and the right side are taken away.
    pub open: [bool; 2],
    /// Surface of the still water around the ground, from left to right, m; empty: none. Left out: as it stood at rest.
    pub still_water: Option<Vec<Vec2>>,
}

impl RunOut {
    /// Refuses what no ground flows by, as part of a stage.
    ///
    /// # Errors
    /// A viscosity that is negative or not finite, and what the stage or the model asks for that ground which flows does not
    /// know: the printed operators, free-field sides and hydraulic conditions.
    pub fn validate(&self, model: &Model, stage: &Shaking) -> Result<(), SolverError> {
        let is_viscosity = self.viscosity >= 0.0 && self.viscosity.is_finite();
        let is_conservative = model.numerics.operators == Operators::Conservative;
        for (name, value, allowed, expected) in [
            ("run_out.viscosity", self.viscosity, is_viscosity, "zero or a positive number"),
            (
                "run_out",
                1.0,
                is_conservative,
                "left out with the printed operators, which small strains alone bear",
            ),
            (
                "run_out",
                1.0,
                stage.free_field == [false; 2],
                "left out beside free-field sides: ground leaves them",
            ),
            (
                "run_out",
                1.0,
                stage.conditions.is_empty(),
                "without hydraulic conditions, whose edges flow away",
            ),
        ] {
            if !allowed {
                return Err(SolverError::InvalidInput { name, value, expected });
            }
        }
        Ok(())
    }
}

/// Ground that flows.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Flowing {
    /// Forces that brake nodes which approach each other.
    pub viscosity: Viscosity,
    /// The edges, held where they stood when the ground was let go.
    pub outline: Outline,
    /// Sharpness of the weights of the lattice, 1/m2, for which the limits of the time step hold.
    pub lattice: [f64; 2],
    /// Factor on those limits where nodes have come closer than in the lattice.
    pub pace: f64,
    /// Outward normals of the nodes at a free surface, if water crosses it; else empty.
    pub free_surface: Vec<Option<Vec2>>,
}

impl Flowing {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.viscosity.bytes() + size_of_val(self.free_surface.as_slice())
    }

    /// Goes to weights of another sharpness, 1/m2.
    pub fn follow(&mut self, sharpness: [f64; 2]) {
        let squared = |(now, lattice): (f64, f64)| if lattice > 0.0 { now / lattice } else { 1.0 };
        let sharper = sharpness.into_iter().zip(self.lattice).map(squared).fold(1.0, f64::max);
        self.pace = sharper.sqrt().recip();
    }
}
