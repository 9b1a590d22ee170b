//! Largest values of every node in a stage.

use crate::{run::ground::Ground, skeleton::point::maximum_shear_strain, stages::stage::Output};

/// Envelopes over all steps of a stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Envelopes {
    /// Largest excess pore pressure of every node, kPa, if it is recorded.
    pub pressure: Option<Vec<f64>>,
    /// Largest engineering shear strain of every stress node, if it is recorded.
    pub strain: Option<Vec<f64>>,
}

impl Envelopes {
    /// The envelopes of a stage.
    pub fn new(ground: &Ground, output: &Output) -> Self {
        let is_wet = ground.water.is_some();
        Self {
            pressure: (output.pressure_envelope && is_wet).then(|| vec![0.0; ground.nodes()]),
            strain: output.strain_envelope.then(|| vec![0.0; ground.points.len()]),
        }
    }

    /// Updates the envelopes with the present values.
    pub fn record(&mut self, ground: &Ground) {
        if let (Some(envelope), Some(water)) = (&mut self.pressure, &ground.water) {
            for (node, largest) in envelope.iter_mut().enumerate() {
                *largest = largest.max(water.excess(node));
            }
        }
        if let Some(envelope) = &mut self.strain {
            for (largest, point) in envelope.iter_mut().zip(&ground.points) {
                *largest = largest.max(maximum_shear_strain(point.strain));
            }
        }
    }
}
