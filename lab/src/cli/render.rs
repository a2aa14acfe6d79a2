//! `hedgerow render`: a picture of a scene, or of the work that its rays take.

use super::options::number;
use super::{Bar, Common, Size, work};
use crate::report::picture::{PictureOptions, View, picture};
use crate::scene::Scene;
use crate::subjects::builders::Spec;
use anyhow::Context;
use std::path::PathBuf;

/// Write a picture: the scene shaded, its normals or depth, heat maps of steps and tests a ray or of the size of leaves, or where
/// the planes of a kd-tree cut the surfaces
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a file, a bare name, or a generator
    scene: String,
    /// The builder with its options
    #[arg(short, long, value_name = "BUILDER")]
    builder: Spec,
    /// The PNG file
    #[arg(short, long, value_name = "IMAGE.png")]
    output: PathBuf,
    /// What it shows: shaded, normals, steps, tests, depth, leaf-size (of the leaf where a ray ends), or planes (of a kd-tree)
    #[arg(long, value_name = "VIEW", default_value = "shaded")]
    view: View,
    /// Pixels, without the legend of heat maps
    #[arg(long, value_name = "WxH", default_value = "960x720")]
    size: Size,
    /// Where the colours of a heat map end [default: what 99 of 100 pixels stay below]; of planes, the deepest level that is drawn
    /// [default: as deep as lines cover a fifth of the surface]
    #[arg(long, value_name = "VALUE", value_parser = number("a number above zero", |n| n > 0.0 && n.is_finite()))]
    top: Option<f32>,
    /// When a dynamic scene is seen, in seconds [default: 0]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, conflicts_with = "frame", value_parser = number("a time; write seconds, as in 1.5", f32::is_finite))]
    time: Option<f32>,
    /// Which of its frames is seen, from 0
    #[arg(long, value_name = "K")]
    frame: Option<u32>,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    if !arguments.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let name = arguments.output.display();
        return Err(
            crate::Error::Argument(format!("{name}: pictures are PNG files; name one that ends in .png")).into()
        );
    }
    let scene = scene(common, arguments)?;
    let builders = std::slice::from_ref(&arguments.builder);
    let device = work::device_for(common, builders)?;
    let bar = Bar::new(common, "building", 0);
    let mut subject = arguments.builder.make_for(device.as_ref(), &scene)?;
    arguments.view.check(subject.as_ref())?;
    subject.build()?;
    bar.say("tracing");
    let options = PictureOptions {
        view: arguments.view,
        size: [arguments.size.width, arguments.size.height],
        seed: common.seed,
        top: arguments.top,
    };
    let image = picture(&scene, subject.as_mut(), &options)?;
    drop(bar);
    let path = &arguments.output;
    image.save(path).with_context(|| format!("{} cannot be written; check the folder", path.display()))?;
    drop(subject);
    work::finish(device.as_ref(), true)
}

/// The scene, at the time or in the frame that is asked for.
fn scene(common: &Common, arguments: &Arguments) -> crate::Result<Scene> {
    if arguments.time.is_none() && arguments.frame.is_none() {
        return common.load(&arguments.scene);
    }
    let dynamic = common.load_dynamic(&arguments.scene)?;
    let frame = arguments.frame.unwrap_or_default();
    if frame >= dynamic.frames {
        let (name, frames) = (&dynamic.name, dynamic.frames);
        let what = format!("--frame {frame}: {name} has {frames}, counted from 0; take an earlier one");
        return Err(crate::Error::Argument(what));
    }
    let mut scene = dynamic.at(arguments.time.unwrap_or_else(|| dynamic.time_of(frame)))?;
    common.aim(&mut scene.camera);
    Ok(scene)
}
