//! A page that steps through the trees of a scene level by level, their boxes drawn over a picture of it: what the structure
//! navigator of Papay 2025 (section 8.7) does in a window.
//!
//! One file that opens from the disk, the picture inside.

mod boxes;
pub(crate) mod command;
pub mod outline;
mod page;
mod projection;

use crate::experiments::navigate::outline::{Outline, OutlineLevel};
use crate::rays::kinds::{self, RayKind, RayOptions};
use crate::report::{beside, slug};
use crate::scene::Scene;
use crate::subjects::Subject;
use crate::{Error, Result};
pub use boxes::Drawing;
use hedgerow::trace::Query;
use image::RgbImage;
use projection::Projection;
use std::path::{Path, PathBuf};

/// A tree to step through.
#[derive(Debug, Clone)]
pub struct Tree {
    /// Builder with its options.
    pub builder: String,
    /// The layout, as records have it.
    pub kind: String,
    /// Figures of each level, and what is drawn of it.
    pub levels: Vec<(OutlineLevel, Drawing)>,
}

/// How trees are drawn.
#[derive(Debug, Clone, Copy)]
pub struct NavigateOptions {
    /// Pixels of the picture, and the seed of its rays to the sky.
    pub rays: RayOptions,
    /// Boxes that are drawn of a level at most.
    pub boxes: usize,
    /// Costs of a step and of a test.
    pub costs: [f64; 2],
}

/// Everything that the page says.
#[derive(Debug, Clone)]
pub struct Navigator<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The scene, shaded.
    pub picture: RgbImage,
    /// The trees.
    pub trees: Vec<Tree>,
    /// Costs of a step and of a test.
    pub costs: [f64; 2],
}

impl Tree {
    /// The tree of a subject that has been built. Of a level with more boxes than are drawn, those are that most of what is seen
    /// lies in.
    ///
    /// # Errors
    /// The device failed; the tree is not ours to read.
    pub fn of(scene: &Scene, subject: &mut dyn Subject, options: &NavigateOptions) -> Result<Tree> {
        let outline = Outline::of(subject)?;
        // Every other pixel each way: enough to say which boxes are seen.
        let rays = RayOptions { size: options.rays.size.map(|side| side.div_ceil(2)), ..options.rays };
        let rays = kinds::generate(RayKind::Primary, scene, &rays, &mut |_| Ok(Vec::new()))?;
        let seen = boxes::seen(&outline, &rays, &subject.hits_of(&rays, Query::ClosestHit)?);
        let projection = Projection::of(&scene.camera, options.rays.size);
        let [c_t, c_i] = options.costs;
        let figures = outline.figures(c_t, c_i);
        let drawings =
            outline.levels.iter().map(|nodes| Drawing::of(&outline, nodes.clone(), &seen, &projection, options.boxes));
        let levels = figures.into_iter().zip(drawings).collect();
        Ok(Tree { builder: subject.builder().to_owned(), kind: subject.kind().to_owned(), levels })
    }
}

impl Navigator<'_> {
    /// Writes the page into `folder`, and gives its path. It names the other pages that lie there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
        let file = beside::navigator_of(&slug(&self.scene.name));
        let path = folder.join(&file);
        let page = page::page(self, &beside::links(folder, &file))?;
        std::fs::write(&path, page).map_err(Error::file(&path))?;
        Ok(path)
    }
}
