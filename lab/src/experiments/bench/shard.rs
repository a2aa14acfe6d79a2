//! A share of a sweep: which scenes one of several machines or processes measures.

use std::str::FromStr;

/// The `index`-th of `count` shares, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1 to `count`.
    pub index: u32,
    /// How many there are.
    pub count: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let wrong = || format!("{text:?} is not a share; write I/N, I from 1 to N, as in 3/16");
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let [index, count] = [index, count].map(|number| number.trim().parse::<u32>());
        match (index, count) {
            (Ok(index), Ok(count)) if (1..=count).contains(&index) => Ok(Shard { index, count }),
            _ => Err(wrong()),
        }
    }
}

impl Shard {
    /// The places of its items among all, ascending, given what each costs, in any unit. The largest item goes first, each to the
    /// share that has least: every item is in exactly one share, the same on every machine.
    pub fn of(self, costs: &[u64]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..costs.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(costs[i]), i));
        // Cost and number of items of each share.
        let mut shares = vec![(0u64, 0usize); self.count as usize];
        let mut own = Vec::new();
        for i in order {
            let least = (0..shares.len()).min_by_key(|&s| shares[s]).expect("there is a share");
            shares[least].0 += costs[i];
            shares[least].1 += 1;
            if least + 1 == self.index as usize {
                own.push(i);
            }
        }
        own.sort_unstable();
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_in_exactly_one_share_and_shares_are_about_equal() {
        let costs: Vec<u64> = (0..37).map(|i| i * i % 23).collect();
        for count in [1, 2, 5, 36, 37, 50] {
            let shares: Vec<Vec<usize>> = (1..=count).map(|index| Shard { index, count }.of(&costs)).collect();
            let mut all: Vec<usize> = shares.concat();
            all.sort_unstable();
            assert_eq!(all, (0..37).collect::<Vec<_>>(), "{count} shares");
            let sums: Vec<u64> = shares.iter().map(|share| share.iter().map(|&i| costs[i]).sum()).collect();
            let (least, most) = (sums.iter().min().expect("a share"), sums.iter().max().expect("a share"));
            assert!(most - least <= 22, "{sums:?}");
        }
    }

    #[test]
    fn what_is_no_share_is_refused() {
        assert_eq!("3/16".parse(), Ok(Shard { index: 3, count: 16 }));
        for text in ["", "3", "0/4", "5/4", "1/0", "a/b", "-1/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
