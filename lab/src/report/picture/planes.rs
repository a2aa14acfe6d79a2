//! Where the planes of a kd-tree cut the surfaces that are seen: how space was split, drawn on what it was split for.
//!
//! Between two neighbouring pixels of one surface there is a line where a plane divides their points: the plane of the deepest
//! cell that holds both. Its axis is its colour, its depth how faint it is.

use super::legend::{self, text};
use super::{PictureOptions, SMOOTH, Seen, averaged, decoded, smooth};
use crate::scene::Scene;
use crate::subjects::Subject;
use crate::{Error, Result};
use glam::Vec3;
use hedgerow::kdtree::layout::{KdContent, KdTree};
use hedgerow::trace::Hit;
use image::RgbImage;
use rayon::prelude::*;
use std::borrow::Cow;

/// Lines across x, y and z: three that the colour-blind tell apart, too (Okabe and Ito 2008).
const COLOURS: [[u8; 3]; 3] = [[0xD5, 0x5E, 0x00], [0x00, 0x9E, 0x73], [0x00, 0x72, 0xB2]];
/// Of the surface, what lines may cover unless told how deep to go: more of them hide what they show.
const COVERED: f32 = 0.2;
/// How much of a line's colour is left on the deepest level that is drawn.
const FAINTEST: f32 = 0.3;
/// Lines of this many levels, from the root's on, are [`WIDEST`].
const WIDE: u32 = 4;
/// How wide, in rays: two pixels.
const WIDEST: usize = 2 * SMOOTH as usize;

/// A plane of the tree, met between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Line {
    depth: u32,
    axis: usize,
}

impl Line {
    /// In rays: a pixel, or two.
    fn width(self) -> usize {
        if self.depth < WIDE { WIDEST } else { WIDEST / 2 }
    }
}

pub(super) fn planes(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    let Some(tree) = subject.kd_tree()?.map(Cow::into_owned) else { return Err(needs_kd_tree(subject.builder())) };
    let rays = smooth(options.size, options.seed);
    let seen = Seen::trace(scene, subject, &rays)?;
    let size = rays.size.map(|side| side as usize);
    let normals: Vec<Option<Vec3>> = seen.normals(scene).collect();
    let lines = lines(&tree, &seen, &normals, size);
    let deepest = options.top.map_or_else(|| deepest_of(&lines, &seen.hits), |top| top as u32);
    let colours = (0..lines.len()).into_par_iter().map(|i| {
        let Some(normal) = normals[i] else { return decoded(Vec3::splat(0.19)) };
        let grey = Vec3::splat(0.25 + 0.6 * normal.dot(-Vec3::from(seen.rays[i].direction).normalize_or(Vec3::Z)));
        let drawn = |line: &Line| line.depth <= deepest;
        let Some(line) = nearest(&lines, i, size).filter(drawn) else { return decoded(grey) };
        let opacity = 1.0 - (1.0 - FAINTEST) * line.depth as f32 / deepest.max(1) as f32;
        decoded(grey.lerp(Vec3::from(COLOURS[line.axis].map(|c| f32::from(c) / 255.0)), opacity))
    });
    let image = averaged(&colours.collect::<Vec<_>>(), options.size);
    let levels = if deepest == 0 { "level 0".into() } else { format!("levels 0 to {deepest}") };
    let words = format!("planes of {levels} (of {}) where they cut what is seen", tree.header.depth);
    legend::below(image, |width| svg(width, &words))
}

/// What is said where there are no planes.
pub(super) fn needs_kd_tree(builder: &str) -> Error {
    Error::Argument(format!(
        "{builder} builds no kd-tree, so there are no planes to see; choose kd-exact or kd-binned, or the view leaf-size"
    ))
}

/// For each pixel, the plane of the least depth between it and those that surround it.
fn lines(tree: &KdTree, seen: &Seen, normals: &[Option<Vec3>], [width, height]: [usize; 2]) -> Vec<Option<Line>> {
    let between = |i: usize, j: usize| {
        let (p, q) = (seen.point(i)?, seen.point(j)?);
        on_one_surface([p, q], [normals[i]?, normals[j]?], [seen.rays[i].direction, seen.rays[j].direction])
            .then(|| dividing(tree, p.to_array(), q.to_array()))?
    };
    (0..width * height)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let right = (x + 1 < width).then(|| between(i, i + 1)).flatten();
            let below = (y + 1 < height).then(|| between(i, i + width)).flatten();
            right.into_iter().chain(below).min()
        })
        .collect()
}

/// The line that is drawn where a ray ends: its own, or one that is wide enough to reach from beside it.
fn nearest(lines: &[Option<Line>], i: usize, [width, _]: [usize; 2]) -> Option<Line> {
    let (x, y) = (i % width, i / width);
    let reaching = |dx: usize, dy: usize| {
        let line = (dx <= x && dy <= y).then(|| lines[i - dx - dy * width]).flatten()?;
        (dx.max(dy) < line.width()).then_some(line)
    };
    (0..WIDEST).flat_map(|dy| (0..WIDEST).map(move |dx| (dx, dy))).filter_map(|(dx, dy)| reaching(dx, dy)).min()
}

