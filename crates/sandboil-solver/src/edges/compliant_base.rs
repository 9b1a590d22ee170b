//! The compliant base (Eq. 14 as corrected).

use crate::{
    edges::{
        base::{Base, Impedance, UpgoingWave, Vertical},
        dashpots::{Dashpot, Dashpots, NodalMotion, trace},
    },
    section::{description::Model, edge_nodes::EdgeNodes},
};
use sandboil_sph::{Csr, Vec2};

/// The wave that arrives at one dashpot of the base.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct Incoming {
    wave: usize,
    /// Delay of the shear and of the compression wave, s.
    delay: [f64; 2],
    /// Target velocity of the dashpot for a unit of the upgoing horizontal and vertical velocity.
    factor: Vec2,
}

/// The compliant base: dashpots that pull towards the motion of the half-space.
///
/// On a half-space with the upgoing waves `v_su`, `v_pu` a dashpot's traction is `sigma_up . n + eta (v_up -
/// v)`, with the stress `sigma_up` of the waves. On a level base this is Eq. 14, `2 rho C_s v_su - eta_s v_x`
/// and the same for P. The waves rise with level fronts: on an inclined base their traction depends on the
/// normal, and they arrive later at points above the datum.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CompliantBase {
    dashpots: Dashpots,
    incoming: Vec<Option<Incoming>>,
    waves: Vec<UpgoingWave>,
    impedance: Vec<Impedance>,
}

impl CompliantBase {
    /// A dashpot below each of the lowest nodes, on half-spaces of the given impedances.
    pub fn new(
        model: &Model,
        edges: &EdgeNodes,
        position: &[Vec2],
        mass: &[f64],
        impedance: Vec<Impedance>,
        base: &Base,
    ) -> Self {
        let points = edges.base_points(model, position);
        let datum = base.datum.unwrap_or_else(|| model.outline.lowest());
        let (mut all, mut incoming) = (Vec::new(), Vec::new());
        for ((point, at), below) in points.iter().enumerate().zip(&impedance) {
            let Impedance { density, shear_speed, compression_speed } = *below;
            let (eta_s, eta_p) = (density * shear_speed, density * compression_speed);
            let normal = model.outline.base_normal(at.x);
            let tangent = Vec2::new(-normal.y, normal.x);
            // Resistance to a horizontal motion of an inclined roller base: from its components along and
            // across the base.
            let horizontal = (Vec2::x(), eta_s * tangent.x.powi(2) + eta_p * normal.x.powi(2));
            let directions = match base.vertical {
                Vertical::Roller => vec![horizontal],
                Vertical::Absorbing => vec![(tangent, eta_s), (normal, eta_p)],
            };
            // Tractions of upgoing waves of unit velocity on the base.
            let lateral = eta_p - 2.0 * eta_s * shear_speed / compression_speed;
            let shear_wave = -eta_s * Vec2::new(normal.y, normal.x);
            let compression_wave = -Vec2::new(lateral * normal.x, eta_p * normal.y);
            for (direction, impedance) in directions {
                all.push(Dashpot { point, direction, impedance, length: model.spacing.x / -normal.y });
                let (rise, arrival) = (at.y - datum, base.at(at.x));
                incoming.push(arrival.wave.map(|wave| Incoming {
                    wave,
                    delay: [shear_speed, compression_speed].map(|speed| arrival.delay + rise / speed),
                    factor: Vec2::new(
                        direction.x + direction.dot(&shear_wave) / impedance,
                        direction.y + direction.dot(&compression_wave) / impedance,
                    ),
                }));
            }
        }
        let dashpots = Dashpots::new(all, trace(model, position, &points, &edges.base), mass);
        Self { dashpots, incoming, waves: base.waves.clone(), impedance }
    }

    /// The half-space below each of the lowest nodes.
    pub fn impedance(&self) -> &[Impedance] {
        &self.impedance
    }

    /// The dashpots.
    pub fn dashpots(&self) -> &Dashpots {
        &self.dashpots
    }

    /// See [`Dashpots::spread_by`].
    pub fn spread_by(&mut self, spread: Csr<Vec2>, nodes: usize) {
        self.dashpots.spread_by(spread, nodes);
    }

    /// See [`Dashpots::begin_step`].
    pub fn begin_step(&mut self, velocity: &[Vec2]) {
        self.dashpots.begin_step(velocity);
    }

    /// See [`Dashpots::end_step`].
    pub fn end_step(&mut self, time: f64, dt: f64, mass: &[f64], motion: &mut NodalMotion) {
        let (incoming, waves) = (&self.incoming, &self.waves);
        self.dashpots.end_step(dt, mass, motion, |k| {
            incoming[k].map_or(0.0, |incoming| {
                let (wave, [s, p]) = (&waves[incoming.wave], incoming.delay);
                incoming.factor.x * wave.horizontal_at(time - s)
                    + incoming.factor.y * wave.vertical_at(time - p)
            })
        });
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let waves = |wave: &UpgoingWave| 8 * (wave.horizontal.len() + wave.vertical.len());
        self.dashpots.bytes()
            + size_of_val(self.incoming.as_slice())
            + size_of_val(self.impedance.as_slice())
            + self.waves.iter().map(waves).sum::<usize>()
    }
}
