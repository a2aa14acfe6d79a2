//! When a rebuild pays: a rule over work and prices alone, without clocks or trees.
//!
//! The geometry stands, so costs by surface area say nothing of a tree that grows stale. What does is the work of a sample of the
//! frame's rays, over the work of the same rays through a plain tree that was built once: how hard a view is cancels out. That ratio in
//! the first frame of a tree is what a fresh tree has; what it is above that, later, is what a rebuild would win.
//!
//! A rebuild has two reasons:
//! - *Ageing.* A tree has lived T frames and has lost Σ by them. If the next T frames go as these did, a rebuild loses Σ again and costs
//!   its price, and the present tree loses what it loses now in each of them: rebuild where `T · now > price + Σ`. Where losses grow
//!   evenly, that is the period of least cost. Where they jump at once and stay, it rebuilds in every frame or in none.
//!   A tree of one frame has shown nothing yet: there counts what the tree before it lost at that age.
//! - *Surprise.* What a tree loses beyond what trees before it lost at its age goes into a purse, and when the purse holds the price twice,
//!   a rebuild is bought (as skis are after renting them). Without this, a loss that comes early and stays would be borne for ever. Twice,
//!   as the price is sure and what is won is not: flights end, and the loss may be the view's.

/// Prices of a build that must have been lost by surprise before one is bought.
const SURPRISE: f64 = 2.0;

/// What the sample of a frame says, once the frame is traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed {
    /// Work of the tree over that of the plain tree, by the same rays.
    pub ratio: f64,
    /// Milliseconds that all rays of the frame would take through the plain tree.
    pub plain_ms: f64,
}

/// What is remembered of trees.
#[derive(Debug, Clone, Default)]
pub struct GainRule {
    /// The ratio of the present tree in its first frame.
    fresh: Option<f64>,
    /// By how much the ratio was above that, by age in frames: of the present tree.
    losses: Vec<f64>,
    /// The same of trees before it, each age by the latest that lived to it.
    known: Vec<f64>,
    /// Milliseconds that the present tree has lost.
    lost_ms: f64,
    /// Milliseconds of that which trees before it did not lose.
    purse_ms: f64,
    /// What a ratio of 1 takes, in the last frame.
    plain_ms: f64,
}

impl GainRule {
    /// Takes what a frame says of the present tree.
    pub fn observe(&mut self, observed: &Observed) {
        let Observed { ratio, plain_ms } = *observed;
        let loss = ratio - *self.fresh.get_or_insert(ratio);
        let expected = self.expected(self.losses.len());
        self.losses.push(loss);
        self.plain_ms = plain_ms;
        self.lost_ms += loss * plain_ms;
        self.purse_ms = (self.purse_ms + (loss - expected) * plain_ms).max(0.0);
    }

    /// Whether it has seen no frame of any tree.
    pub fn is_new(&self) -> bool {
        self.fresh.is_none() && self.known.is_empty()
    }

    /// Whether the next frame shall have another tree, which takes `build_ms`.
    pub fn rebuilds(&self, build_ms: f64) -> bool {
        let Some(last) = self.losses.last() else { return false };
        let lived = self.losses.len();
        let next = if lived == 1 { last.max(self.expected(1)) } else { *last };
        lived as f64 * next * self.plain_ms > build_ms + self.lost_ms || self.purse_ms > SURPRISE * build_ms
    }

    /// Another tree stands from here on.
    pub fn rebuilt(&mut self) {
        let lived = self.losses.len().min(self.known.len());
        self.losses.extend(self.known.drain(lived..));
        self.known = std::mem::take(&mut self.losses);
        (self.fresh, self.lost_ms, self.purse_ms) = (None, 0.0, 0.0);
    }