/// Whether two neighbouring points are of one surface as far as can be told: one lies about where the tangent plane at the other
/// has it. Planes between a thing and what is behind it would be outlines.
fn on_one_surface([p, q]: [Vec3; 2], [at_p, at_q]: [Vec3; 2], [to_p, to_q]: [[f32; 3]; 2]) -> bool {
    // Where the ray through `to`, of a hit at `is`, meets the tangent plane at `at`.
    let expected = |at: Vec3, normal: Vec3, is: Vec3, to: [f32; 3]| {
        let to = Vec3::from(to);
        is + to * ((at - is).dot(normal) / to.dot(normal))
    };
    let is_near = |at: Vec3, normal: Vec3, is: Vec3, to: [f32; 3]| {
        let expected = expected(at, normal, is, to);
        expected.distance(is) <= expected.distance(at)
    };
    is_near(p, at_p, q, to_q) || is_near(q, at_q, p, to_p)
}

/// The plane that divides two points: that of the deepest cell which holds both. `None` where they are in one leaf.
fn dividing(tree: &KdTree, p: [f32; 3], q: [f32; 3]) -> Option<Line> {
    let mut node = (!tree.nodes.is_empty()).then_some(0);
    for depth in 0.. {
        let KdContent::Inner(inner) = tree.nodes[node? as usize].content() else { return None };
        let sides = [p, q].map(|point| usize::from(point[inner.axis] > inner.plane));
        if sides[0] != sides[1] {
            return Some(Line { depth, axis: inner.axis });
        }
        node = inner.children[sides[0]];
    }
    None
}

/// The deepest level whose lines, with those above, cover no more of the surface than [`COVERED`].
fn deepest_of(lines: &[Option<Line>], hits: &[Hit]) -> u32 {
    let surface = hits.iter().filter(|hit| hit.is_some()).count() as f32;
    let mut counts = Vec::new();
    for line in lines.iter().flatten() {
        let depth = line.depth as usize;
        counts.resize(counts.len().max(depth + 1), 0u32);
        counts[depth] += 1;
    }
    let sums = counts.iter().scan(0, |sum, &count| {
        *sum += count;
        Some(*sum)
    });
    (sums.take_while(|&sum| (sum * SMOOTH) as f32 <= COVERED * surface).count() as u32).saturating_sub(1)
}

fn svg(width: f32, words: &str) -> String {
    let swatches: String = COLOURS
        .iter()
        .zip(["x", "y", "z"])
        .enumerate()
        .map(|(i, ([r, g, b], axis))| {
            let x = 10.0 + 62.0 * i as f32;
            let swatch = format!("<rect x=\"{x}\" y=\"8\" width=\"22\" height=\"12\" fill=\"rgb({r},{g},{b})\"/>");
            swatch + &text((x + 27.0, 18.0), "start", axis)
        })
        .collect();
    let faint = text((width - 10.0, 18.0), "end", "the deeper, the fainter");
    swatches + &faint + &text((width / 2.0, 36.0), "middle", words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use hedgerow::kdtree::layout::{KdHeader, KdNode};

    #[test]
    fn two_points_are_divided_by_the_plane_of_the_last_cell_that_holds_both() {
        // A cube of edge 2, cut in the middle along x; its right half is cut again along y, where the lower part is empty.
        let header = KdHeader { lo: [0.0; 3], hi: [2.0; 3], ..KdHeader::zeroed() };
        let nodes = vec![
            KdNode::inner(0, 1.0, 1, [false, false]),
            KdNode::leaf(0, 1),
            KdNode::inner(1, 0.5, 3, [true, false]),
            KdNode::leaf(1, 1),
        ];
        let tree = KdTree { header, nodes, references: vec![0, 0], records: Vec::new(), geometries: Vec::new() };
        let divided = |p, q| dividing(&tree, p, q).map(|line| (line.depth, line.axis));
        assert_eq!(divided([0.5, 0.2, 1.0], [1.5, 0.2, 1.0]), Some((0, 0)));
        assert_eq!(divided([1.2, 0.2, 1.0], [1.5, 1.2, 1.0]), Some((1, 1)));
        assert_eq!(divided([0.2, 0.2, 1.0], [0.5, 1.2, 1.0]), None, "one leaf");
        assert_eq!(divided([1.2, 0.2, 1.0], [1.5, 0.3, 1.0]), None, "one empty leaf");
    }

    #[test]
    fn what_is_behind_an_edge_is_another_surface() {
        let forward = [[0.0, 0.0, -1.0], [0.01, 0.0, -1.0]];
        let towards = Vec3::Z;
        let wall = |z: f32| [Vec3::ZERO, Vec3::new(0.05 - 0.01 * z, 0.0, z)];
        assert!(on_one_surface(wall(0.0), [towards; 2], forward));
        assert!(!on_one_surface(wall(-3.0), [towards; 2], forward));
    }

    #[test]
    fn lines_go_as_deep_as_they_leave_the_surface_to_be_seen() {
        let hit = Hit { t: 1.0, primitive: 0, u: 0.0, v: 0.0 };
        let line = |depth| Some(Line { depth, axis: 0 });
        let lines = [line(0), line(1), line(3), line(3)];
        assert_eq!(deepest_of(&lines, &[hit; 20]), 2, "a fifth down to level 2, two fifths to level 3");
        assert_eq!(deepest_of(&[], &[]), 0);
    }
}
