//! What the animations of a document do to its nodes.
//!
//! All animations play at once, from 0 on, and over again when the longest is through. Where several move the same property of a
//! node, the first in the file counts, so that of a character's gaits one is taken.

use super::{CUT_OFF, File, has_type};
use crate::Result;
use crate::scene::check::malformed;
use crate::scene::dynamic::{Keys, Pose, Rotation, Track, Value};
use gltf::Node;
use gltf::accessor::{DataType, Dimensions, Iter};
use gltf::animation::util::ReadOutputs;
use gltf::animation::{Channel, Interpolation, Property};
use gltf::json::validation::Checked;
use std::collections::HashMap;

/// The animated properties of all nodes.
#[derive(Default)]
pub(super) struct Channels {
    nodes: HashMap<usize, Moved>,
    last: f32,
}

/// The animated properties of a node.
#[derive(Default)]
struct Moved {
    translation: Option<Track<[f32; 3]>>,
    rotation: Option<Track<Rotation>>,
    scale: Option<Track<[f32; 3]>>,
    weights: Option<Track<Vec<f32>>>,
}

impl Channels {
    /// Reads those of all animations.
    pub fn read(file: File<'_>) -> Result<Channels> {
        let mut channels = Channels::default();
        for animation in file.document.animations() {
            for channel in animation.channels() {
                channels.add(file, &channel).map_err(|what| {
                    let (path, animation) = (file.path.display(), animation.index());
                    malformed(format_args!("{path}: animation {animation}, channel {}", channel.index()), what)
                })?;
            }
        }
        Ok(channels)
    }

    /// How long it takes until all animations are through.
    pub fn seconds(&self) -> f32 {
        if self.last > 0.0 { self.last } else { 1.0 }
    }

    /// Where a node is in its parent, if an animation moves it.
    pub fn pose(&self, node: &Node<'_>) -> Option<Pose> {
        let Moved { translation, rotation, scale, .. } = self.nodes.get(&node.index())?;
        if translation.is_none() && rotation.is_none() && scale.is_none() {
            return None;
        }
        let (t, r, s) = node.transform().decomposed();
        let r = Rotation(r.map(f64::from)).unit().unwrap_or_default();
        Some(Pose {
            translation: translation.clone().unwrap_or_else(|| Track::still(t)),
            rotation: rotation.clone().unwrap_or_else(|| Track::still(r)),
            scale: scale.clone().unwrap_or_else(|| Track::still(s)),
        })
    }

    /// The weights of a node's morph targets, if they are animated.
    pub fn weights(&self, node: &Node<'_>) -> Option<Track<Vec<f32>>> {
        self.nodes.get(&node.index())?.weights.clone()
    }

    /// Adds what a channel does; the error says what is wrong with it.
    fn add(&mut self, file: File<'_>, channel: &Channel<'_>) -> Result<(), String> {
        // The crate looks neither whether the node is there nor whether the property is known.
        let target = &file.document.as_json().animations[channel.animation().index()].channels[channel.index()].target;
        let (node, nodes) = (target.node.value(), file.document.nodes().len());
        if node >= nodes {
            return Err(format!("moves node {node}, the file has {nodes}; is it cut off?"));
        }
        let Checked::Valid(property) = target.path else {
            return Err("moves neither translation, rotation, scale nor weights; export it without".into());
        };
        let targets =
            channel.target().node().mesh().and_then(|mesh| Some(mesh.primitives().next()?.morph_targets().len()));
        let moved = self.nodes.entry(node).or_default();
        let samples = Samples { file, channel };
        let last = match (property, targets) {
            (Property::Translation, _) => samples.set(&mut moved.translation, 3, |n| [n[0], n[1], n[2]]),
            (Property::Scale, _) => samples.set(&mut moved.scale, 3, |n| [n[0], n[1], n[2]]),
            (Property::Rotation, _) => {
                samples.set(&mut moved.rotation, 4, |n| Rotation([n[0], n[1], n[2], n[3]].map(f64::from)))
            }
            (Property::MorphTargetWeights, None | Some(0)) => {
                Err(format!("moves weights of node {node}, which has no morph targets; export it again"))
            }
            (Property::MorphTargetWeights, Some(targets)) => samples.set(&mut moved.weights, targets, <[f32]>::to_vec),
        }?;
        self.last = self.last.max(last);
        Ok(())
    }
}

