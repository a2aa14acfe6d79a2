//! Pictures of a scene as a tracer sees it: shaded, heat maps of the work that each ray took, and of the tree that it went through.

mod legend;
mod planes;

use super::numbers::three_digits;
use crate::experiments::navigate::outline::{Content, Outline};
use crate::named::named;
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::scene::Scene;
use crate::subjects::{KD_TREE, Subject};
use crate::{Error, Result};
use glam::Vec3;
use hedgerow::trace::{Hit, Query, Ray, Work};
use image::{Rgb, RgbImage};
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};
use rayon::prelude::*;

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum View {
    /// The surfaces in the light of an even sky, four rays a pixel and four to the sky for each.
    Shaded,
    /// The geometric normals as colours.
    Normals,
    /// Inner nodes that the primary ray of each pixel visited.
    Steps,
    /// Triangles that the primary ray of each pixel was tested against.
    Tests,
    /// The distance to the surface.
    Depth,
    /// Triangles in the leaf in which the primary ray of each pixel ends: where a tree is coarse, on the surface that it is coarse
    /// for. (What leaves on the way cost is in `Tests`.)
    LeafSize,
    /// Lines where the planes of a kd-tree cut the surfaces.
    Planes,
}

named!(View, "view":
    Shaded = "shaded",
    Normals = "normals",
    Steps = "steps",
    Tests = "tests",
    Depth = "depth",
    LeafSize = "leaf-size",
    Planes = "planes",
);

impl View {
    /// Whether a subject can be seen so, before it is built.
    ///
    /// # Errors
    /// [`Error::Argument`] says what it lacks, and what to choose.
    pub fn check(self, subject: &dyn Subject) -> Result<()> {
        match self {
            View::Planes if subject.kind() != KD_TREE => Err(planes::needs_kd_tree(subject.builder())),
            _ => Ok(()),
        }
    }
}

/// How a picture is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureOptions {
    /// What it shows.
    pub view: View,
    /// Pixels in x and y, without the legend.
    pub size: [u32; 2],
    /// Of the rays to the sky.
    pub seed: u64,
    /// Where the colours of a heat map end; without it, at what 99 of 100 pixels stay below. Pictures that are compared
    /// need the same. Of planes, the deepest level that is drawn; without it, as deep as they cover a fifth of the surface.
    pub top: Option<f32>,
}

/// Makes a picture with a subject that has been built. Heat maps and planes have their legend below.
///
/// # Errors
/// The device failed, or the tracer does not count what `view` shows, or there is no tree of ours that it shows.
pub fn picture(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    match options.view {
        View::Shaded => shaded(scene, subject, options),
        View::Normals => normals(scene, subject, options),
        View::Depth => depth(scene, subject, options),
        View::Steps => work(scene, subject, options, "inner nodes visited by the ray of each pixel", |w| w.steps),
        View::Tests => work(scene, subject, options, "triangles tested by the ray of each pixel", |w| w.tests),
        View::LeafSize => leaf_size(scene, subject, options),
        View::Planes => planes::planes(scene, subject, options),
    }
}

/// The primary rays of a picture and what they meet.
struct Seen {
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl Seen {
    fn trace(scene: &Scene, subject: &mut dyn Subject, rays: &RayOptions) -> Result<Seen> {
        let rays = kinds::generate(RayKind::Primary, scene, rays, &mut |_| Ok(Vec::new()))?;
        let hits = subject.hits_of(&rays, Query::ClosestHit)?;
        Ok(Seen { rays, hits })
    }

    /// Where a ray ends.
    fn point(&self, i: usize) -> Option<Vec3> {
        let (ray, hit) = (&self.rays[i], &self.hits[i]);
        hit.is_some().then(|| Vec3::from(ray.origin) + hit.t * Vec3::from(ray.direction))
    }

    /// The geometric normal of each hit, on the side of the eye.
    fn normals<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = Option<Vec3>> + 'a {
        self.rays.iter().zip(&self.hits).map(|(ray, hit)| {
            let towards_eye = -Vec3::from(ray.direction).normalize_or(Vec3::Z);
            hit.is_some().then(|| {
                let [a, b, c] = scene.mesh.corners(hit.primitive as usize).map(Vec3::from);
                let normal = (b - a).cross(c - a).normalize_or(towards_eye);
                if normal.dot(towards_eye) < 0.0 { -normal } else { normal }
            })
        })
    }
}

