//! Smooth ways through key points: Catmull-Rom splines with keys at any times (van Kralingen 2023, section 5.1, flies cameras along
//! splines).

use super::Keys;

type Point = [f32; 3];

/// A curve through these points at these times, of which there is one or more: its tangent at a key is the slope between the two keys
/// about it, at an end that to the only neighbour. Where the last point is the first, the curve is closed, and its two ends have one
/// tangent.
pub(super) fn catmull_rom(times: &[f32], points: &[Point]) -> Keys<Point> {
    let last = points.len() - 1;
    let is_closed = last > 1 && points[0] == points[last];
    let tangent = |key: usize| -> Point {
        let (before, behind) = (key.saturating_sub(1), (key + 1).min(last));
        let (difference, span) = if is_closed && (key == 0 || key == last) {
            (difference(points[last - 1], points[1]), times[1] - times[0] + times[last] - times[last - 1])
        } else {
            (difference(points[before], points[behind]), times[behind] - times[before])
        };
        // A single key has no neighbours.
        if span > 0.0 { difference.map(|d| d / span) } else { [0.0; 3] }
    };
    Keys::Cubic((0..=last).map(|key| [tangent(key), points[key], tangent(key)]).collect())
}

fn difference(from: Point, to: Point) -> Point {
    std::array::from_fn(|i| to[i] - from[i])
}

#[cfg(test)]
mod tests {
    use super::super::Track;
    use super::*;

    fn through(times: &[f32], points: &[Point]) -> Track<Point> {
        Track::new(times.to_vec(), catmull_rom(times, points))
    }

    /// The slope just before and just behind a time.
    fn slopes(track: &Track<Point>, time: f32) -> [Point; 2] {
        const STEP: f32 = 1.0 / 1024.0;
        let slope = |from: f32, to: f32| difference(track.at(from), track.at(to)).map(|d| d / (to - from));
        [slope(time - STEP, time), slope(time, time + STEP)]
    }

    fn is_near(a: Point, b: Point) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02)
    }

    #[test]
    fn the_curve_goes_through_its_keys_with_the_slope_between_the_keys_about_them() {
        let (times, points) = ([0.0, 1.0, 3.0, 4.0], [[0.0; 3], [1.0, 2.0, 0.0], [4.0, 2.0, 6.0], [4.0, 0.0, 0.0]]);
        let track = through(&times, &points);
        for (time, point) in times.into_iter().zip(points) {
            assert_eq!(track.at(time), point);
        }
        // (4, 2, 6) less (0, 0, 0) over three seconds, on both sides of the key.
        for slope in slopes(&track, 1.0) {
            assert!(is_near(slope, [4.0 / 3.0, 2.0 / 3.0, 2.0]), "{slope:?}");
        }
        // One-sided where there is nothing before: (1, 2, 0) in a second.
        assert!(is_near(slopes(&track, 0.0)[1], [1.0, 2.0, 0.0]), "{:?}", slopes(&track, 0.0));
    }

    #[test]
    fn equal_steps_in_equal_times_are_gone_at_one_speed() {
        let track = through(&[0.0, 1.0, 2.0, 3.0], &[0.0, 2.0, 4.0, 6.0].map(|x| [x, 1.0, -x]));
        for i in 0..=30 {
            let time = i as f32 / 10.0;
            assert!(is_near(track.at(time), [2.0 * time, 1.0, -2.0 * time]), "{time}");
        }
    }

    #[test]
    fn a_curve_that_ends_where_it_began_has_one_slope_there() {
        let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
        let closed = through(&[0.0, 1.0, 2.0, 3.0, 4.0], &corners);
        // From (0, −1) to (0, 1) in two seconds, when it comes and when it leaves.
        let (leaves, comes) = (slopes(&closed, 0.0)[1], slopes(&closed, 4.0)[0]);
        assert!(is_near(leaves, [0.0, 1.0, 0.0]) && is_near(comes, [0.0, 1.0, 0.0]), "{leaves:?} {comes:?}");
        let open = through(&[0.0, 1.0, 2.0, 3.0], &corners[..4]);
        assert!(is_near(slopes(&open, 0.0)[1], [-1.0, 1.0, 0.0]), "an open one is one-sided");
    }

    #[test]
    fn one_key_stands_still_and_two_are_a_straight_line() {
        assert_eq!(through(&[1.0], &[[3.0, 4.0, 5.0]]).at(7.0), [3.0, 4.0, 5.0]);
        let line = through(&[0.0, 2.0], &[[0.0; 3], [4.0, 0.0, 2.0]]);
        assert!(is_near(line.at(0.5), [1.0, 0.0, 0.5]), "{:?}", line.at(0.5));
        let back = through(&[0.0, 2.0], &[[1.0; 3], [1.0; 3]]);
        assert_eq!(back.at(1.0), [1.0; 3]);
    }
}
