//! Parallel locally-ordered clustering: clusters in the order of the codes, of which each looks for its nearest among those next to
//! it, and pairs that are each other's nearest merge, round after round.
//!
//! Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction"; Frantál 2019,
//! section 3.6. Ties, and the rounds in which merges are forced, are those of `hedgerow::bvh::twin::ploc`, and so are the trees; the
//! rounds are done by all threads, and a distance is computed once for both of its clusters.

use super::ALONE;
use super::bounds::{Bounds, Item};
use super::topology::{Merge, Topology};
use bytemuck::zeroed_vec;
use rayon::prelude::*;
use std::ops::Range;

/// Clusters that rounds may look at before merges are forced: this many per primitive, and a fixed number.
const LOOKS: [usize; 2] = [16, 1 << 17];
/// A round is slow if fewer than one in this many clusters merges.
const SLOW: usize = 16;

/// The tree over the primitives of `items`, which are in the order of their codes.
pub(super) fn build(items: &[Item], radius: usize) -> Topology {
    let count = items.len();
    let of_place = |(place, item): (usize, &Item)| Item::new(item.bounds(), place as u32, 1);
    let mut clusters: Vec<Item> = items.par_iter().enumerate().with_min_len(ALONE).map(of_place).collect();
    let mut next: Vec<Item> = zeroed_vec(count);
    let mut nearest = vec![0; count];
    let mut merges = vec![Merge::default(); count.saturating_sub(1)];
    let most_looks = LOOKS[0] * count + LOOKS[1];
    let (mut looks, mut is_forced, mut merged) = (0, false, 0);
    while clusters.len() > 1 {
        let before = clusters.len();
        nearest.truncate(before);
        find_nearest(&clusters, radius, &mut nearest);
        let round = Round { clusters: &clusters, nearest: &nearest, is_forced };
        let pairs = round.merge(&mut next, &mut merges, merged);
        merged += pairs;
        next.truncate(before - pairs);
        std::mem::swap(&mut clusters, &mut next);
        looks += before;
        is_forced = looks > most_looks && SLOW * pairs < before;
    }
    let root = clusters.first().map_or(0, Item::primitive);
    Topology::of_merges(count, &merges, root, |place| items[place as usize].primitive())
}

/// For each cluster, which of those at most `radius` places away is the nearest, and the first of several.
fn find_nearest(clusters: &[Item], radius: usize, nearest: &mut [u32]) {
    // What two neighbouring pieces look at both is a small part of either.
    let piece = ALONE.max(8 * radius);
    let of_piece = |(number, nearest): (usize, &mut [u32])| {
        let first = number * piece;
        let seen = first.saturating_sub(radius)..(first + nearest.len()).saturating_add(radius).min(clusters.len());
        let of_seen =
            nearest_of(&clusters[seen.clone()], radius, first - seen.start..nearest.len() + first - seen.start);
        for (to, place) in nearest.iter_mut().zip(of_seen) {
            *to = seen.start as u32 + place;
        }
    };
    nearest.par_chunks_mut(piece).enumerate().for_each(of_piece);
}

/// The nearest ones of those in `wanted`.
fn nearest_of(clusters: &[Item], radius: usize, wanted: Range<usize>) -> impl Iterator<Item = u32> {
    let mut least = vec![(f32::INFINITY, 0); clusters.len()];
    for (i, cluster) in clusters.iter().enumerate().take(wanted.end) {
        let bounds = cluster.bounds();
        let others = (i + 1).max(wanted.start)..(i + radius).saturating_add(1).min(clusters.len());
        let mut of_this = least[i];
        for j in others {
            let distance = bounds.union(clusters[j].bounds()).distance_area();
            // Each sees those before it first, and all in their order: of equal ones the first stays.
            if distance < of_this.0 {
                of_this = (distance, j as u32);
            }
            if distance < least[j].0 {
                least[j] = (distance, i as u32);
            }
        }
        least[i] = of_this;
    }
    least.truncate(wanted.end);
    least.into_iter().skip(wanted.start).map(|(_, place)| place)
}

/// A round, once the nearest are known.
struct Round<'a> {
    clusters: &'a [Item],
    nearest: &'a [u32],
    is_forced: bool,
}

