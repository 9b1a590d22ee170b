//! The soil skeleton: strain, stress, nodal forces, damping and inertia.

pub mod contacts;
pub mod deformation;
pub mod inertia;
pub mod local_damping;
pub mod phases;
pub mod point;
pub mod printed;
pub mod rayleigh;
pub mod section_view;
pub mod shared_volume;
pub mod soils;
#[cfg(test)]
pub mod spectrum_tests;
pub mod strain_and_force;
pub mod viscosity;
