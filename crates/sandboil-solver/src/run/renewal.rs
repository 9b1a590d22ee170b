//! Renewal of the geometry while the ground moves.

use crate::run::{domain::Domain, ground::Ground, neighbour::Neighbour};

/// Builds the geometry at the present positions, and that of the neighbour.
pub fn renew(domain: &mut Domain, neighbour: Option<&mut impl Neighbour>) {
    if domain.ground.sharpness.is_some() {
        renew_in_place(domain);
    } else {
        renew_in_balance(domain, neighbour);
    }
    domain.refresh_present_shares();
}

/// With large displacements: weight and still water act at the present positions.
fn renew_in_place(domain: &mut Domain) {
    let before = domain.ground.mass.clone();
    domain.rebuild_geometry();
    // Water that has entered pores was at rest; water that has left takes its momentum with it.
    let Ground { velocity, mass, .. } = &mut domain.ground;
    for ((v, before), mass) in velocity.iter_mut().zip(before).zip(mass) {
        *v *= (before / *mass).min(1.0);
    }
    domain.set_present_forces();
}

/// With small displacements: the renewed weights change the forces of the present stress. The difference
/// stays as a constant force, so that the change does not shock the soil: accelerations of a few hundredths
/// of gravity would liquefy it further.
fn renew_in_balance(domain: &mut Domain, neighbour: Option<&mut impl Neighbour>) {
    let mut before = domain.static_force();
    domain.rebuild_geometry();
    let after = domain.static_force();
    if let Some(neighbour) = neighbour {
        neighbour.add_push(&mut before);
        let outline = domain.ground.outline();
        neighbour.renew(&domain.ground.view(&outline));
        let nodes = domain.ground.nodes();
        neighbour.couple(&mut domain.ground.geometry, nodes);
    }
    domain.forces.balance_renewal(&before, &after);
}
