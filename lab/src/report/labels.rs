//! Where labels go so that they cover neither each other nor a mark.

use std::borrow::Cow;

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
    /// The smallest around two points.
    pub fn around(a: (f64, f64), b: (f64, f64)) -> Rect {
        Rect { x: a.0.min(b.0), y: a.1.min(b.1), w: (a.0 - b.0).abs(), h: (a.1 - b.1).abs() }
    }

    /// Larger by `margin` on every side.
    pub fn grown(&self, margin: f64) -> Rect {
        Rect { x: self.x - margin, y: self.y - margin, w: self.w + 2.0 * margin, h: self.h + 2.0 * margin }
    }

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

/// Estimated width of `text` of `size` pixels in whatever sans-serif font a browser has; on the safe side.
pub fn text_width(text: &str, size: f64) -> f64 {
    let width = |c: char| match c {
        'i' | 'l' | 'j' | 't' | 'f' | 'r' | '.' | ',' | ':' | ';' | '|' | '\'' | ' ' => 0.37,
        'm' | 'w' | 'M' | 'W' | '+' | '=' | '%' | '…' => 0.92,
        _ => 0.62,
    };
    text.chars().map(width).sum::<f64>() * size
}

/// The most pixels that a name has room for: a chart's other half is for what it shows.
pub const NAME_ROOM: f64 = 300.0;

/// The room that the longest of some names takes, in pixels, each cut by [`fitted`].
pub fn name_room<S: AsRef<str>>(names: impl IntoIterator<Item = S>, size: f64) -> f64 {
    names.into_iter().map(|name| text_width(name.as_ref(), size)).fold(0.0, f64::max).min(NAME_ROOM)
}

/// A name that is no wider than [`NAME_ROOM`]: of a longer one its begin and its end, which tell it from others.
pub fn fitted(name: &str, size: f64) -> Cow<'_, str> {
    if text_width(name, size) <= NAME_ROOM {
        return name.into();
    }
    let chars: Vec<char> = name.chars().collect();
    let cut = |kept: usize| -> String {
        let (begin, end) = (&chars[..kept.div_ceil(2)], &chars[chars.len() - kept / 2..]);
        begin.iter().chain(&['…']).chain(end).collect()
    };
    let longest = (0..chars.len()).rev().map(cut).find(|short| text_width(short, size) <= NAME_ROOM);
    longest.unwrap_or_default().into()
}

/// A place for a label of each width beside each anchor, inside `frame`, in the order given; off `lines` where there is room.
///
/// Each takes, of a ring of places around its anchor and wider rings behind, the first that covers least. Good enough for
/// the dozen points of a chart; an exact answer is NP-hard and would look no better.
pub fn place(anchors: &[(f64, f64)], widths: &[f64], height: f64, lines: &[Rect], frame: &Rect) -> Vec<Rect> {
    const MARK: f64 = 7.0;
    /// How bad it is to cover a line, against a mark or a label.
    const LINE: f64 = 0.1;
    let marks: Vec<Rect> =
        anchors.iter().map(|&(x, y)| Rect { x: x - MARK, y: y - MARK, w: 2.0 * MARK, h: 2.0 * MARK }).collect();
    let mut placed: Vec<Rect> = Vec::new();
    for (&anchor, &w) in anchors.iter().zip(widths) {
        let cost = |place: &Rect| {
            let covered: f64 = placed.iter().chain(&marks).map(|other| place.overlap(other)).sum();
            let on_lines: f64 = lines.iter().map(|line| place.overlap(line)).sum();
            // Whole pixels: of places that cover nothing but rounding errors, the nearest is taken.
            (covered + LINE * on_lines + 4.0 * place.outside(frame)).round() as i64
        };
        let best = candidates(anchor, w, height, MARK).min_by_key(cost);
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
        let placed = place(&anchors, &[90.0; 12], 16.0, &[], &FRAME);
        for (i, a) in placed.iter().enumerate() {
            assert!(a.outside(&FRAME) < 1e-9, "{a:?} is outside");
            for b in &placed[i + 1..] {
                assert!(a.overlap(b) < 1e-9, "{a:?} covers {b:?}");
            }
        }
    }

    #[test]
    fn a_label_with_nothing_around_stands_close_to_the_right_of_its_mark() {
        for anchor in [(160.0, 132.0), (333.3, 77.7), (0.1 + 0.2, 200.0)] {
            let placed = place(&[anchor], &[107.64], 16.0, &[], &FRAME)[0];
            assert_eq!((placed.x - anchor.0).round(), 9.0, "{anchor:?}: {placed:?}");
        }
    }

    #[test]
    fn a_line_is_left_free_where_there_is_room() {
        let line = Rect { x: 0.0, y: 197.0, w: 640.0, h: 6.0 };
        let placed = place(&[(300.0, 200.0)], &[80.0], 16.0, &[line], &FRAME);
        assert_eq!(placed[0].overlap(&line), 0.0, "{placed:?}");
    }

    #[test]
    fn a_label_in_the_corner_stays_inside() {
        for corner in [(2.0, 2.0), (638.0, 2.0), (2.0, 398.0), (638.0, 398.0)] {
            let placed = place(&[corner], &[120.0], 16.0, &[], &FRAME);
            assert!(placed[0].outside(&FRAME) < 1e-9, "{corner:?}: {placed:?}");
        }
    }

    #[test]
    fn long_names_keep_their_begin_and_end_and_fit() {
        assert_eq!(fitted("lbvh emc64var", 13.0), "lbvh emc64var");
        let name = "lbvh emc64var+robust+concise, width 8q, optimise high, split 0.3/7, collapsed";
        let short = fitted(name, 13.0);
        let (begin, end) = short.split_once('…').expect("a cut name");
        assert!(name.starts_with(begin) && name.ends_with(end), "{short}");
        let width = text_width(&short, 13.0);
        assert!(width <= NAME_ROOM && width > NAME_ROOM - 20.0, "{short}: {width} pixels");
        assert_eq!(name_room([name, "lbvh"], 13.0), NAME_ROOM);
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
