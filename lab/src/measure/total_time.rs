//! The time that decides: a build and the rays traced before the next one; and which builder wins for how many rays.
//!
//! Total time is a straight line over the number of rays: it starts at the build time and climbs by the time of a ray. The
//! lowest line at each number of rays is the lower envelope (Frantál 2019 and van Kralingen 2023 compare builders by it).

/// Build and trace time of one builder, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Time of a build.
    pub build: f64,
    /// Time of one ray.
    pub ray: f64,
}

impl Line {
    /// From milliseconds a build and millions of rays a second: milliseconds over rays.
    pub fn new(build_ms: f64, mrays_s: f64) -> Line {
        Line { build: build_ms, ray: 1e-3 / mrays_s }
    }

    /// Time of a build and `rays` rays.
    pub fn at(&self, rays: f64) -> f64 {
        self.build + self.ray * rays
    }
}

/// A stretch of the lower envelope: from this many rays per build on, this line is the lowest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Index of the line.
    pub line: usize,
    /// Rays a build from which on it is; 0 for the first.
    pub from: f64,
}

/// The lower envelope of `lines` from 0 rays to infinitely many, in order.
pub fn lower_envelope(lines: &[Line]) -> Vec<Stretch> {
    // The winner at 0 rays builds fastest (of equals, the faster tracer); it hands over at the nearest crossing with a
    // line that climbs less, and so on.
    let lowest_start = |a: &&Line, b: &&Line| a.build.total_cmp(&b.build).then(a.ray.total_cmp(&b.ray));
    let Some(first) = lines.iter().min_by(lowest_start) else { return Vec::new() };
    let index_of = |line: &Line| lines.iter().position(|l| l == line).expect("taken from the slice");
    let mut envelope = vec![Stretch { line: index_of(first), from: 0.0 }];
    let mut current = *first;
    loop {
        let crossing = |line: &Line| (line.build - current.build) / (current.ray - line.ray);
        let next = lines
            .iter()
            .filter(|line| line.ray < current.ray)
            .min_by(|a, b| crossing(a).total_cmp(&crossing(b)).then(a.ray.total_cmp(&b.ray)));
        let Some(next) = next else { return envelope };
        envelope.push(Stretch { line: index_of(next), from: crossing(next) });
        current = *next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn winner(envelope: &[Stretch], rays: f64) -> usize {
        envelope.iter().rev().find(|s| s.from <= rays).expect("starts at 0").line
    }

    #[test]
    fn each_line_wins_where_it_is_lowest() {
        // Crossings by hand: lines 0 and 1 meet at 10 rays, 1 and 2 at 40; line 3 is never lowest.
        let lines = [
            Line { build: 0.0, ray: 2.0 },
            Line { build: 10.0, ray: 1.0 },
            Line { build: 30.0, ray: 0.5 },
            Line { build: 31.0, ray: 0.9 },
        ];
        let envelope = lower_envelope(&lines);
        let expected = [(0, 0.0), (1, 10.0), (2, 40.0)];
        assert_eq!(envelope.iter().map(|s| (s.line, s.from)).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn the_envelope_is_below_every_line_everywhere() {
        let lines: Vec<Line> = (0..40)
            .map(|i: u32| Line { build: f64::from(i * 7919 % 101), ray: 0.01 + f64::from(i * 104_729 % 97) })
            .collect();
        let envelope = lower_envelope(&lines);
        for rays in (0..2000).map(|r| f64::from(r) * 0.013) {
            let best = lines.iter().map(|l| l.at(rays)).fold(f64::INFINITY, f64::min);
            let chosen = lines[winner(&envelope, rays)].at(rays);
            assert!((chosen - best).abs() <= 1e-9 * best.max(1.0), "at {rays}: {chosen}, the best is {best}");
        }
    }

    #[test]
    fn a_builder_that_is_best_at_both_wins_alone() {
        let lines = [Line::new(2.0, 1.0), Line::new(1.0, 5.0), Line::new(3.0, 4.0)];
        assert_eq!(lower_envelope(&lines), [Stretch { line: 1, from: 0.0 }]);
        assert_eq!(lower_envelope(&[]), []);
    }

    #[test]
    fn milliseconds_and_mrays_give_milliseconds() {
        // 1 ms of build, and 10 million rays at 5 Mrays/s are 2 s.
        assert!((Line::new(1.0, 5.0).at(10e6) - 2001.0).abs() < 1e-9);
    }
}