/// The keys of a channel as they lie in the file.
struct Samples<'a> {
    file: File<'a>,
    channel: &'a Channel<'a>,
}

impl Samples<'_> {
    /// Makes a track of the keys, each value of `width` numbers, unless one is there already; gives the time of the last key.
    fn set<V: Value>(
        &self,
        track: &mut Option<Track<V>>,
        width: usize,
        value: impl Fn(&[f32]) -> V,
    ) -> Result<f32, String> {
        if track.is_some() {
            return Ok(0.0);
        }
        let (times, numbers) = (self.times()?, self.numbers()?);
        let interpolation = self.channel.sampler().interpolation();
        let values_a_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let keys = times.len();
        if numbers.len() != keys * values_a_key * width {
            let values = keys * values_a_key;
            return Err(format!(
                "has {} numbers for {keys} keys, {values} values of {width} are needed; is it cut off?",
                numbers.len()
            ));
        }
        let values: Vec<V> = numbers.chunks_exact(width).map(value).collect();
        let last = times[keys - 1];
        let settled = |v: &V| v.clone().settled().ok_or("has a rotation of no length; export it again");
        let keys = match interpolation {
            Interpolation::Step => Keys::Step(values.iter().map(settled).collect::<Result<_, _>>()?),
            Interpolation::Linear => Keys::Linear(values.iter().map(settled).collect::<Result<_, _>>()?),
            Interpolation::CubicSpline => {
                let key = |key: &[V]| Ok::<_, &str>([key[0].clone(), settled(&key[1])?, key[2].clone()]);
                Keys::Cubic(values.chunks_exact(3).map(key).collect::<Result<_, _>>()?)
            }
        };
        *track = Some(Track::new(times, keys));
        Ok(last)
    }

    fn times(&self) -> Result<Vec<f32>, String> {
        let accessor = self.channel.sampler().input();
        if !has_type(&accessor, Dimensions::Scalar, &[DataType::F32]) || accessor.count() == 0 {
            return Err("key times are not 32-bit floats, one or more; export it again".into());
        }
        let times: Vec<f32> = Iter::new(accessor, |buffer| self.file.bytes(buffer)).ok_or(CUT_OFF)?.collect();
        let ascend = times.is_sorted_by(|a, b| a < b) && times.iter().all(|t| t.is_finite() && *t >= 0.0);
        if ascend { Ok(times) } else { Err("key times do not ascend from 0 or later; export it again".into()) }
    }

    /// The numbers of all values, one behind the other.
    fn numbers(&self) -> Result<Vec<f32>, String> {
        let accessor = self.channel.sampler().output();
        let normalised = [DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16];
        let (dimensions, types) = match self.channel.target().property() {
            Property::Translation | Property::Scale => (Dimensions::Vec3, &normalised[..1]),
            Property::Rotation => (Dimensions::Vec4, &normalised[..]),
            Property::MorphTargetWeights => (Dimensions::Scalar, &normalised[..]),
        };
        if !has_type(&accessor, dimensions, types) || accessor.count() == 0 {
            return Err("key values are not of the type that glTF gives their property; export it again".into());
        }
        let outputs = self.channel.reader(|buffer| self.file.bytes(buffer)).read_outputs().ok_or(CUT_OFF)?;
        let numbers: Vec<f32> = match outputs {
            ReadOutputs::Translations(values) | ReadOutputs::Scales(values) => values.flatten().collect(),
            ReadOutputs::Rotations(values) => values.into_f32().flatten().collect(),
            ReadOutputs::MorphTargetWeights(values) => values.into_f32().collect(),
        };
        let is_sound = numbers.iter().all(|n| n.is_finite());
        if is_sound { Ok(numbers) } else { Err("a key value is not finite; export it again".into()) }
    }
}
