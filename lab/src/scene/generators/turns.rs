//! Turns about the y axis, and where an instance stands, upright or leaning.
//!
//! A turn is a pair [c, s] of unit length, the cosine and sine of its angle: the composition of two is a product of complex
//! numbers, and a random one needs no platform's sine.

use crate::random::SplitMix64;
use crate::scene::SceneInstance;

/// Cosine and sine.
pub type Turn = [f32; 2];

/// The turns by 0, 90, 180 and 270 degrees.
pub const QUARTERS: [Turn; 4] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];

/// Uniform: drawn from the disk by rejection.
pub fn any(random: &mut SplitMix64) -> Turn {
    loop {
        let [x, y] = [random.within(-1.0, 1.0), random.within(-1.0, 1.0)];
        if (0.01..=1.0).contains(&(x * x + y * y)) {
            return towards([x, y]);
        }
    }
}

/// A small one, by an angle whose tangent is uniform within ±`tangent`.
pub fn small(random: &mut SplitMix64, tangent: f32) -> Turn {
    towards([1.0, random.within(-tangent, tangent)])
}

/// The turn that takes the x axis to a direction.
pub fn towards([x, y]: [f32; 2]) -> Turn {
    let length = (x * x + y * y).sqrt();
    [x / length, y / length]
}

/// One turn after another. Also: a point of the plane (x, z), turned.
pub fn turned(turn: Turn, [x, y]: [f32; 2]) -> [f32; 2] {
    [turn[0] * x - turn[1] * y, turn[1] * x + turn[0] * y]
}

/// An upright instance: the part scaled along its axes, turned, and moved to `at`. The turn takes x towards z.
pub fn upright(part: usize, scale: [f32; 3], [c, s]: Turn, at: [f32; 3]) -> SceneInstance {
    let transform = [
        [c * scale[0], 0.0, -s * scale[2], at[0]],
        [0.0, scale[1], 0.0, at[1]],
        [s * scale[0], 0.0, c * scale[2], at[2]],
    ];
    SceneInstance { part: part as u32, transform }
}

/// An instance that leans: the part scaled, spun about its y axis, tilted by the turn `lean` from y towards x, and that way
/// turned to `heading`; its origin at `at`.
pub fn leaning(part: usize, scale: f32, spin: Turn, lean: Turn, heading: Turn, at: [f32; 3]) -> SceneInstance {
    let ([sc, ss], [lc, ls], [hc, hs]) = (spin, lean, heading);
    // Where spin and lean take each axis; the heading turns all of them.
    let columns = [[lc * sc, -ls * sc, ss], [ls, lc, 0.0], [-lc * ss, ls * ss, sc]].map(|[x, y, z]| {
        let [x, z] = turned([hc, hs], [x, z]);
        [x, y, z]
    });
    let row = |i: usize| [scale * columns[0][i], scale * columns[1][i], scale * columns[2][i], at[i]];
    SceneInstance { part: part as u32, transform: [row(0), row(1), row(2)] }
}
