//! Dispatches for work whose amount only the device knows.

use super::shaders::Shader;
use super::{Context, Kernel};

/// Workgroups that keep a device busy and share whatever there is to do: each takes a piece of it, then the piece that is as
/// many pieces ahead as there are workgroups, until nothing is left (`glsl/gpu/grid.glsl`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Grid {
    /// Invocations a workgroup.
    pub workgroup: u32,
    /// Workgroups of a dispatch.
    pub groups: u32,
    /// Items of an invocation in a piece.
    pub rounds: u32,
    /// Whether the first pieces go to workgroups that lie far apart, for a driver that gives each core as many workgroups side by side: the
    /// first core would have all that there is, where it is little. For that a dispatch has a power of two of them.
    pub spread: bool,
}

/// `SPREAD_BIT` in `glsl/gpu/grid.glsl`.
const SPREAD_BIT: u32 = 16;

impl Grid {
    /// For a device. On a CPU few workgroups, as each costs its start even if there is nothing to do, and long pieces, as each is
    /// done by one core; on a GPU enough for some hundred thousand invocations.
    pub fn of(context: &Context) -> Grid {
        context.tuning.grid
    }

    /// Workgroups for `most` items at most: on a GPU, starting workgroups that find nothing costs more than small work does.
    pub fn groups_for(&self, most: u32) -> u32 {
        let groups = most.div_ceil(self.workgroup.saturating_mul(self.rounds)).clamp(1, self.groups);
        if self.spread { 1 << groups.ilog2() } else { groups }
    }

    /// The constant 1 of kernels that take their items from the grid.
    pub fn word(&self) -> u32 {
        self.rounds | u32::from(self.spread) << SPREAD_BIT
    }

    /// The kernel of a shader that takes its items from the grid.
    pub fn kernel(&self, shader: &'static Shader) -> Kernel {
        Kernel::new(shader, self.workgroup, &[self.word()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dispatch_has_as_many_workgroups_as_pieces_or_where_they_are_spread_the_power_of_two_below() {
        let grid = Grid { workgroup: 8, groups: 48, rounds: 4, spread: false };
        let spread = Grid { spread: true, ..grid };
        for (most, pieces, power) in
            [(0, 1, 1), (32, 1, 1), (33, 2, 2), (200, 7, 4), (1024, 32, 32), (u32::MAX, 48, 32)]
        {
            assert_eq!((grid.groups_for(most), spread.groups_for(most)), (pieces, power), "{most} items");
        }
        assert_eq!((grid.word(), spread.word()), (4, 4 | 1 << 16));
    }
}
