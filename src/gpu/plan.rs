//! Memory as a plan: parts by name, each in use from one phase to another. Parts that are never in use at once share bytes.

use std::ops::RangeInclusive;

/// A part of the memory.
#[derive(Debug, Clone)]
pub(crate) struct PlannedPart<P> {
    #[cfg_attr(not(test), expect(dead_code, reason = "tests say which parts share bytes"))]
    name: &'static str,
    life: RangeInclusive<P>,
    at: u64,
    bytes: u64,
}

impl<P: Ord> PlannedPart<P> {
    /// Whether there is a phase in which both are in use.
    fn lives_with(&self, life: &RangeInclusive<P>) -> bool {
        self.life.start() <= life.end() && life.start() <= self.life.end()
    }

    fn end(&self) -> u64 {
        self.at + self.bytes
    }
}

/// Parts of some memory and where they lie. `P` are the phases, in order.
#[derive(Debug, Clone)]
pub(crate) struct Plan<P> {
    parts: Vec<PlannedPart<P>>,
}

impl<P: Copy + Ord + std::fmt::Debug> Plan<P> {
    /// What places count in, and what every part is aligned to: bytes.
    pub const UNIT: u64 = 16;

    pub fn new() -> Plan<P> {
        Plan { parts: Vec::new() }
    }

    /// Takes a part that is in use in the phases `life`, and returns its place in [`Plan::UNIT`]s: behind all that were taken
    /// before and are in use with it. So no part moves up when another shrinks, and what suffices for a plan suffices for every
    /// plan of smaller parts.
    ///
    /// No part is empty: some drivers load what is at the same address for all lanes even where no lane is active.
    pub fn take(&mut self, name: &'static str, bytes: u64, life: RangeInclusive<P>) -> u32 {
        let with = self.parts.iter().filter(|part| part.lives_with(&life));
        let at = with.map(PlannedPart::end).max().unwrap_or(0);
        self.parts.push(PlannedPart { name, life, at, bytes: bytes.max(1).next_multiple_of(Self::UNIT) });
        u32::try_from(at / Self::UNIT).expect("memory has less than 64 GiB")
    }

    /// Bytes of all of it.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().map(PlannedPart::end).max().unwrap_or(0)
    }

    /// Bytes that are in use in the phase that uses most: what no plan is smaller than.
    #[cfg(test)]
    pub fn most_in_use(&self) -> u64 {
        let in_use =
            |phase: &P| self.parts.iter().filter(|part| part.life.contains(phase)).map(|part| part.bytes).sum();
        self.parts.iter().map(|part| in_use(part.life.start())).max().unwrap_or(0)
    }

    /// # Panics
    /// Two parts that are in use at once share bytes.
    #[cfg(test)]
    pub fn assert_nothing_in_use_is_shared(&self) {
        for (i, one) in self.parts.iter().enumerate() {
            for other in &self.parts[..i] {
                let overlap = one.at < other.end() && other.at < one.end();
                assert!(!overlap || !one.lives_with(&other.life), "{one:?} and {other:?}");
                assert_ne!(one.name, other.name, "a name has one part");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_share_bytes_unless_they_live_at_once() {
        let mut plan = Plan::new();
        let taken = [
            plan.take("all the time", 20, 0..=3),
            plan.take("first", 100, 0..=1),
            plan.take("last", 40, 2..=3),
            plan.take("from the middle", 16, 1..=2),
            plan.take("nothing", 0, 3..=3),
        ];
        // In units of 16 bytes: 2 of the first, then 7 of "first" and 3 of "last" at one place.
        assert_eq!(taken, [0, 2, 2, 9, 5]);
        assert_eq!(plan.bytes(), 10 * 16);
        assert_eq!(plan.most_in_use(), 10 * 16);
        plan.assert_nothing_in_use_is_shared();
    }
}
