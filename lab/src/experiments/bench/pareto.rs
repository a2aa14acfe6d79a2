//! Which builders no other beats at both: the Pareto frontier of build speed and trace speed.

/// Indices of the points on the frontier where more is better on both axes, from the least x to the greatest.
///
/// A point is on it if no other is at least as good in both and better in one.
pub fn frontier(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[b].0.total_cmp(&points[a].0).then(points[b].1.total_cmp(&points[a].1)));
    let mut frontier: Vec<usize> = Vec::new();
    for i in order {
        let equal = |&f: &usize| points[f] == points[i];
        if frontier.last().is_none_or(|&best| points[i].1 > points[best].1 || equal(&best)) {
            frontier.push(i);
        }
    }
    frontier.reverse();
    frontier
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dominated_points_are_left_out() {
        //  y
        //  3 | 0           0, 1 and 2 trade x for y; 3 is worse than 1, 4 ties with 2 in x and loses in y
        //  2 |   3 1
        //  1 |       2
        //      1 2 3 4  x
        let points = [(1.0, 3.0), (3.0, 2.0), (4.0, 1.0), (2.0, 2.0), (4.0, 0.5)];
        assert_eq!(frontier(&points), [0, 1, 2]);
    }

    #[test]
    fn equal_points_are_both_on_it() {
        let mut both = frontier(&[(1.0, 1.0), (1.0, 1.0)]);
        both.sort_unstable();
        assert_eq!(both, [0, 1]);
        assert!(frontier(&[]).is_empty());
    }

    #[test]
    fn for_costs_negate_them() {
        // Build speed against SAH cost, where less is better.
        assert_eq!(frontier(&[(10.0, -80.0), (20.0, -90.0), (5.0, -85.0)]), [0, 1]);
    }
}
