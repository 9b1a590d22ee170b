//! Stencils of one query kind.

use crate::weights::images::Surroundings;
use sandboil_sph::{
    Mat2, NeighbourList, Period, Vec2, WendlandQuintic,
    operators::{Member, stencil},
};

/// Stencils of one query kind, cut to the kernel's support.
pub struct Stencils<'a> {
    pub around: &'a Surroundings,
    pub volume: &'a [f64],
    pub kernel: WendlandQuintic,
    pub period: Option<Period>,
}

impl Stencils<'_> {
    /// The members around one query of a list.
    pub fn all(&self, list: &NeighbourList, query: usize, at: Vec2) -> Vec<Member> {
        stencil(list, query, at, &self.around.sources, self.volume, self.kernel, self.period)
    }

    /// Those of `members` that show the velocity component: the nodes, and images of which `shows` is true.
    pub fn showing(
        &self,
        members: &[Member],
        shows: impl Fn(&crate::weights::images::Image) -> bool,
    ) -> Vec<Member> {
        members.iter().copied().filter(|m| self.around.image(m.source).is_none_or(&shows)).collect()
    }

    /// Velocity of a member from that of its node.
    pub fn map(&self, member: &Member) -> Mat2 {
        self.around.image(member.source).map_or_else(Mat2::identity, |image| image.map)
    }
}

pub fn real_only(members: &[Member]) -> Vec<Member> {
    members.iter().copied().filter(|m| !m.mirrored).collect()
}