/// Rays a pixel in x and in y where edges shall be smooth.
const SMOOTH: u32 = 2;

fn smooth(size: [u32; 2], seed: u64) -> RayOptions {
    RayOptions { size: size.map(|side| side * SMOOTH), seed }
}

/// The surfaces in the light of an even sky and a lamp.
fn shaded(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    let rays = smooth(options.size, options.seed);
    let seen = Seen::trace(scene, subject, &rays)?;
    let sky_rays = kinds::generate(RayKind::Ao, scene, &rays, &mut |_| Ok(seen.hits.clone()))?;
    let hidden = subject.hits_of(&sky_rays, Query::AnyHit)?;
    let surfaces = seen.hits.iter().filter(|hit| hit.is_some()).count();
    let mut skies = hidden.chunks(hidden.len().checked_div(surfaces).unwrap_or(1).max(1));

    let up = Vec3::from(scene.camera.up).normalize_or(Vec3::Y);
    let backwards = (Vec3::from(scene.camera.eye) - Vec3::from(scene.camera.look)).normalize_or(Vec3::Z);
    // A lamp above the left shoulder gives shape where the sky alone would be flat.
    let lamp = (backwards + 0.9 * up + 0.7 * backwards.cross(up)).normalize_or(backwards);
    let (ground, sky, light) = (Vec3::new(0.16, 0.13, 0.11), Vec3::new(0.30, 0.34, 0.40), Vec3::new(0.42, 0.39, 0.34));
    let colours = seen.normals(scene).map(|normal| match normal {
        None => Vec3::new(0.72, 0.80, 0.88),
        Some(normal) => {
            let rays = skies.next().unwrap_or_default();
            let open = rays.iter().filter(|hit| !hit.is_some()).count() as f32 / rays.len().max(1) as f32;
            let ambient = ground.lerp(sky, 0.5 + 0.5 * normal.dot(up));
            (ambient + light * normal.dot(lamp).max(0.0)) * (0.3 + 0.7 * open)
        }
    });
    Ok(averaged(&colours.collect::<Vec<_>>(), options.size))
}

fn normals(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    let seen = Seen::trace(scene, subject, &smooth(options.size, options.seed))?;
    let colours = seen.normals(scene).map(|n| n.map_or(Vec3::ZERO, |normal| decoded(0.5 + 0.5 * normal)));
    Ok(averaged(&colours.collect::<Vec<_>>(), options.size))
}

/// The linear light of an sRGB colour (by the power of 2.2 that is near it).
fn decoded(colour: Vec3) -> Vec3 {
    colour.powf(2.2)
}

/// The mean of the rays of each pixel, as sRGB.
fn averaged(colours: &[Vec3], [width, height]: [u32; 2]) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let rows = (0..SMOOTH).map(|row| ((y * SMOOTH + row) * width * SMOOTH + x * SMOOTH) as usize);
        let sum: Vec3 = rows.map(|first| colours[first..][..SMOOTH as usize].iter().sum::<Vec3>()).sum();
        let mean = (sum / (SMOOTH * SMOOTH) as f32).clamp(Vec3::ZERO, Vec3::ONE);
        Rgb((mean.powf(1.0 / 2.2) * 255.0).round().to_array().map(|c| c as u8))
    })
}