    /// What trees before this one lost at an age; of ages that none lived to, what they lost last.
    fn expected(&self, age: usize) -> f64 {
        self.known.get(age).or(self.known.last()).copied().unwrap_or(0.0).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame takes a hundred milliseconds through the plain tree.
    const PLAIN_MS: f64 = 100.0;

    /// Flies by the rule: the frames of rebuilds, where the ratio is that of a frame and of the frame in which the tree was built.
    fn rebuilds(frames: usize, build_ms: f64, ratio: impl Fn(usize, usize) -> f64) -> Vec<usize> {
        let (mut rule, mut built_at, mut all) = (GainRule::default(), 0, Vec::new());
        for frame in 0..frames {
            if rule.rebuilds(build_ms) {
                rule.rebuilt();
                built_at = frame;
                all.push(frame);
            }
            rule.observe(&Observed { ratio: ratio(frame, built_at), plain_ms: PLAIN_MS });
        }
        all
    }

    /// What the flight takes with trees built in these frames beside the first.
    fn total_ms(frames: usize, build_ms: f64, all: &[usize], ratio: impl Fn(usize, usize) -> f64) -> f64 {
        let built_at = |frame: usize| all.iter().copied().filter(|&built| built <= frame).max().unwrap_or(0);
        let traced: f64 = (0..frames).map(|frame| ratio(frame, built_at(frame)) * PLAIN_MS).sum();
        traced + build_ms * (1 + all.len()) as f64
    }

    #[test]
    fn a_tree_that_does_not_grow_stale_is_kept_whatever_a_build_takes() {
        assert!(rebuilds(1000, 0.0, |_, _| 0.8).is_empty());
        // Views of all kinds, equally hard for all trees.
        assert!(rebuilds(1000, 1.0, |_, _| 1.0).is_empty());
    }

    #[test]
    fn even_ageing_is_ended_by_the_period_of_least_cost() {
        // A hundredth a frame is a millisecond more in each: over T frames T²/2 of them, and a build.
        let ageing = |frame: usize, built: usize| 0.7 + 0.01 * (frame - built) as f64;
        for build_ms in [2.0, 8.0, 50.0, 200.0] {
            let all = rebuilds(300, build_ms, ageing);
            let best = (2.0 * build_ms).sqrt();
            for pair in all.windows(2) {
                let period = (pair[1] - pair[0]) as f64;
                assert!((period - best).abs() <= 1.5, "{build_ms} ms: {period} frames, best {best}");
            }
            assert!(all.len() > 10, "{all:?}");
        }
    }

    #[test]
    fn where_only_the_very_frame_helps_it_rebuilds_in_all_frames_or_hardly_ever() {
        let at_once = |frame: usize, built: usize| if frame == built { 0.7 } else { 0.8 };
        // Ten milliseconds are lost a frame.
        let cheap = rebuilds(100, 5.0, at_once);
        assert_eq!(cheap[1..], (cheap[0] + 1..100).collect::<Vec<_>>());
        assert!(cheap[0] <= 2);
        let dear = rebuilds(1000, 200.0, at_once);
        assert!(dear.len() <= 1, "once, to find out: {dear:?}");
    }

    #[test]
    fn a_loss_that_comes_late_and_stays_is_ended_once() {
        // Through a door in frame 50: trees from before it are poor behind it.
        let door = |frame: usize, built: usize| if built < 50 && frame >= 50 { 0.9 } else { 0.7 };
        // Twenty milliseconds are lost a frame.
        for build_ms in [10.0, 100.0, 400.0] {
            let all = rebuilds(200, build_ms, door);
            assert_eq!(all.len(), 1, "{build_ms}: {all:?}");
            assert!(all[0] as f64 <= 52.0 + build_ms / 20.0, "{build_ms}: {all:?}");
        }
        assert!(rebuilds(200, 4000.0, door).is_empty(), "150 frames do not earn it");
        // Through a door in frame 3, when a tree has not lived long enough to judge by: after two prices of 95 ms, in ten frames.
        let early = |frame: usize, built: usize| if built < 3 && frame >= 3 { 0.9 } else { 0.7 };
        assert_eq!(rebuilds(200, 95.0, early), [13]);
    }

    #[test]
    fn its_total_is_within_a_hundredth_or_two_of_the_best_fixed_cadence_where_ageing_is_even_or_ends() {
        let ageing = |rate: f64| move |frame: usize, built: usize| (0.7 + rate * (frame - built) as f64).min(0.95);
        for rate in [0.0, 0.002, 0.02, 0.2] {
            for build_ms in [1.0, 10.0, 100.0, 1000.0] {
                let of = |all: &[usize]| total_ms(48, build_ms, all, ageing(rate));
                let fixed = |period: usize| of(&(1..48).filter(|frame| frame % period == 0).collect::<Vec<_>>());
                let best = (1..=48).map(fixed).fold(f64::INFINITY, f64::min);
                let ours = of(&rebuilds(48, build_ms, ageing(rate)));
                assert!(ours <= 1.02 * best, "rate {rate}, {build_ms} ms: {ours} against {best}");
            }
        }
    }
}
