//! Sets of clusters, one behind the other, with the distances of all pairs within each.
//!
//! A set of m clusters has m (m − 1) / 2 distances, row by row: those of cluster 0 and 1, of 0 and 2, of 1 and 2, and so on. So the
//! matrix of the union of two sets begins with that of the first, and has room for the distances between them once the rows of
//! the second are moved apart (Frantál 2019, section 3.2.2 and figure 12).

use super::super::bounds::{Bounds, Item};
use super::super::topology::Merge;

/// Up to so many clusters, all distances are looked at for the least one; with more, the least of each row is kept.
const FEW: usize = 8;

/// Where the row of cluster `i` begins: the distances to those before it.
#[inline(always)]
fn row(i: usize) -> usize {
    i * i.saturating_sub(1) / 2
}

/// Sets of clusters. The items' primitives are representatives.
#[derive(Default)]
pub(super) struct ClusterStack {
    clusters: Vec<Item>,
    /// The first `used` are distances, in the order of the sets; what is behind is room.
    distances: Vec<f32>,
    used: usize,
    least: Vec<Least>,
}

/// The nearest of those before a cluster.
#[derive(Debug, Clone, Copy)]
struct Least {
    distance: f32,
    at: u32,
}

impl ClusterStack {
    /// A set of single primitives, whose places begin with `first`.
    #[inline]
    pub fn push_primitives(&mut self, items: &[Item], first: u32) {
        let base = self.clusters.len();
        self.clusters.extend((first..).zip(items).map(|(place, item)| Item::new(item.bounds(), place, 1)));
        let from = self.used;
        self.take_room(row(items.len()));
        let clusters = &self.clusters[base..];
        let distances = &mut self.distances[from..];
        for (i, cluster) in clusters.iter().enumerate() {
            let bounds = cluster.bounds();
            for (to, other) in distances[row(i)..].iter_mut().zip(&clusters[..i]) {
                *to = distance(bounds, other);
            }
        }
    }

    /// The sets of another stack.
    pub fn push_stack(&mut self, other: &ClusterStack) {
        self.clusters.extend_from_slice(&other.clusters);
        let from = self.used;
        self.take_room(other.used);
        self.distances[from..self.used].copy_from_slice(&other.distances[..other.used]);
    }

    /// Makes one set of the last two, which have these many clusters. How many it has.
    #[inline]
    pub fn unite(&mut self, [left, right]: [usize; 2]) -> usize {
        let together = left + right;
        let base = self.used - row(left) - row(right);
        self.take_room(left * right);
        let distances = &mut self.distances[base..self.used];
        let (left_clusters, right_clusters) = self.clusters[self.clusters.len() - together..].split_at(left);
        // From the last: a row moves to where only rows behind it have been.
        for (i, cluster) in right_clusters.iter().enumerate().rev() {
            let from = row(left) + row(i);
            let to = row(left + i);
            distances.copy_within(from..from + i, to + left);
            let bounds = cluster.bounds();
            for (to, cluster) in distances[to..to + left].iter_mut().zip(left_clusters) {
                *to = distance(bounds, cluster);
            }
        }
        together
    }

    /// Merges pairs of the last set, which has `count` clusters, nearest ones first, until at most `most` are left. How many
    /// there are then. `merges` are those of the set's primitives, which begin with `first`.
    #[inline]
    pub fn merge_down(&mut self, count: usize, most: usize, merges: &mut [Merge], first: u32) -> usize {
        if count <= most {
            return count;
        }
        let base = self.clusters.len() - count;
        let clusters = &mut self.clusters[base..];
        let distances = &mut self.distances[self.used - row(count)..self.used];
        let mut set = ClusterSet { clusters, distances, count };
        if count > FEW {
            set.merge_down_by_rows(most.max(FEW), merges, first, &mut self.least);
        }
        while set.count > most {
            let pair = set.least_pair();
            set.merge(pair, merges, first);
        }
        let left = set.count;
        self.clusters.truncate(base + left);
        self.used -= row(count) - row(left);
        left
    }

    #[inline]
    fn take_room(&mut self, more: usize) {
        self.used += more;
        if self.distances.len() < self.used {
            self.distances.resize(self.used.max(2 * self.distances.len()).max(256), 0.0);
        }
    }
}

#[inline(always)]
fn distance(bounds: Bounds, cluster: &Item) -> f32 {
    bounds.union(cluster.bounds()).distance_area()
}

/// The last set.
struct ClusterSet<'a> {
    clusters: &'a mut [Item],
    distances: &'a mut [f32],
    count: usize,
}

