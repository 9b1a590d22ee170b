//! The largest stable time step, from measured limits, and what limits it.

use crate::{
    section::description::{Model, Operators},
    skeleton::rayleigh::Rayleigh,
    water::{cell_conduction, pore_pressure::FlowScheme, pore_water::PoreWater},
    weights::lattice::lattice,
};
use sandboil_sph::{
    LeastSquaresFit, Vec2, WendlandQuintic,
    operators::{corrected_gradient, laplacian_factor},
};

/// Limit of the skeleton wave over `h / c_d` with free surfaces: the least value, 0.994, is that of h = 1.4
/// dx.
pub const DRAINED_COEFFICIENT: f64 = 0.99;
/// Largest factor of dispersion-corrected inertia on the squared frequency of any wave: the limit becomes
/// `0.71 h / c_d` (the least value, 0.713, is that of h = 1.4 dx and Poisson's ratio zero).
pub const CORRECTED_RESPONSE: f64 = (DRAINED_COEFFICIENT / 0.71) * (DRAINED_COEFFICIENT / 0.71);
/// The same on the dual lattice: `0.58 h / c_d`.
pub const DUAL_CORRECTED_RESPONSE: f64 =
    (DUAL_DRAINED_COEFFICIENT / 0.58) * (DUAL_DRAINED_COEFFICIENT / 0.58);
/// Largest factor of dispersion-corrected inertia on the rates of the velocity filter (2.53 at h = 1.4 dx).
pub const CORRECTED_FILTER: f64 = 2.55;
/// The same on the dual lattice, as far as it acts on the fastest waves.
pub const DUAL_CORRECTED_FILTER: f64 = 9.0;
/// Limit of the undrained wave over `h / c_u`, with prescribed pressure at the surfaces.
pub const UNDRAINED_COEFFICIENT: f64 = 1.7;
/// The same without prescribed pressure: undrained soil.
pub const FREE_UNDRAINED_COEFFICIENT: f64 = 0.9;
/// Damping ratio of the fastest wave for artificial viscosity with `alpha = 1`: its rate is at most `2 alpha
/// c / h`.
pub const VISCOSITY_RATIO: f64 = 0.5;
/// The same limits on the dual lattice. Free blocks of ordered nodes are stable up to 1.07, of nodes displaced by a tenth of
/// a spacing up to 0.99.
pub const DUAL_DRAINED_COEFFICIENT: f64 = 0.98;
/// With prescribed pressure at the surface, up to 1.36 and 1.26.
pub const DUAL_UNDRAINED_COEFFICIENT: f64 = 1.2;
/// Without, up to 1.05 and 0.97.
pub const DUAL_FREE_UNDRAINED_COEFFICIENT: f64 = 0.96;
/// Limit of the undrained wave in an unbounded dual lattice over `h / c_u`.
const DUAL_UNBOUNDED_COEFFICIENT: f64 = 1.6;
/// Smoothing length over the spacing above which the limits of the dual lattice no longer grow with it.
const DUAL_WIDEST: f64 = 1.2;
/// Explicit diffusion between the corners of cells: `dt <= 0.48 dx^2 C / k`; 0.5 inside a lattice.
pub const DUAL_DIFFUSION_COEFFICIENT: f64 = 0.48;
/// Drainage of a few run-out nodes that touch only each other, over that of the lattice: through the surface,
/// `2/dx^2` of up to `8/dx^2`.
pub const FREE_SURFACE_DRAINAGE: f64 = 0.25;
/// Explicit diffusion: `dt <= 0.65 dx^2 C / k`.
pub const DIFFUSION_COEFFICIENT: f64 = 0.65;
/// Largest eigenvalue of the velocity filter over `xi C_s / dx`.
pub const FILTER_EIGENVALUE: f64 = 1.05;
/// The same on the dual lattice, as far as it acts on the fastest waves: there the filter is strongest on waves that have
/// little stiffness.
pub const DUAL_FILTER_EIGENVALUE: f64 = 0.25;
/// Largest shear-wave over compression-wave speed of a soil: that of Poisson's ratio zero.
pub const LARGEST_SPEED_RATIO: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Damping ratio of the fastest wave above which the limit of the viscous part alone, `dt < 1/(xi w)`, is
/// shorter than that of the wave, `dt < 2/w`.
pub const VISCOUS_RATIO: f64 = 0.5;
/// Wave numbers sampled along an axis and along a diagonal of the lattice.
pub const SPECTRUM_SAMPLES: u32 = 24;
/// Bisections of the implicit limit: one part in a thousand.
pub const BISECTIONS: u32 = 12;
/// Share of the drained limit above which a limit with implicit diffusion counts as drained.
const NEARLY_DRAINED: f64 = 0.99;

