//! L-shaped rows of houses, nested: each stands in the notch of the one before, a street's width behind its walls. Boxes lie over
//! each other up to sixteen deep, walls touch nowhere, so that opening the boxes (re-braiding) is worth most here.
//!
//! All lengths are in sides of a block, some 200 metres. A plot holds twenty blocks of one kind in a staircase along its
//! diagonal, a [`STEP`] from block to block. The first ones open forwards, and the corner of the next stands in their notch; the
//! others open backwards, and the corner of the one before stands in theirs.
//!
//! Nothing touches: in a plot, walls are at least 0.031 apart, of which two blocks' own yaw takes at most 0.013; plots are 2.2
//! wide and [`PITCH`] apart, of which yaws take less than 0.07 on each side.

use super::turns::{self, QUARTERS, Turn, turned};
use super::{Assembly, prism, side_of};
use crate::random::SplitMix64;

/// Cells along a side of a block: arms are one of them thick, as streets are wide.
const CELLS: u32 = 32;
/// Cells along the shorter arm of the second kind.
const SHORT: u32 = 27;
/// Triangles of a wall from the ground to the roof: twice this many.
const ROWS: u32 = 3;

const BLOCKS_A_PLOT: u32 = 20;
/// From block to block on a staircase, in x and in z; an arm and a street.
const STEP: f32 = 0.0625;
/// From plot to plot.
const PITCH: f32 = 2.4;

/// Tangents of the largest small yaw of a block and of a plot.
const BLOCK_YAW: f32 = 0.012;
const PLOT_YAW: f32 = 0.05;

/// `count` blocks, plot by plot on a square, of random heights.
pub fn place(count: u32) -> Assembly {
    let even = prism::closed(CELLS, ROWS, |x, z| x == 0 || z == 0);
    let uneven = prism::closed(CELLS, ROWS, |x, z| x == 0 && z < SHORT || z == 0);
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
            let (middle, facing) = staircase(block, forwards);
            let turn_of_block = turned(turn, turned(facing, turns::small(&mut random, BLOCK_YAW)));
            let [dx, dz] = turned(turn, middle);
            let height = random.within(0.08, 0.2);
            let at = [corner[0] + dx, 0.0, corner[1] + dz];
            instances.push(turns::upright(part, [1.0, height, 1.0], turn_of_block, at));
        }
    }
    (vec![even, uneven], instances)
}

/// The middle of an L's box, seen from the middle of its plot, and which way it faces.
fn staircase(block: u32, forwards: u32) -> ([f32; 2], Turn) {
    let middle = (block as f32 - 0.5 * (BLOCKS_A_PLOT - 1) as f32) * STEP;
    ([middle; 2], if block < forwards { QUARTERS[0] } else { QUARTERS[2] })
}
