//! The kinds of rays that are measured (CONTRACT, "Ray kinds"): made from a scene, the same on every machine and with any
//! number of threads.
//!
//! Every ray draws its random numbers from a sequence of its own, seeded with the kind and the ray's place. No library
//! function whose last bit differs between systems takes part (points on the sphere by rejection, square roots only).

use crate::named::named;
use crate::random::SplitMix64;
use crate::scene::{Camera, Light, Mesh, Scene};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use hedgerow::geometry::Aabb;
use hedgerow::trace::{Hit, Query, Ray};
use rayon::prelude::*;

/// A kind of ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// Pinhole camera, through each pixel's centre, row by row from the top.
    Primary,
    /// From each primary hit to a point on each light, any-hit.
    Shadow,
    /// Four cosine-weighted any-hit rays a primary hit, 10% of the scene's diagonal long.
    Ao,
    /// One cosine-weighted closest-hit ray from each primary hit.
    Diffuse1,
    /// One cosine-weighted closest-hit ray from each hit of `Diffuse1`.
    Diffuse2,
    /// Mirror direction at each primary hit, closest-hit.
    Reflection,
    /// Both ends uniform on the sphere around the scene's box, closest-hit.
    Random,
}

named!(RayKind, "kind of ray":
    Primary = "primary",
    Shadow = "shadow",
    Ao = "ao",
    Diffuse1 = "diffuse1",
    Diffuse2 = "diffuse2",
    Reflection = "reflection",
    Random = "random",
);

impl RayKind {
    /// Which hit its rays want.
    pub fn query(self) -> Query {
        match self {
            RayKind::Shadow | RayKind::Ao => Query::AnyHit,
            _ => Query::ClosestHit,
        }
    }
}

/// How many rays, and which of the many random ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayOptions {
    /// Pixels in x and y. `Primary` and `Random` make a ray for each pixel; the other kinds start where rays have hit, so
    /// their number follows from the hits.
    pub size: [u32; 2],
    /// Another seed gives other rays of the same kinds.
    pub seed: u64,
}

/// Rays that leave a primary hit to find out how open it is.
const AO_RAYS: u64 = 4;
/// Their length, and the edge of the light that a scene without one gets, in diagonals of the scene's box.
const TENTH: f32 = 0.1;
/// How far up the shadow ray its light is: a lamp's own triangles shall not hide it.
const AT_LIGHT: f32 = 0.9999;

/// The rays of one kind. `closest_hits` traces the rays that they follow from, one hit a ray.
///
/// # Errors
/// Those of `closest_hits`; an image without pixels or with more than 2^27; a scene without triangles.
pub fn generate(
    kind: RayKind,
    scene: &Scene,
    options: &RayOptions,
    closest_hits: &mut dyn FnMut(&[Ray]) -> Result<Vec<Hit>>,
) -> Result<Vec<Ray>> {
    let [width, height] = options.size.map(u64::from);
    if width * height == 0 || width * height > hedgerow::trace::MAX_RAYS.into() {
        return Err(Error::Argument(format!(
            "an image of {width}x{height} pixels has no rays or too many; take a size from 1x1 to 2^27 pixels"
        )));
    }
    let bounds = scene.mesh.bounds();
    if scene.mesh.triangles.is_empty() {
        return Err(Error::Scene(format!("{}: no triangles, so there is nothing to send rays to", scene.name)));
    }
    let draw = |item: usize| random_of(options.seed, kind, item as u64);
    let arriving = match kind {
        RayKind::Primary => return Ok(primary(&scene.camera, options.size)),
        RayKind::Random => return Ok(random(&bounds, (width * height) as usize, draw)),
        RayKind::Diffuse2 => generate(RayKind::Diffuse1, scene, options, closest_hits)?,
        _ => primary(&scene.camera, options.size),
    };
    let surfaces = surfaces_hit(scene, &arriving, closest_hits)?;
    let lights = lights_of(scene, &bounds);
    let diffuse = |surface: &Surface, random: &mut SplitMix64| surface.leave(cosine_weighted(random, surface.normal));
    let leaving = |(i, surface): (usize, &Surface)| -> Vec<Ray> {
        let mut random = draw(i);
        match kind {
            RayKind::Shadow => lights.iter().map(|light| surface.towards(light, &mut random)).collect(),
            RayKind::Ao => {
                let t_max = TENTH * bounds.diagonal();
                (0..AO_RAYS).map(|_| Ray { t_max, ..diffuse(surface, &mut random) }).collect()
            }
            RayKind::Reflection => vec![surface.leave(surface.mirrored())],
            _ => vec![diffuse(surface, &mut random)],
        }
    };
    Ok(surfaces.par_iter().enumerate().flat_map_iter(leaving).collect())
}