/// What limits the time step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Criterion {
    /// Compression wave of the drained skeleton.
    #[default]
    DrainedWave,
    /// Compression wave with the pore water's stiffness.
    UndrainedWave,
    /// Compression wave whose pore water partly drains within a step (implicit diffusion).
    DrainingWave,
    /// Explicit diffusion of pore pressure.
    Diffusion,
    /// Viscous stress of Rayleigh damping.
    Damping,
}

impl Criterion {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::DrainedWave => "drained compression wave",
            Self::UndrainedWave => "undrained compression wave",
            Self::DrainingWave => "partly drained compression wave",
            Self::Diffusion => "explicit pore-pressure diffusion",
            Self::Damping => "Rayleigh damping of the shortest waves",
        }
    }
}

/// A limit of the time step.
#[derive(Debug, Clone, Copy, Default)]
pub struct TimeLimit {
    /// Longest stable time step, s.
    pub dt: f64,
    /// What sets it.
    pub criterion: Criterion,
}

impl TimeLimit {
    /// The shorter of two, the first of equal ones.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        if other.dt < self.dt { other } else { self }
    }
}

/// How pore pressure enters the limit of the time step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum PressureCoupling {
    /// No water, or frozen pressure.
    None,
    /// Explicit or no diffusion.
    Explicit,
    /// Implicit diffusion.
    Implicit,
}

impl PressureCoupling {
    /// How the pressure of a stage's pore water is advanced.
    pub fn of(water: Option<&PoreWater>) -> Self {
        match water.map(PoreWater::scheme) {
            None => Self::None,
            Some(FlowScheme::Implicit) => Self::Implicit,
            Some(_) => Self::Explicit,
        }
    }
}

/// Spectrum of the pressure operators of Eq. 7 on the undeformed lattice.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PressureSpectrum {
    /// Pairs of eigenvalues, 1/m2: of the divergence followed by its transpose, and of the Laplacian.
    eigenvalues: Vec<(f64, f64)>,
}

impl PressureSpectrum {
    /// Samples the spectrum of the model's lattice.
    pub fn new(model: &Model) -> Self {
        let symbol = if model.numerics.operators == Operators::Dual {
            symbols_at_corners(model)
        } else {
            symbols_at_nodes(model)
        };
        let diagonal = Vec2::new(1.0 / model.spacing.x, 1.0 / model.spacing.y);
        let directions = [Vec2::new(0.0, diagonal.y), Vec2::new(diagonal.x, 0.0), diagonal]
            .map(|d| d * std::f64::consts::PI);
        let eigenvalues = directions
            .iter()
            .flat_map(|d| {
                (1..=SPECTRUM_SAMPLES).map(move |k| d * (f64::from(k) / f64::from(SPECTRUM_SAMPLES)))
            })
            .map(symbol)
            .collect();
        Self { eigenvalues }
    }

    /// Largest share of implicitly diffused pressure in the stability bound at a step `dt`: a mode that
    /// changes sign in each step is bounded by `s/4 + q / (2 (2 + kappa lambda dt)) < 1`, with `s` and `q`
    /// the skeleton's and the water's squared frequencies times `dt^2`.
    fn share(&self, stiffness_over_density: f64, diffusivity: f64, dt: f64) -> f64 {
        self.eigenvalues
            .iter()
            .map(|(gradient, laplacian)| {
                stiffness_over_density * gradient * dt * dt / (2.0 * (2.0 + diffusivity * laplacian * dt))
            })
            .fold(0.0, f64::max)
    }
}

/// Squared gradient and Laplacian of a wave by the operators at nodes, 1/m2.
fn symbols_at_nodes(model: &Model) -> Box<dyn Fn(Vec2) -> (f64, f64)> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let members = lattice(model, Vec2::zeros());
    let corrected = corrected_gradient(&members, kernel).unwrap_or_default();
    let factor = laplacian_factor(&members, &corrected);
    Box::new(move |wave| {
        let gradient: Vec2 = members.iter().zip(&corrected).map(|(m, g)| g * wave.dot(&m.offset).sin()).sum();
        let laplacian: f64 =
            members.iter().zip(&factor).map(|(m, f)| 2.0 * f * (1.0 - wave.dot(&m.offset).cos())).sum();
        (gradient.norm_squared(), laplacian)
    })
}