impl ClusterSet<'_> {
    /// Whether of two pairs at the same distance the first one merges first.
    #[cold]
    fn is_before(&self, a: [usize; 2], b: [usize; 2]) -> bool {
        let key = |pair: [usize; 2]| {
            let [a, b] = pair.map(|i| &self.clusters[i]);
            let (left, right) = (a.primitive().min(b.primitive()), a.primitive().max(b.primitive()));
            (a.weight() + b.weight(), left, right)
        };
        key(a) < key(b)
    }

    /// The pair that merges next, the cluster that comes first in the set first.
    #[inline]
    fn least_pair(&self) -> [usize; 2] {
        let (mut least, mut pair) = (f32::INFINITY, [0, 1]);
        for i in 1..self.count {
            for (k, &distance) in self.distances[row(i)..row(i) + i].iter().enumerate() {
                if distance < least || (distance == least && self.is_before([k, i], pair)) {
                    (least, pair) = (distance, [k, i]);
                }
            }
        }
        pair
    }

    /// Merges two clusters of the set, of which the first comes before the second: the new one takes the place of the first, the
    /// last one that of the second.
    #[inline]
    fn merge(&mut self, [k, i]: [usize; 2], merges: &mut [Merge], first: u32) {
        let (a, b) = (self.clusters[k], self.clusters[i]);
        let (left, right) = if a.primitive() < b.primitive() { (a, b) } else { (b, a) };
        Merge::record(merges, [left.primitive(), right.primitive()], left.weight(), first);
        let bounds = a.bounds().union(b.bounds());
        let last = self.count - 1;
        if i != last {
            self.clusters[i] = self.clusters[last];
            let (rows, last_row) = self.distances.split_at_mut(row(last));
            rows[row(i)..row(i) + i].copy_from_slice(&last_row[..i]);
            for r in i + 1..last {
                rows[row(r) + i] = last_row[r];
            }
        }
        self.count = last;
        self.clusters[k] = Item::new(bounds, left.primitive(), left.weight() + right.weight());
        let (before, behind) = self.clusters[..last].split_at(k);
        for (to, cluster) in self.distances[row(k)..].iter_mut().zip(before) {
            *to = distance(bounds, cluster);
        }
        for (r, cluster) in behind.iter().enumerate().skip(1) {
            self.distances[row(k + r) + k] = distance(bounds, cluster);
        }
    }

    /// The nearest of those before cluster `i`, which is not the first.
    #[inline]
    fn least_of_row(&self, i: usize) -> Least {
        let mut least = Least { distance: f32::INFINITY, at: 0 };
        for (k, &distance) in self.distances[row(i)..row(i) + i].iter().enumerate() {
            if distance < least.distance
                || (distance == least.distance && self.is_before([k, i], [least.at as usize, i]))
            {
                least = Least { distance, at: k as u32 };
            }
        }
        least
    }

    /// Merges pairs until at most `most` are left. The least distance of each row is known: a new cluster is farther from all
    /// others than what it was made of, so that only rows whose nearest has merged have to be looked through again.
    fn merge_down_by_rows(&mut self, most: usize, merges: &mut [Merge], first: u32, rows: &mut Vec<Least>) {
        rows.clear();
        rows.push(Least { distance: f32::INFINITY, at: 0 });
        rows.extend((1..self.count).map(|i| self.least_of_row(i)));
        while self.count > most {
            let [k, i] = self.least_pair_of_rows(&rows[..self.count]);
            self.merge([k, i], merges, first);
            let last = self.count;
            let is_stale = |least: Least| least.at as usize == k || least.at as usize == i;
            if k > 0 {
                rows[k] = self.least_of_row(k);
            }
            for (r, least) in rows.iter_mut().enumerate().take(i).skip(k + 1) {
                if least.at as usize == k {
                    *least = self.least_of_row(r);
                }
            }
            if i == last {
                continue;
            }
            let moved = rows[last];
            rows[i] = if is_stale(moved) || moved.at as usize > i { self.least_of_row(i) } else { moved };
            for (r, of_row) in rows.iter_mut().enumerate().take(last).skip(i + 1) {
                let least = *of_row;
                let distance = self.distances[row(r) + i];
                if is_stale(least) {
                    *of_row = self.least_of_row(r);
                } else if distance < least.distance
                    || (distance == least.distance && self.is_before([i, r], [least.at as usize, r]))
                {
                    *of_row = Least { distance, at: i as u32 };
                }
            }
        }
    }

    /// The pair that merges next, by the nearest of each row.
    #[inline]
    fn least_pair_of_rows(&self, rows: &[Least]) -> [usize; 2] {
        let mut best = 1;
        for (i, least) in rows.iter().enumerate().skip(2) {
            let distance = rows[best].distance;
            if least.distance < distance
                || (least.distance == distance
                    && self.is_before([least.at as usize, i], [rows[best].at as usize, best]))
            {
                best = i;
            }
        }
        [rows[best].at as usize, best]
    }
}