fn depth(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    let seen = Seen::trace(scene, subject, &RayOptions { size: options.size, seed: options.seed })?;
    let values: Vec<_> = seen.hits.iter().map(|hit| hit.is_some().then_some(hit.t)).collect();
    let found = || values.iter().flatten().copied();
    let nearest = found().fold(f32::INFINITY, f32::min);
    let farthest = options.top.unwrap_or_else(|| below(found(), 0.99)).max(nearest);
    // Near is bright: what lies in front shall stand out.
    let colour = |t: f32| 1.0 - (t - nearest) / (farthest - nearest).max(f32::MIN_POSITIVE);
    let image = heat_map(&values, options.size, colour);
    let [near, far] = [nearest, farthest].map(|t| if t.is_finite() { three_digits(f64::from(t)) } else { "-".into() });
    legend::with_scale(image, [format!("{far}+"), near], "distance from the eye")
}

fn work(
    scene: &Scene,
    subject: &mut dyn Subject,
    options: &PictureOptions,
    what: &str,
    count: fn(&Work) -> u32,
) -> Result<RgbImage> {
    Seen::trace(scene, subject, &RayOptions { size: options.size, seed: options.seed })?;
    let Some(work) = subject.work(Query::ClosestHit)? else {
        let (builder, view) = (subject.builder(), options.view);
        let remedy = "choose another builder or the view shaded, normals or depth";
        return Err(Error::Argument(format!("{builder} does not count {view}; {remedy}")));
    };
    let values: Vec<_> = work.iter().map(|w| Some(count(w) as f32)).collect();
    counts(&values, options, what)
}

fn leaf_size(scene: &Scene, subject: &mut dyn Subject, options: &PictureOptions) -> Result<RgbImage> {
    let seen = Seen::trace(scene, subject, &RayOptions { size: options.size, seed: options.seed })?;
    let outline = Outline::of(subject)?;
    let size = |(ray, hit): (&Ray, &Hit)| {
        let leaf = hit.is_some().then(|| outline.leaf_of(ray, hit)).flatten()?;
        match &outline.nodes[leaf as usize].content {
            Content::Leaf(range) => Some(range.len() as f32),
            Content::Inner(_) => None,
        }
    };
    let values: Vec<_> = seen.rays.par_iter().zip(&seen.hits).map(size).collect();
    counts(&values, options, "triangles in the leaf where the ray of each pixel ends")
}

/// A heat map of counts, from 0 on.
fn counts(values: &[Option<f32>], options: &PictureOptions, what: &str) -> Result<RgbImage> {
    let there = || values.iter().flatten().copied();
    let top = options.top.unwrap_or_else(|| nice(below(there(), 0.99)));
    let mean = there().map(f64::from).sum::<f64>() / there().count().max(1) as f64;
    let most = there().fold(0.0, f32::max);
    let image = heat_map(values, options.size, |v| v / top);
    let words = format!("{what}: mean {}, most {most}", three_digits(mean));
    legend::with_scale(image, ["0".into(), format!("{top}+")], &words)
}

/// What the share `share` of the values stays below.
fn below(values: impl Iterator<Item = f32>, share: f32) -> f32 {
    let mut values: Vec<f32> = values.collect();
    if values.is_empty() {
        return 1.0;
    }
    let at = ((values.len() - 1) as f32 * share) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// The next number of two digits and zeros.
fn nice(value: f32) -> f32 {
    let unit = 10_f32.powf((value.max(1.0).log10().floor() - 1.0).max(0.0));
    (value / unit).ceil().max(1.0) * unit
}

/// Each value by its place in 0..1 on the colour map; nothing is grey.
fn heat_map(values: &[Option<f32>], [width, height]: [u32; 2], place: impl Fn(f32) -> f32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| match values[(y * width + x) as usize] {
        Some(value) => colour(place(value)),
        None => Rgb([0x30, 0x30, 0x30]),
    })
}