/// The same by the operators at the corners of cells.
fn symbols_at_corners(model: &Model) -> Box<dyn Fn(Vec2) -> (f64, f64)> {
    let (kernel, spacing) = (WendlandQuintic::new(model.smoothing_length()), model.spacing);
    let members = lattice(model, spacing * 0.5);
    let fit = LeastSquaresFit::new(&members, kernel).ok();
    let weights: Vec<(Vec2, Vec2)> = fit
        .iter()
        .flat_map(|fit| members.iter().enumerate().map(|(k, m)| (m.offset, fit.weight(k, m).gradient)))
        .collect();
    Box::new(move |wave| {
        let gradient: Vec2 = weights.iter().map(|(offset, g)| g * wave.dot(offset).sin()).sum();
        (gradient.norm_squared(), cell_conduction::symbol(spacing, wave))
    })
}

/// Damping ratio of the velocity filter's largest eigenvalue on the fastest wave, of frequency `2 c_d / h`; the
/// printed set has none.
pub fn filter_ratio(model: &Model) -> f64 {
    let eigenvalue = match model.numerics.operators {
        Operators::Conservative => FILTER_EIGENVALUE,
        Operators::Dual => DUAL_FILTER_EIGENVALUE,
        Operators::Printed => 0.0,
    };
    let damping = eigenvalue * model.numerics.velocity_filter * LARGEST_SPEED_RATIO;
    0.25 * damping * model.numerics.smoothing_ratio
}

/// Factor of the damping ratio of the fastest wave on its limit `dt_0 = 2/w`.
///
/// A leapfrog with damping `2 xi w` on the lagging velocity is stable while `(dt/dt_0)^2 + 2 xi (dt/dt_0) < 1`.
pub fn damping_factor(ratio: f64) -> f64 {
    (1.0 + ratio * ratio).sqrt() - ratio
}

/// Input of the limit of the time step besides the soil.
#[derive(Clone, Copy)]
pub struct Limits<'a> {
    /// How pore pressure enters the limit.
    pub coupling: PressureCoupling,
    /// Spectrum of the pressure operators, read with implicit diffusion only.
    pub spectrum: &'a PressureSpectrum,
    /// Rayleigh damping, which acts on the skeleton alone: its rate is that of the skeleton's fastest wave,
    /// without the stiffness of the water.
    pub rayleigh: Option<&'a Rayleigh>,
    /// Whether inertia is corrected for dispersion.
    pub is_corrected: bool,
    /// Coefficient of the artificial viscosity, dimensionless.
    pub viscosity: f64,
    /// Whether the pressure of the nodes below the surface is tied to the surface; if not, no pressure is
    /// prescribed within a step.
    pub surface_is_tied: bool,
}

/// The fastest waves of one region: their limits of the time step.
struct RegionWaves<'a> {
    model: &'a Model,
    region: usize,
    limits: &'a Limits<'a>,
    /// Stiffness `K + 4G/3` of the skeleton, kPa.
    skeleton_stiffness: f64,
    /// Density over the largest factor of corrected inertia on squared frequencies, Mg/m3.
    density: f64,
    /// Damping ratio of velocity filter and artificial viscosity.
    filter: f64,
}

impl<'a> RegionWaves<'a> {
    fn new(model: &'a Model, region: usize, skeleton_stiffness: f64, limits: &'a Limits) -> Self {
        let (response, filter_response) = match (limits.is_corrected, model.numerics.operators) {
            (false, _) => (1.0, 1.0),
            (true, Operators::Dual) => (DUAL_CORRECTED_RESPONSE, DUAL_CORRECTED_FILTER),
            (true, _) => (CORRECTED_RESPONSE, CORRECTED_FILTER),
        };
        let viscosity = VISCOSITY_RATIO * limits.viscosity;
        Self {
            model,
            region,
            limits,
            skeleton_stiffness,
            density: model.mixture_density(region) / response,
            filter: filter_ratio(model) * filter_response / response.sqrt() + viscosity,
        }
    }

    /// Limit of a wave without damping, s.
    fn undamped(&self, coefficient: f64, stiffness: f64) -> f64 {
        let h = self.model.smoothing_length();
        let length = if self.is_dual() { h.min(DUAL_WIDEST * self.model.mean_spacing()) } else { h };
        coefficient * length / (stiffness / self.density).sqrt()
    }

    fn undamped_drained(&self) -> f64 {
        self.undamped(self.drained_coefficient(), self.skeleton_stiffness)
    }

    /// Ratio of Rayleigh damping, `rate / (2 w)`, for a wave with the undamped limit `2/w`, s.
    fn rayleigh_ratio(&self, limit: f64) -> f64 {
        let rate = self.limits.rayleigh.map_or(0.0, |damping| damping.rate(2.0 / self.undamped_drained()));
        0.25 * rate * limit
    }

