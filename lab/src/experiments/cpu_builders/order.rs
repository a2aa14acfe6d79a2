//! Whether a cost orders the times that rays take: of pairs of builders, how many it orders rightly, and the rank correlation.

use crate::measure::correlation::{pearson, ranks};

/// Times that differ by less are taken for one time measured twice.
pub const SAME_TIME: f64 = 0.02;

/// How well a cost orders times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ordering {
    /// Pairs whose times and costs differ.
    pub pairs: usize,
    /// Those where less cost is less time.
    pub right: usize,
    /// Spearman's rank correlation: 1 where the orders are one, 0 where they have nothing to do with each other. `None` where all
    /// costs or all times are one.
    pub rank: Option<f64>,
}

impl Ordering {
    /// The share of pairs that are ordered rightly.
    pub fn share(&self) -> Option<f64> {
        (self.pairs > 0).then(|| self.right as f64 / self.pairs as f64)
    }
}

/// How well costs order times, one of each a builder. `None` of fewer than two builders.
pub fn ordering(costs: &[f64], times: &[f64]) -> Option<Ordering> {
    if costs.len() < 2 || costs.len() != times.len() {
        return None;
    }
    let (mut pairs, mut right) = (0, 0);
    for i in 0..costs.len() {
        for j in 0..i {
            if costs[i] != costs[j] && differ(times[i], times[j]) {
                pairs += 1;
                right += usize::from((costs[i] < costs[j]) == (times[i] < times[j]));
            }
        }
    }
    Some(Ordering { pairs, right, rank: pearson(&ranks(costs), &ranks(times)) })
}

fn differ(a: f64, b: f64) -> bool {
    (a - b).abs() > SAME_TIME * a.min(b)
}

/// The pair where cost and time are furthest apart: the one that costs less, and the other, which takes less. `None` where every
/// pair is ordered rightly.
pub fn furthest_off(costs: &[f64], times: &[f64]) -> Option<(usize, usize)> {
    let mut worst = None;
    for i in 0..costs.len() {
        for j in 0..costs.len() {
            if costs[i] < costs[j] && times[i] > times[j] && differ(times[i], times[j]) {
                // Both must be clear: a large error of one with none of the other is chance.
                let off = (costs[j] / costs[i]).ln().min((times[i] / times[j]).ln());
                if worst.is_none_or(|(most, _)| off > most) {
                    worst = Some((off, (i, j)));
                }
            }
        }
    }
    worst.map(|(_, pair)| pair)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_counted_by_hand() {
        // Of the six pairs only (30, 40) is in the wrong order: its times are 4 and 3.
        let found = ordering(&[10.0, 20.0, 30.0, 40.0], &[1.0, 2.0, 4.0, 3.0]).expect("four");
        assert_eq!((found.pairs, found.right), (6, 5));
        // Spearman: 1 − 6·(1 + 1)/(4·15) = 0.8.
        assert!((found.rank.expect("both vary") - 0.8).abs() < 1e-12, "{found:?}");
        assert!((found.share().expect("six pairs") - 5.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn the_reverse_order_is_minus_one_and_one_value_is_none() {
        let reverse = ordering(&[1.0, 2.0, 3.0], &[9.0, 6.0, 3.0]).expect("three");
        assert_eq!((reverse.right, reverse.rank), (0, Some(-1.0)));
        let flat = ordering(&[1.0, 1.0, 1.0], &[9.0, 6.0, 3.0]).expect("three");
        assert_eq!((flat.pairs, flat.rank, flat.share()), (0, None, None));
        assert_eq!(ordering(&[1.0], &[1.0]), None);
    }

    #[test]
    fn near_times_are_no_pair() {
        // 100 and 101 differ by less than two percent: two pairs are left.
        let found = ordering(&[3.0, 2.0, 1.0], &[100.0, 101.0, 50.0]).expect("three");
        assert_eq!((found.pairs, found.right), (2, 2));
    }

    #[test]
    fn the_worst_pair_is_clear_in_both() {
        // 0 costs 20% less than 1 and takes 30% longer; 2 costs 1% less than 3 and takes twice as long.
        let costs = [100.0, 120.0, 200.0, 202.0];
        let times = [1.3, 1.0, 10.0, 5.0];
        assert_eq!(furthest_off(&costs, &times), Some((0, 1)));
        assert_eq!(furthest_off(&[1.0, 2.0], &[1.0, 2.0]), None);
    }
}
