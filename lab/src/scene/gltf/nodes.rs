//! The tree of nodes: what each places, and whether it stands or moves.

use super::File;
use super::channels::Channels;
use super::meshes::{self, Part};
use crate::Result;
use crate::scene::check::{self, malformed};
use crate::scene::dynamic::{
    self, CameraPath, DynamicContent, DynamicObject, Motion, Shape, Step, carried, eye_and_backwards, morphed, rows,
};
use crate::scene::{Light, Mesh};
use glam::{DAffine3, Mat4, Vec3};
use gltf::Node;
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;
use std::collections::HashSet;

/// Adds what the nodes place to `content`: those of the default scene, else the first; a file without scenes is a library of
/// which we take every root.
pub(super) fn walk(file: File<'_>, channels: &Channels, content: DynamicContent) -> Result<DynamicContent> {
    let document = file.document;
    let roots: Vec<Node<'_>> = match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => scene.nodes().collect(),
        None => {
            let children: HashSet<usize> = document.nodes().flat_map(|n| n.children().map(|c| c.index())).collect();
            document.nodes().filter(|n| !children.contains(&n.index())).collect()
        }
    };
    let mut scene = Walk { file, channels, content, directional: Vec::new() };
    let mut seen = vec![false; document.nodes().len()];
    let root = NodeTransform::Still(Mat4::IDENTITY);
    // A stack of our own: the depth of the tree is the file's choice.
    let mut stack: Vec<_> = roots.into_iter().rev().map(|node| (node, root.clone())).collect();
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut seen[node.index()], true) {
            let what = format_args!("node {} has two parents, or is its own; export it again", node.index());
            return Err(malformed(file.path.display(), what));
        }
        let placement = parent.inner(&node, channels);
        scene.node(&node, &placement)?;
        let children: Vec<_> = node.children().collect();
        stack.extend(children.into_iter().rev().map(|child| (child, placement.clone())));
    }
    Ok(scene.lit())
}

/// Where a node is.
#[derive(Clone)]
enum NodeTransform {
    /// Always there.
    Still(Mat4),
    /// Moved by itself or by a node above it: the steps from the root down.
    Moving(Vec<Step>),
}

impl NodeTransform {
    /// That of a node below this one.
    fn inner(&self, node: &Node<'_>, channels: &Channels) -> NodeTransform {
        let local = Mat4::from_cols_array_2d(&node.transform().matrix());
        let (mut steps, step) = match (self, channels.pose(node)) {
            (NodeTransform::Still(outer), None) => return NodeTransform::Still(outer * local),
            (NodeTransform::Still(outer), Some(pose)) => (vec![Step::Fixed(affine(outer))], Step::Moving(pose)),
            (NodeTransform::Moving(steps), None) => (steps.clone(), Step::Fixed(affine(&local))),
            (NodeTransform::Moving(steps), Some(pose)) => (steps.clone(), Step::Moving(pose)),
        };
        match (steps.last_mut(), step) {
            // Long chains below what moves stay short.
            (Some(Step::Fixed(outer)), Step::Fixed(inner)) => *outer *= inner,
            (_, step) => steps.push(step),
        }
        NodeTransform::Moving(steps)
    }

    fn motion(&self, seconds: f32) -> Motion {
        let steps = match self {
            NodeTransform::Still(to_world) => vec![Step::Fixed(affine(to_world))],
            NodeTransform::Moving(steps) => steps.clone(),
        };
        Motion::new(steps, seconds)
    }
}

fn affine(matrix: &Mat4) -> DAffine3 {
    DAffine3::from_mat4(matrix.as_dmat4())
}

/// The scene while its nodes are walked.
struct Walk<'a> {
    file: File<'a>,
    channels: &'a Channels,
    content: DynamicContent,
    /// Where directional lights shine to; they get a place when the box of the scene is known.
    directional: Vec<Vec3>,
}