/// Where the pixels of a picture lie in space.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Basis {
    /// Where the camera is.
    pub eye: DVec3,
    /// Three directions at right angles, of unit length.
    pub forward: DVec3,
    /// See `forward`.
    pub right: DVec3,
    /// See `forward`.
    pub up: DVec3,
    /// Half the width and half the height of the picture, at a distance of 1.
    pub half: [f64; 2],
}

impl Basis {
    /// Of a picture with this many pixels in x and y.
    pub fn of(camera: &Camera, [width, height]: [u32; 2]) -> Basis {
        let eye = dvec3(camera.eye);
        let forward = (dvec3(camera.look) - eye).normalize_or(DVec3::NEG_Z);
        // A camera that looks straight up has no right; any direction across will do.
        let right = forward.cross(dvec3(camera.up)).try_normalize().unwrap_or(forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let half_height = (f64::from(camera.fov).to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(width) / f64::from(height);
        Basis { eye, forward, right, up, half: [half_width, half_height] }
    }
}

fn primary(camera: &Camera, [width, height]: [u32; 2]) -> Vec<Ray> {
    let Basis { forward, right, up, half: [half_width, half_height], .. } = Basis::of(camera, [width, height]);
    (0..width as usize * height as usize)
        .into_par_iter()
        .map(|pixel| {
            let (column, row) = (pixel % width as usize, pixel / width as usize);
            let x = ((column as f64 + 0.5) / f64::from(width) * 2.0 - 1.0) * half_width;
            let y = (1.0 - (row as f64 + 0.5) / f64::from(height) * 2.0) * half_height;
            let direction = (forward + right * x + up * y).normalize();
            Ray { origin: camera.eye, t_min: 0.0, direction: array(direction), t_max: f32::INFINITY }
        })
        .collect()
}

fn random(bounds: &Aabb, count: usize, draw: impl Fn(usize) -> SplitMix64 + Sync) -> Vec<Ray> {
    let centre = dvec3(bounds.centroid());
    let radius = f64::from(bounds.diagonal()) / 2.0;
    (0..count)
        .into_par_iter()
        .map(|i| {
            let mut random = draw(i);
            let [from, to] = [(); 2].map(|()| (centre + on_sphere(&mut random) * radius).as_vec3());
            Ray { origin: from.to_array(), t_min: 0.0, direction: (to - from).to_array(), t_max: 1.0 }
        })
        .collect()
}

/// Lights of the scene, or one square above its box.
fn lights_of(scene: &Scene, bounds: &Aabb) -> Vec<Light> {
    if !scene.lights.is_empty() {
        return scene.lights.clone();
    }
    let up = (0..3).max_by(|&i, &j| scene.camera.up[i].abs().total_cmp(&scene.camera.up[j].abs())).unwrap_or(1);
    let (x, y) = ((up + 1) % 3, (up + 2) % 3);
    let edge = TENTH * bounds.diagonal();
    let mut corner = bounds.centroid();
    corner[x] -= edge / 2.0;
    corner[y] -= edge / 2.0;
    corner[up] = if scene.camera.up[up] < 0.0 { bounds.lo[up] - edge } else { bounds.hi[up] + edge };
    let mut edges = [[0.0; 3]; 2];
    edges[0][x] = edge;
    edges[1][y] = edge;
    vec![Light { corner, edges }]
}

/// Where a ray met a surface.
struct Surface {
    /// Geometric normal of unit length, on the side that the ray came from.
    normal: DVec3,
    /// The ray's direction, of unit length.
    incoming: DVec3,
    /// Where rays start that leave it.
    origin: Vec3,
}

fn surfaces_hit(
    scene: &Scene,
    rays: &[Ray],
    closest_hits: &mut dyn FnMut(&[Ray]) -> Result<Vec<Hit>>,
) -> Result<Vec<Surface>> {
    let hits = closest_hits(rays)?;
    Ok(rays
        .par_iter()
        .zip(&hits)
        .filter(|(_, hit)| hit.is_some())
        .map(|(ray, hit)| Surface::at(&scene.mesh, ray, hit))
        .collect())
}

impl Surface {
    fn at(mesh: &Mesh, ray: &Ray, hit: &Hit) -> Surface {
        let corners = mesh.corners(hit.primitive as usize).map(dvec3);
        let [a, b, c] = corners;
        let incoming = dvec3(ray.direction).normalize_or(DVec3::NEG_Z);
        let normal = (b - a).cross(c - a).normalize_or(-incoming);
        let normal = if normal.dot(incoming) > 0.0 { -normal } else { normal };
        // From the corners, not along the ray: the error is that of the corners' coordinates, however long the ray.
        let point = a + (b - a) * f64::from(hit.u) + (c - a) * f64::from(hit.v);
        Surface { normal, incoming, origin: moved_off(point, normal, corners).as_vec3() }
    }

    /// A ray from here.
    fn leave(&self, direction: DVec3) -> Ray {
        Ray { origin: self.origin.to_array(), t_min: 0.0, direction: array(direction), t_max: f32::INFINITY }
    }

    fn towards(&self, light: &Light, random: &mut SplitMix64) -> Ray {
        let [first, second] = light.edges.map(dvec3);
        let target = dvec3(light.corner) + first * random.fine_unit() + second * random.fine_unit();
        Ray { t_max: AT_LIGHT, ..self.leave(target - self.origin.as_dvec3()) }
    }

    fn mirrored(&self) -> DVec3 {
        self.incoming - self.normal * (2.0 * self.normal.dot(self.incoming))
    }
}

/// `point` moved along `normal` so far that a ray from there does not meet the triangle again.
///
/// As Wächter and Binder ("A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, 2019, chapter 6) the
/// length goes with the unit in the last place of the coordinates, in each axis as much as the normal points there. They
/// take 256 units and a fixed length near the origin, where units vanish; in its place the triangle's size counts here, as
/// the rounding of a triangle test goes with that, so that a scene may have any scale.
fn moved_off(point: DVec3, normal: DVec3, corners: [DVec3; 3]) -> DVec3 {
    const UNITS: f64 = 128.0 / (1 << 24) as f64;
    let magnitude = corners.iter().fold(DVec3::ZERO, |m, corner| m.max(corner.abs()));
    let size = corners.iter().fold(0f64, |m, corner| m.max((*corner - point).abs().max_element()));
    point + normal * (UNITS * (normal.abs().dot(magnitude) + size))
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}

fn array(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// The random numbers of an item: a sequence of its own.
fn random_of(seed: u64, kind: RayKind, item: u64) -> SplitMix64 {
    let mut kinds = SplitMix64::new(seed);
    let mut items = SplitMix64::new(kinds.bits() ^ kind as u64);
    SplitMix64::new(items.bits() ^ item.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32))
}

fn on_sphere(random: &mut SplitMix64) -> DVec3 {
    loop {
        let p = DVec3::from_array([(); 3].map(|()| 2.0 * random.fine_unit() - 1.0));
        if (1e-6..=1.0).contains(&p.length_squared()) {
            return p.normalize();
        }
    }
}

/// A direction whose density goes with the cosine to `normal`: the normal's end moved to a point of the sphere there.
fn cosine_weighted(random: &mut SplitMix64, normal: DVec3) -> DVec3 {
    loop {
        let direction = normal + on_sphere(random);
        if direction.length_squared() > 1e-8 {
            return direction.normalize();
        }
    }
}
