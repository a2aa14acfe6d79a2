//! Blocks of an L or a U for a plan, interlocked: each stands in the notch of another's box. Boxes overlap a lot, walls
//! nowhere, so that opening the boxes (re-braiding) is worth most here.
//!
//! All lengths are in sides of a block. A plot holds eight blocks, of one kind:
//!
//! - L: a staircase along the diagonal, a [`STEP`] from block to block. The first ones open forwards, and the corner of the
//!   next stands in their notch; the others open backwards, and the corner of the one before stands in theirs.
//! - U: two rows of four hooks that open up and down in turn, each with an arm of every neighbour in its notch.
//!
//! Nothing touches: in a plot, walls are at least 0.083 apart, of which two blocks' own yaw takes at most 0.043; plots are 2.75
//! wide and [`PITCH`] apart, of which yaws take less than 0.1 on each side.

use super::turns::{self, QUARTERS, Turn, turned};
use super::{Placed, prism, side_of};
use crate::scene::SplitMix64;

/// Cells along a side of a block, and how many of them an arm is thick: arms take 1/6.
const CELLS: u32 = 12;
const ARM: u32 = 2;
/// Triangles of a wall from the ground to the roof: twice this many.
const ROWS: u32 = 5;

const BLOCKS_A_PLOT: u32 = 8;
/// From block to block on a staircase, in x and in z; an arm and a gap.
const STEP: f32 = 0.25;
/// From hook to hook in a row.
const HOOK: f32 = 0.58;
/// How far the hooks that open down stand behind those that open up; an arm and a gap.
const HOOK_DEPTH: f32 = 0.25;
/// From row to row.
const ROW: f32 = 1.4;
/// From plot to plot.
const PITCH: f32 = 3.25;

/// Tangents of the largest small yaw of a block and of a plot.
const BLOCK_YAW: f32 = 0.03;
const PLOT_YAW: f32 = 0.05;

/// `count` blocks, plot by plot on a square, of random heights.
pub fn place(count: u32) -> Placed {
    let ell = prism::closed(CELLS, ROWS, |x, z| x < ARM || z < ARM);
    let hook = prism::closed(CELLS, ROWS, |x, z| x < ARM || z < ARM || x >= CELLS - ARM);
    let mut random = SplitMix64::new(0);
    let plots = count.div_ceil(BLOCKS_A_PLOT);
    let side = side_of(plots, 2);
    let mut instances = Vec::with_capacity(count as usize);
    for plot in 0..plots {
        let corner = [plot % side, plot / side].map(|c| c as f32 * PITCH);
        let turn = turned(QUARTERS[random.bits() as usize % 4], turns::small(&mut random, PLOT_YAW));
        let part = random.bits() as usize % 2;
        let forwards = random.bits() as u32 % (BLOCKS_A_PLOT + 1);
        for block in 0..BLOCKS_A_PLOT.min(count - plot * BLOCKS_A_PLOT) {
            let (middle, facing) = if part == 0 { staircase(block, forwards) } else { hooks(block) };
            let turn_of_block = turned(turn, turned(facing, turns::small(&mut random, BLOCK_YAW)));
            let [dx, dz] = turned(turn, middle);
            let height = random.within(0.3, 2.5);
            let at = [corner[0] + dx, 0.0, corner[1] + dz];
            instances.push(turns::upright(part, [1.0, height, 1.0], turn_of_block, at));
        }
    }
    (vec![ell, hook], instances)
}

/// The middle of an L's box, seen from the middle of its plot, and which way it faces.
fn staircase(block: u32, forwards: u32) -> ([f32; 2], Turn) {
    let middle = (block as f32 - 0.5 * (BLOCKS_A_PLOT - 1) as f32) * STEP;
    ([middle; 2], if block < forwards { QUARTERS[0] } else { QUARTERS[2] })
}

/// The same of a U.
fn hooks(block: u32) -> ([f32; 2], Turn) {
    const A_ROW: u32 = BLOCKS_A_PLOT / 2;
    let (row, column) = (block / A_ROW, block % A_ROW);
    let up = column.is_multiple_of(2);
    let x = (column as f32 - 0.5 * (A_ROW - 1) as f32) * HOOK;
    let z = (row as f32 - 0.5) * ROW + if up { -0.5 } else { 0.5 } * HOOK_DEPTH;
    ([x, z], if up { QUARTERS[0] } else { QUARTERS[2] })
}