impl Round<'_> {
    /// With which a cluster merges.
    #[inline]
    fn partner(&self, i: usize) -> Option<usize> {
        let in_pair = |i: usize| self.nearest[self.nearest[i] as usize] as usize == i;
        match i ^ 1 {
            _ if in_pair(i) => Some(self.nearest[i] as usize),
            other if self.is_forced && other < self.clusters.len() && !in_pair(other) => Some(other),
            _ => None,
        }
    }

    /// Puts what is left into `next`, in order, and the merges behind the first `merged`. How many those are.
    fn merge(&self, next: &mut [Item], merges: &mut [Merge], merged: usize) -> usize {
        let count = self.clusters.len();
        let pieces = || (0..count.div_ceil(ALONE)).map(|piece| piece * ALONE..((piece + 1) * ALONE).min(count));
        let is_merged = |i: usize| self.partner(i).is_some_and(|j| j < i);
        let pieces: Vec<Range<usize>> = pieces().collect();
        let lost: Vec<usize> = pieces.par_iter().map(|piece| piece.clone().filter(|&i| is_merged(i)).count()).collect();
        let begins = |piece: &Range<usize>| piece.clone().filter(|&i| self.partner(i).is_some_and(|j| j > i)).count();
        let pairs: Vec<usize> = pieces.par_iter().map(begins).collect();
        let mut work = Vec::with_capacity(pieces.len());
        let (mut next, mut merges, mut number) = (next, &mut merges[merged..], merged);
        for ((piece, lost), pairs) in pieces.into_iter().zip(lost).zip(pairs) {
            let (of_next, rest) = next.split_at_mut(piece.len() - lost);
            let (of_merges, others) = merges.split_at_mut(pairs);
            work.push((piece, of_next, of_merges, number));
            (next, merges, number) = (rest, others, number + pairs);
        }
        work.into_par_iter().for_each(|(piece, next, merges, number)| {
            let (mut next, mut merges) = (next.iter_mut(), merges.iter_mut().zip(number as u32..));
            for i in piece {
                let cluster = self.clusters[i];
                let left = match self.partner(i) {
                    None => cluster,
                    Some(j) if i < j => {
                        let right = &self.clusters[j];
                        let (merge, number) = merges.next().expect("counted");
                        let left_count = cluster.weight();
                        *merge = Merge { left: cluster.primitive(), right: right.primitive(), left_count };
                        let bounds: Bounds = cluster.bounds().union(right.bounds());
                        Item::new(bounds, number, left_count + right.weight())
                    }
                    Some(_) => continue,
                };
                *next.next().expect("counted") = left;
            }
        });
        number - merged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::input::Input;
    use crate::bvh::order;
    use hedgerow::bvh::codes::Code;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::bvh::twin::{lbvh, ploc};
    use hedgerow::geometry::Aabb;

    #[test]
    fn trees_are_those_of_the_twin() {
        let at = |i: u32, step: u32| (i.wrapping_mul(step) >> 8) as f32 / (1 << 24) as f32;
        let codes = Code::Emc64Var.full();
        for (count, radius, spread) in [
            (0, 1, 1.0),
            (1, 9, 1.0),
            (2, 1, 1.0),
            (3000, 1, 1.0),
            (10_000, 25, 1.0),
            (2000, 5000, 1.0),
            (9000, 16, 0.0),
        ] {
            let boxes: Vec<Aabb> = (0..count)
                .map(|i| {
                    let lo = [at(i, 2_654_435_761), at(i, 805_459_861), at(i, 3_674_653_429)].map(|x| x * spread);
                    Aabb { lo, hi: lo.map(|x| x + 0.1 * at(i, 97_654_321)) }
                })
                .collect();
            let mut input = Input::new(boxes.len(), |i| Ok(Bounds::of(&boxes[i as usize])));
            order::sort(&mut input, codes);
            let twin = ploc::build(&lbvh::build_aabbs(&boxes, codes, Collapse::OFF), radius);
            assert!(build(&input.items, radius) == Topology::of_tree(&twin), "{count}, {radius}, {spread}");
        }
    }
}
