//! Scenes in two levels: a few parts, each placed many times. What a top-level structure over bottom-level ones is built of.

use super::{
    Camera, Light, LoadOptions, Mesh, Scene, cameras, check, dynamic, generators, inst, load, lookup, no_triangles,
};
use crate::{Error, Result};
use hedgerow::geometry::Aabb;

/// A scene of placed parts. Every instance names a part that is there; the methods panic where one does not.
#[derive(Debug, Clone)]
pub struct Instances {
    /// The name, as of a [`Scene`].
    pub name: String,
    /// What is placed; each becomes a bottom-level structure. A part that no instance names is legal.
    pub parts: Vec<Mesh>,
    /// Where the parts stand, in the order in which they are flattened.
    pub instances: Vec<SceneInstance>,
    /// Where to look from.
    pub camera: Camera,
    /// Lights, in world space; may be empty.
    pub lights: Vec<Light>,
}

/// One placed part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneInstance {
    /// The position in [`Instances::parts`].
    pub part: u32,
    /// Object to world, row by row; the fourth column is the translation. All finite, and so is every vertex it places.
    pub transform: [[f32; 4]; 3],
}

impl SceneInstance {
    /// Leaves the part where it is.
    pub const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

    /// A point of the part in world space: in 64 bits, rounded once.
    pub fn place(&self, point: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = point.map(f64::from);
        self.transform.map(|row| {
            let [a, b, c, d] = row.map(f64::from);
            (a * x + b * y + c * z + d) as f32
        })
    }

    /// A box around every placed point of `bounds`: the one around its placed corners.
    ///
    /// Rounding keeps the order of numbers and [`SceneInstance::place`] grows or falls steadily along each axis of the part, so
    /// that no point of the box is placed outside, not even by a rounding error.
    pub fn place_box(&self, bounds: &Aabb) -> Aabb {
        (0..8).fold(Aabb::EMPTY, |placed, corner| {
            let point = std::array::from_fn(|i| if corner >> i & 1 == 0 { bounds.lo[i] } else { bounds.hi[i] });
            placed.union(&Aabb::around(&[self.place(point)]))
        })
    }
}

impl Instances {
    /// The most triangles that are written out when instances are flattened.
    pub const MOST_FLATTENED: u64 = generators::MOST_TRIANGLES;

    /// A scene without lights, and with the camera of its name or else one for its box.
    pub(super) fn new(
        name: String,
        parts: Vec<Mesh>,
        instances: Vec<SceneInstance>,
        camera: impl Fn(&Aabb) -> Camera,
    ) -> Instances {
        let camera = cameras::known(&name).unwrap_or_else(|| camera(&bounds(&parts, &instances)));
        Instances { name, parts, instances, camera, lights: Vec::new() }
    }

    /// The box around all placed triangles: that of the flattened mesh.
    pub fn bounds(&self) -> Aabb {
        bounds(&self.parts, &self.instances)
    }

    /// How many triangles the flattened mesh has.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|i| self.parts[i.part as usize].triangles.len() as u64).sum()
    }

    /// One mesh of all placed parts: instance by instance, each with all its vertices and triangles in the order of the part.
    ///
    /// # Errors
    /// [`Error::Scene`] if there are more than [`Instances::MOST_FLATTENED`] triangles, or vertices than 32 bits name.
    pub fn flatten(&self) -> Result<Mesh> {
        let triangles = self.triangle_count();
        if triangles > Instances::MOST_FLATTENED {
            let (name, most) = (&self.name, Instances::MOST_FLATTENED);
            return Err(Error::Scene(format!(
                "{name}: {triangles} triangles when flattened, there may be {most}; take fewer instances"
            )));
        }
        let vertices = self.instances.iter().map(|i| self.parts[i.part as usize].positions.len()).sum();
        check::vertices_can_be_counted(&self.name, vertices)?;
        let mut mesh =
            Mesh { positions: Vec::with_capacity(vertices), triangles: Vec::with_capacity(triangles as usize) };
        for instance in &self.instances {
            let part = &self.parts[instance.part as usize];
            mesh.append(part.positions.iter().map(|&p| instance.place(p)), &part.triangles);
        }
        Ok(mesh)
    }
}

fn bounds(parts: &[Mesh], instances: &[SceneInstance]) -> Aabb {
    let corners: Vec<Vec<[f32; 3]>> = parts.iter().map(corners).collect();
    let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::around(corners)).collect();
    let with = |bounds: Aabb, instance: &SceneInstance, corners: &[[f32; 3]]| {
        corners.iter().fold(bounds, |bounds, &corner| bounds.union(&Aabb::around(&[instance.place(corner)])))
    };
    // A corner of each instance, that most of them need not be asked for their others: those that cannot reach further out.
    let core = instances.iter().fold(Aabb::EMPTY, |bounds, instance| {
        with(bounds, instance, corners[instance.part as usize].get(..1).unwrap_or_default())
    });
    instances.iter().fold(core, |bounds, instance| {
        let part = instance.part as usize;
        if corners[part].is_empty() || bounds.contains(&instance.place_box(&boxes[part])) {
            return bounds;
        }
        with(bounds, instance, &corners[part])
    })
}

/// The vertices that triangles use, each once.
fn corners(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut is_used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&v| is_used[v as usize] = true);
    mesh.positions.iter().zip(is_used).filter_map(|(&p, is_used)| is_used.then_some(p)).collect()
}

/// Loads the scene that `spec` names as [`load`] does, but without flattening it: an `.inst` file and the generators of
/// instances keep their parts, a `.dyn` file its objects at time 0; every other scene is one part that stands where it is.
///
/// # Errors
/// As [`load`].
pub fn load_instances(spec: &str, options: &LoadOptions<'_>) -> Result<Instances> {
    if let Some(instances) = load_placed(spec, options)? {
        return Ok(instances);
    }
    let Scene { name, mesh, camera, lights } = load(spec, options)?;
    let instances = vec![SceneInstance { part: 0, transform: SceneInstance::IDENTITY }];
    Ok(Instances { name, parts: vec![mesh], instances, camera, lights })
}

/// [`load_instances`] of a scene that is one of instances; `None` if it is of another kind.
///
/// # Errors
/// As [`load`].
pub fn load_placed(spec: &str, options: &LoadOptions<'_>) -> Result<Option<Instances>> {
    let instances = if let Some(generated) = generators::Generated::find(spec)? {
        generated.instances()
    } else {
        let path = lookup::find(spec, &options.folders)?;
        match lookup::format_of(&path).as_deref() {
            Some("inst") => Some(inst::read(&path, options)?),
            Some("dyn") => Some(dynamic::read(&path, options)?.instances(0.0)),
            _ => None,
        }
    };
    if instances.as_ref().is_some_and(|instances| instances.triangle_count() == 0) {
        return Err(no_triangles(spec));
    }
    Ok(instances)
}