/// Viridis (Smith, van der Walt 2015): equal steps look equal, in grey and to the colour-blind too.
fn colour(place: f32) -> Rgb<u8> {
    let plotters::style::RGBColor(r, g, b) = ViridisRGB.get_color(place.clamp(0.0, 1.0));
    Rgb([r, g, b])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, LoadOptions};
    use crate::subjects::builders::Spec;

    fn of(view: View, top: Option<f32>) -> RgbImage {
        by("kd-binned", view, top)
    }

    fn by(builder: &str, view: View, top: Option<f32>) -> RgbImage {
        let scene = scene::load("gen:icosphere:3", &LoadOptions::default()).expect("a generator");
        let spec: Spec = builder.parse().expect("a builder");
        let mut subject = spec.make(None, &scene.mesh).expect("a subject");
        subject.build().expect("a tree");
        let options = PictureOptions { view, size: [64, 48], seed: 1, top };
        picture(&scene, subject.as_mut(), &options).expect("a picture")
    }

    fn luminance(pixel: &Rgb<u8>) -> u32 {
        pixel.0.iter().map(|&c| u32::from(c)).sum()
    }

    #[test]
    fn the_sphere_stands_in_the_middle_of_every_view() {
        for view in View::ALL {
            let image = of(view, None);
            assert_eq!(image.width(), 64);
            assert_eq!(image.height() == 48, matches!(view, View::Shaded | View::Normals), "heat maps have a legend");
            assert_ne!(image.get_pixel(32, 24), image.get_pixel(0, 0), "{view}");
            assert_eq!(image.get_pixel(0, 0), image.get_pixel(63, 0), "{view}: both corners are background");
        }
    }

    #[test]
    fn every_view_but_planes_is_of_a_bvh_too() {
        for view in View::ALL.into_iter().filter(|view| *view != View::Planes) {
            assert_ne!(
                by("lbvh-host", view, None).get_pixel(32, 24),
                by("lbvh-host", view, None).get_pixel(0, 0),
                "{view}"
            );
        }
        let shaded = [by("lbvh-host", View::Shaded, None), by("kd-binned", View::Shaded, None)];
        assert_eq!(shaded[0], shaded[1], "the same hits");
        assert_eq!(by("lbvh-host", View::LeafSize, Some(8.0)).dimensions(), of(View::LeafSize, Some(8.0)).dimensions());
    }

    #[test]
    fn deeper_planes_draw_more_lines() {
        let is_coloured = |p: &&Rgb<u8>| p.0.iter().max() > p.0.iter().min().map(|least| least + 24).as_ref();
        let lines = |top| of(View::Planes, Some(top)).rows().take(48).flatten().filter(is_coloured).count();
        let counts = [0.5, 2.0, 5.0].map(lines);
        assert!(0 < counts[0] && counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
    }

    #[test]
    fn near_is_brighter_than_far() {
        let image = of(View::Depth, None);
        let edge = (0..32).map(|x| image.get_pixel(x, 24)).find(|p| p.0 != [0x30; 3]).expect("the sphere");
        assert!(luminance(image.get_pixel(32, 24)) > luminance(edge));
    }

    #[test]
    fn a_higher_top_makes_a_darker_map() {
        let sum = |image: &RgbImage| (0..48).map(|y| luminance(image.get_pixel(32, y))).sum::<u32>();
        assert!(sum(&of(View::Steps, Some(10.0))) > sum(&of(View::Steps, Some(1000.0))));
    }

    #[test]
    fn scales_end_at_numbers_of_two_digits() {
        for (value, end) in [(0.0, 1.0), (7.2, 8.0), (31.0, 31.0), (134.0, 140.0), (9_901.0, 10_000.0)] {
            assert_eq!(nice(value), end);
        }
    }

    #[test]
    fn names_of_views_are_their_own_inverse() {
        for view in View::ALL {
            assert_eq!(view.name().parse::<View>().expect("a view"), view);
        }
        assert!("colour".parse::<View>().expect_err("no view").to_string().contains("use one of shaded, normals"));
    }
}
