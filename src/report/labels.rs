//! Where labels go so that they cover neither each other nor a mark.

/// A rectangle in pixels: left, top, width, height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Rect {
    /// Area that both cover.
    fn overlap(&self, other: &Rect) -> f64 {
        let w = (self.x + self.w).min(other.x + other.w) - self.x.max(other.x);
        let h = (self.y + self.h).min(other.y + other.h) - self.y.max(other.y);
        w.max(0.0) * h.max(0.0)
    }

    /// Area of this that lies outside `frame`.
    fn outside(&self, frame: &Rect) -> f64 {
        self.w * self.h - self.overlap(frame)
    }

    /// The point of the rectangle that is nearest to `p`.
    pub fn nearest(&self, p: (f64, f64)) -> (f64, f64) {
        (p.0.clamp(self.x, self.x + self.w), p.1.clamp(self.y, self.y + self.h))
    }
}

/// Estimated width of `text` in Noto Sans of `size` pixels; on the safe side.
pub fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(|c| if "iljtfr.,:;|' ".contains(c) { 0.34 } else { 0.6 }).sum::<f64>() * size
}

/// A place for a label of each width beside each anchor, inside `frame`, in the order given.
///
/// Each takes, of a ring of places around its anchor and wider rings behind, the first that covers least. Good enough for
/// the dozen points of a chart; an exact answer is NP-hard and would look no better.
pub fn place(anchors: &[(f64, f64)], widths: &[f64], height: f64, frame: &Rect) -> Vec<Rect> {
    const MARK: f64 = 7.0;
    let marks: Vec<Rect> =
        anchors.iter().map(|&(x, y)| Rect { x: x - MARK, y: y - MARK, w: 2.0 * MARK, h: 2.0 * MARK }).collect();
    let mut placed: Vec<Rect> = Vec::new();
    for (&anchor, &w) in anchors.iter().zip(widths) {
        let cost = |place: &Rect| {
            let covered: f64 = placed.iter().chain(&marks).map(|other| place.overlap(other)).sum();
            // Whole pixels: of places that cover nothing but rounding errors, the nearest is taken.
            (covered + 4.0 * place.outside(frame)).floor()
        };
        let best = candidates(anchor, w, height, MARK).min_by(|a, b| cost(a).total_cmp(&cost(b)));
        placed.push(best.expect("there are always candidates"));
    }
    placed
}

/// Places around an anchor: right, left, above, below and the corners between, then the same further out.
fn candidates((x, y): (f64, f64), w: f64, h: f64, gap: f64) -> impl Iterator<Item = Rect> {
    let rings = (0..9).map(move |ring| gap + 2.0 + f64::from(ring) * 0.8 * h);
    rings.flat_map(move |d| {
        let (right, left, middle) = (x + d, x - d - w, x - 0.5 * w);
        let (above, below, level) = (y - d - h, y + d, y - 0.5 * h);
        let near = d.min(10.0);
        [
            (right, level),
            (left, level),
            (middle, above),
            (middle, below),
            (x + near, above),
            (x + near, below),
            (x - near - w, above),
            (x - near - w, below),
        ]
        .map(|(x, y)| Rect { x, y, w, h })
    })
}

/// Moves centres along one axis apart by at least `gap`, inside `lo..hi`, each as near to where it was as the order allows.
pub fn spread(centres: &[f64], gap: f64, lo: f64, hi: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..centres.len()).collect();
    order.sort_by(|&a, &b| centres[a].total_cmp(&centres[b]));
    let mut moved: Vec<f64> = centres.iter().map(|c| c.clamp(lo, hi)).collect();
    // Relaxation: neighbours that are too close push each other apart, half each; the ends are walls.
    for _ in 0..200 {
        for pair in order.windows(2) {
            let missing = gap - (moved[pair[1]] - moved[pair[0]]);
            if missing > 0.0 {
                moved[pair[0]] = (moved[pair[0]] - 0.5 * missing).max(lo);
                moved[pair[1]] = (moved[pair[1]] + 0.5 * missing).min(hi);
            }
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Rect = Rect { x: 0.0, y: 0.0, w: 640.0, h: 400.0 };

    #[test]
    fn labels_of_a_crowd_cover_neither_each_other_nor_a_mark() {
        // Twelve points within 60 pixels, labels of 90 pixels: beside the points alone there is no room.
        let anchors: Vec<_> =
            (0..12).map(|i| (300.0 + f64::from(i * 37 % 60), 200.0 + f64::from(i * 53 % 60))).collect();
        let placed = place(&anchors, &[90.0; 12], 16.0, &FRAME);
        for (i, a) in placed.iter().enumerate() {
            assert!(a.outside(&FRAME) < 1e-9, "{a:?} is outside");
            for b in &placed[i + 1..] {
                assert!(a.overlap(b) < 1e-9, "{a:?} covers {b:?}");
            }
        }
    }

    #[test]
    fn a_label_in_the_corner_stays_inside() {
        for corner in [(2.0, 2.0), (638.0, 2.0), (2.0, 398.0), (638.0, 398.0)] {
            let placed = place(&[corner], &[120.0], 16.0, &FRAME);
            assert!(placed[0].outside(&FRAME) < 1e-9, "{corner:?}: {placed:?}");
        }
    }

    #[test]
    fn centres_are_spread_in_their_order_and_inside() {
        let moved = spread(&[50.0, 51.0, 52.0, 300.0], 16.0, 10.0, 400.0);
        assert!(moved.windows(2).all(|w| w[1] - w[0] >= 15.9), "{moved:?}");
        assert!((moved[1] - 51.0).abs() < 1.0 && moved[3] == 300.0, "{moved:?}");
        let crowded = spread(&[5.0; 5], 20.0, 0.0, 100.0);
        assert!(crowded.iter().all(|&c| (0.0..=100.0).contains(&c)), "{crowded:?}");
    }
}
