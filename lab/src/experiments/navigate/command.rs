//! `hedgerow navigate`: a page that steps through trees level by level, over a picture of the scene.

use crate::cli::options::{Builders, Costs, Size};
use crate::cli::{Bar, Common, work};
use crate::experiments::navigate::{NavigateOptions, Navigator, Tree};
use crate::rays::kinds::RayOptions;
use crate::report::picture::{PictureOptions, View, picture};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Write a page that steps through trees level by level, their boxes drawn over a picture of the scene
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a file, a bare name, or a generator
    scene: String,
    /// Builders with their options, separated by commas
    #[arg(short, long, value_name = "BUILDER[,BUILDER…]")]
    builder: Builders,
    /// Pixels of the picture
    #[arg(long, value_name = "WxH", default_value = "960x720")]
    size: Size,
    /// Boxes that are drawn of a level at most: those that most of what is seen lies in
    #[arg(long, value_name = "N", default_value = "400")]
    boxes: NonZeroUsize,
    /// Costs of a traversal step and of a triangle test in the SAH
    #[arg(long, value_name = "C_T,C_I", default_value = "3,2")]
    costs: Costs,
    /// The folder for navigate-SCENE.html; pages of other commands there are linked
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let builders = &common.builders(&arguments.builder.0);
    let scene = common.load(&arguments.scene)?;
    let device = work::device_for(common, builders)?;
    let bar = Bar::new(common, &scene.name, 0);
    let options = NavigateOptions {
        rays: arguments.size.rays(common.seed),
        boxes: arguments.boxes.get(),
        costs: [arguments.costs.step, arguments.costs.test],
    };
    let (mut shaded, mut trees) = (None, Vec::new());
    for builder in builders {
        bar.say(&builder.to_string());
        let mut subject = builder.make_for(device.as_ref(), &scene)?;
        subject.build()?;
        trees.push(Tree::of(&scene, subject.as_mut(), &options)?);
        if shaded.is_none() {
            let RayOptions { size, seed } = options.rays;
            let options = PictureOptions { view: View::Shaded, size, seed, top: None };
            shaded = Some(picture(&scene, subject.as_mut(), &options)?);
        }
    }
    let navigator = Navigator { scene: &scene, picture: shaded.unwrap_or_default(), trees, costs: options.costs };
    drop(bar);
    writeln!(std::io::stdout().lock(), "{}", navigator.write(&arguments.output)?.display())?;
    work::finish(device.as_ref(), true)
}