    /// Limit of a wave with all damping.
    fn damped(&self, coefficient: f64, stiffness: f64, criterion: Criterion) -> TimeLimit {
        let limit = self.undamped(coefficient, stiffness);
        let ratio = self.rayleigh_ratio(limit);
        let criterion = if ratio > VISCOUS_RATIO { Criterion::Damping } else { criterion };
        TimeLimit { dt: limit * damping_factor(self.filter + ratio), criterion }
    }

    fn drained(&self) -> TimeLimit {
        self.damped(self.drained_coefficient(), self.skeleton_stiffness, Criterion::DrainedWave)
    }

    fn undrained(&self) -> TimeLimit {
        let stiffness = self.skeleton_stiffness + self.water_stiffness();
        self.damped(self.undrained_coefficient(), stiffness, Criterion::UndrainedWave)
    }

    fn water_stiffness(&self) -> f64 {
        self.model.water_stiffness(self.model.regions[self.region].porosity)
    }

    fn largest_diffusivity(&self) -> f64 {
        self.model.pressure_diffusivity(self.region, |k| k.major)
    }

    fn is_dual(&self) -> bool {
        self.model.numerics.operators == Operators::Dual
    }

    fn drained_coefficient(&self) -> f64 {
        if self.is_dual() { DUAL_DRAINED_COEFFICIENT } else { DRAINED_COEFFICIENT }
    }

    fn undrained_coefficient(&self) -> f64 {
        let is_tied = self.largest_diffusivity() > 0.0 && self.limits.surface_is_tied;
        match (self.is_dual(), is_tied) {
            (false, true) => UNDRAINED_COEFFICIENT,
            (false, false) => FREE_UNDRAINED_COEFFICIENT,
            (true, true) => DUAL_UNDRAINED_COEFFICIENT,
            (true, false) => DUAL_FREE_UNDRAINED_COEFFICIENT,
        }
    }

    /// Limit of the waves and of explicit diffusion together.
    fn with_explicit_diffusion(&self, waves: TimeLimit) -> TimeLimit {
        let area = self.model.spacing.x.min(self.model.spacing.y).powi(2);
        let coefficient = if self.is_dual() { DUAL_DIFFUSION_COEFFICIENT } else { DIFFUSION_COEFFICIENT };
        let diffusion = coefficient * area / self.largest_diffusivity();
        let dt = (waves.dt.powi(-2) + diffusion.powi(-2)).powf(-0.5);
        let criterion = if diffusion < waves.dt { Criterion::Diffusion } else { waves.criterion };
        TimeLimit { dt, criterion }
    }

    /// Limit with implicit diffusion, between that of `undrained` waves and the drained one, by bisection: water that
    /// drains at the scale of the spacing within a step adds no stiffness to the short waves.
    fn with_implicit_diffusion(&self, undrained: TimeLimit) -> TimeLimit {
        let drained = self.drained();
        let damping = damping_factor(self.filter + self.rayleigh_ratio(self.undamped_drained()));
        let drainage = if self.limits.surface_is_tied { 1.0 } else { FREE_SURFACE_DRAINAGE };
        // In anisotropic soil drainage is slowest along the smallest conductivity.
        let diffusivity = drainage * self.model.pressure_diffusivity(self.region, |k| k.minor);
        let of_lattice = if self.is_dual() { DUAL_UNBOUNDED_COEFFICIENT } else { UNDRAINED_COEFFICIENT };
        let surface_factor = (of_lattice / self.undrained_coefficient()).powi(2);
        let water = surface_factor * self.water_stiffness() / self.density;
        let is_stable = |dt: f64| {
            let share = self.limits.spectrum.share(water, diffusivity, dt / damping);
            (dt / drained.dt).powi(2) + share <= 1.0
        };
        let (mut low, mut high) = (undrained.dt.min(drained.dt), drained.dt);
        if !is_stable(low) {
            return undrained;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if is_stable(middle) { low = middle } else { high = middle }
        }
        let is_drained = low > NEARLY_DRAINED * drained.dt;
        TimeLimit { dt: low, criterion: if is_drained { drained.criterion } else { Criterion::DrainingWave } }
    }
}

/// Limit for one region at a skeleton stiffness `K + 4G/3` in kPa.
pub fn region_limit(model: &Model, region: usize, skeleton_stiffness: f64, limits: &Limits) -> TimeLimit {
    let waves = RegionWaves::new(model, region, skeleton_stiffness, limits);
    let drained = waves.drained();
    if limits.coupling == PressureCoupling::None {
        return drained;
    }
    let of_waves = drained.least(waves.undrained());
    if waves.largest_diffusivity() == 0.0 {
        return of_waves;
    }
    match limits.coupling {
        PressureCoupling::Explicit => waves.with_explicit_diffusion(of_waves),
        _ => waves.with_implicit_diffusion(of_waves),
    }
}