impl Walk<'_> {
    fn node(&mut self, node: &Node<'_>, placement: &NodeTransform) -> Result<()> {
        let motion = placement.motion(self.content.seconds);
        if let Some(mesh) = node.mesh() {
            self.content.skinned = self.content.skinned.or(node.skin().map(|_| node.index()));
            let parts = meshes::parts(self.file, &mesh)?;
            let weights = node.weights().or(mesh.weights()).unwrap_or_default();
            match (placement, self.channels.weights(node)) {
                (NodeTransform::Still(to_world), None) => {
                    parts.iter().try_for_each(|part| self.append(part, weights, to_world))?;
                }
                _ => self.object(node, &parts, weights, motion.clone())?,
            }
        }
        let to_world = match placement {
            NodeTransform::Still(to_world) => rows(&affine(to_world)),
            NodeTransform::Moving(_) => motion.at(0.0),
        };
        let (eye, backwards) = eye_and_backwards(&to_world);
        if self.content.camera.is_none()
            && let Some(camera) = node.camera()
            && let gltf::camera::Projection::Perspective(lens) = camera.projection()
            && backwards != Vec3::ZERO
            && eye.is_finite()
        {
            let fov = lens.yfov().to_degrees();
            self.content.camera = Some(match placement {
                NodeTransform::Still(_) => CameraPath::Still(carried(&to_world, fov)),
                NodeTransform::Moving(_) => CameraPath::Carried { motion, fov },
            });
        }
        match node.light().map(|light| self.light_type(light.index())) {
            Some(LightType::Directional) => self.directional.push(-backwards),
            Some(LightType::Point | LightType::Spot) => self.content.lights.push(point_light(eye)),
            None => {}
        }
        Ok(())
    }

    /// The crate's own `kind()` panics on a spot light without its angles.
    fn light_type(&self, light: usize) -> LightType {
        let lights = self.file.document.as_json().extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        match lights.and_then(|l| l.lights.get(light)).map(|l| &l.type_) {
            Some(Checked::Valid(kind)) => *kind,
            _ => LightType::Point,
        }
    }

    /// Adds a part that stands.
    fn append(&mut self, part: &Part, weights: &[f32], to_world: &Mat4) -> Result<()> {
        let mesh = &mut self.content.static_mesh;
        let first = mesh.positions.len();
        check::vertices_can_be_counted(&part.place, first + part.mesh.positions.len())?;
        let positions = morphed(&part.mesh.positions, &part.targets, weights).into_iter();
        mesh.append(positions.map(|p| to_world.transform_point3(p.into()).to_array()), &part.mesh.triangles);
        check::vertices_are_finite(format!("{}, placed by its node", part.place), &mesh.positions[first..])
    }

    /// Adds an object of all the parts of a node that moves or morphs.
    fn object(&mut self, node: &Node<'_>, parts: &[Part], weights: &[f32], motion: Motion) -> Result<()> {
        let mut whole = Mesh::default();
        let count = parts.iter().map(|part| part.targets.len()).max().unwrap_or_default();
        let mut targets = vec![Vec::new(); count];
        for Part { place, mesh, targets: its } in parts {
            let first = whole.positions.len();
            check::vertices_can_be_counted(place, first + mesh.positions.len())?;
            whole.append(mesh.positions.iter().copied(), &mesh.triangles);
            for (target, its) in targets.iter_mut().zip(its) {
                target.resize(first, [0.0; 3]);
                target.extend_from_slice(its);
            }
        }
        let Mesh { positions: base, triangles } = whole;
        if triangles.is_empty() {
            return Ok(());
        }
        let seconds = self.content.seconds;
        let shape = match self.channels.weights(node) {
            Some(weights) => Shape::Targets { base, targets, weights, seconds },
            None => Shape::Rigid(morphed(&base, &targets, weights)),
        };
        let name = node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned);
        self.content.objects.push(DynamicObject { name, triangles, shape, motion });
        Ok(())
    }

    /// The scene with its directional lights, far away.
    fn lit(self) -> DynamicContent {
        let Walk { mut content, directional, .. } = self;
        let bounds = content.static_mesh.bounds().union(&dynamic::bounds(&content.objects, [0.0]));
        let far = |towards: Vec3| Vec3::from(bounds.centroid()) - towards * (10.0 * bounds.diagonal());
        content.lights.extend(directional.into_iter().map(|towards| point_light(far(towards))));
        content.lights.retain(|light| light.corner.iter().all(|c| c.is_finite()));
        content
    }
}

fn point_light(corner: Vec3) -> Light {
    Light { corner: corner.into(), edges: [[0.0; 3]; 2] }
}
