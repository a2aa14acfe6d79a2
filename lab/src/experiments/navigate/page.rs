//! The page: for each tree a stage, a slider, and the figures of its levels.

use super::projection::UNITS;
use super::{Navigator, Tree};
use crate::experiments::navigate::outline::OutlineLevel;
use crate::measure::provenance;
use crate::report::elements::{self, bar, foot, number, scroll};
use crate::report::numbers::{grouped, three_digits};
use crate::report::{short, slug};
use crate::scene::Scene;
use crate::subjects::KD_TREE;
use crate::{Error, Result};
use base64::prelude::{BASE64_STANDARD, Engine};
use image::RgbImage;
use maud::{Markup, PreEscaped, html};

const SCRIPT: &str = include_str!("navigate.js");
/// The level that is shown first: few boxes, and their shape to be seen.
const FIRST: usize = 4;

pub(super) fn page(navigator: &Navigator<'_>, links: &Markup) -> Result<String> {
    let picture = format!("--picture:url({})", inside(&navigator.picture)?);
    let Navigator { scene: Scene { name: scene, mesh, .. }, trees, .. } = navigator;
    let body = html! {
        @if let Some(tree) = trees.first() { a.skip href={ "#" (id(tree)) } { "Skip to the first tree" } }
        header.hero {
            p.kicker { "hedgerow navigate" }
            h1 { (scene) ", level by level" }
            p.lead {
                "The boxes of each level of " (trees.len()) @if trees.len() == 1 { " tree" } @else { " trees" } " over "
                (grouped(mesh.triangles.len() as u64)) " triangles, from the root down to the leaves."
            }
            p.command { span { "Made by" } code { (provenance::command()) } }
        }
        nav aria-label="Sections" {
            @for tree in trees { a href={ "#" (id(tree)) } { (short(&tree.builder)) } }
            a href="#method" { "What is drawn" }
            (links)
        }
        main style=(picture) {
            @for tree in trees { (section(navigator, tree)) }
            (method(navigator))
        }
        (foot(&provenance::commit(), &provenance::now()))
        script { (PreEscaped(SCRIPT)) }
    };
    Ok(elements::page(&format!("hedgerow: trees of {scene}, level by level"), &body))
}

fn id(tree: &Tree) -> String {
    format!("tree-{}", slug(&tree.builder))
}

fn section(navigator: &Navigator<'_>, tree: &Tree) -> Markup {
    let nodes: u64 = tree.levels.iter().map(|(level, _)| level.nodes()).sum();
    let cost: f64 = tree.levels.iter().map(|(level, _)| level.cost).sum();
    html! {
        section #(id(tree)) .navigator {
            h2 {
                (short(&tree.builder))
                span.count { (grouped(nodes)) @if tree.kind == KD_TREE { " cells" } @else { " boxes" } ", SAH cost " (three_digits(cost)) }
            }
            @if tree.levels.is_empty() { p { "The tree is empty." } } @else {
                (stage(navigator, tree))
                (table(tree, cost))
            }
        }
    }
}

fn stage(navigator: &Navigator<'_>, tree: &Tree) -> Markup {
    let (width, height) = navigator.picture.dimensions();
    let [wide, high] = [width, height].map(|side| f64::from(side) * UNITS);
    let last = tree.levels.len() - 1;
    let first = FIRST.min(last);
    html! {
        figure.stage {
            svg viewBox={ "0 0 " (wide) " " (high) } role="img" aria-label={ "Boxes of a level of " (tree.builder) ", over " (navigator.scene.name) } {
                @for (i, (level, drawing)) in tree.levels.iter().enumerate() {
                    g .now[i == first] data-level=(i) data-says=(says(i, level, drawing.drawn)) {
                        @if !drawing.unseen.is_empty() { path.unseen d=(drawing.unseen) {} }
                        @if !drawing.inner.is_empty() { path.inner d=(drawing.inner) {} }
                        @if !drawing.empty.is_empty() { path.empty d=(drawing.empty) {} }
                        @if !drawing.leaves.is_empty() { path.leaf d=(drawing.leaves) {} }
                    }
                }
            }
            figcaption {
                span.step {
                    button type="button" data-by="-1" aria-label="Up a level" { "−" }
                    input type="range" min="0" max=(last) value=(first) aria-label={ "Level of " (tree.builder) };
                    button type="button" data-by="1" aria-label="Down a level" { "+" }
                }
                output { (says(first, &tree.levels[first].0, tree.levels[first].1.drawn)) }
                span.key {
                    span.inner { "inner" } span.leaf { "leaf" } span.unseen { "nothing seen in it" }
                    @if tree.kind == KD_TREE { span.empty { "empty leaf" } }
                }
            }
        }
    }
}

/// A level in words.
fn says(i: usize, level: &OutlineLevel, drawn: usize) -> String {
    let nodes = level.nodes();
    let all = if drawn as u64 == nodes { ", all drawn".into() } else { format!(", {} drawn", grouped(drawn as u64)) };
    format!("Level {i}: {} node{}{all}", grouped(nodes), if nodes == 1 { "" } else { "s" })
}

fn table(tree: &Tree, cost: f64) -> Markup {
    let is_kd_tree = tree.kind == KD_TREE;
    let share = |level: &OutlineLevel| if cost > 0.0 { 100.0 * level.cost / cost } else { 0.0 };
    let most = tree.levels.iter().map(|(level, _)| share(level)).fold(0.0, f64::max);
    let count = |value: u64| number(Some(value as f64), |v| grouped(v as u64));
    let above = tree.levels.iter().scan(0.0, |sum, (level, _)| {
        *sum += share(level);
        Some(*sum)
    });
    scroll(
        &format!("Levels of {}", tree.builder),
        html! {
            table {
                caption.hidden { "Figures of each level" }
                thead { tr {
                    th.plain scope="col" { "level" }
                    th.plain.number scope="col" { "nodes" } th.plain.number scope="col" { "inner" } th.plain.number scope="col" { "leaves" }
                    @if is_kd_tree { th.plain.number scope="col" { "empty" } }
                    th.plain.number scope="col" { @if is_kd_tree { "references" } @else { "triangles" } }
                    th.plain.number scope="col" { "a leaf" }
                    th.plain.number scope="col" { "of the cost " small { "%" } } th.plain.number scope="col" { "down to here " small { "%" } }
                    th.plain.number scope="col" { "drawn" }
                } }
                tbody {
                    @for ((i, (level, drawing)), above) in tree.levels.iter().enumerate().zip(above) {
                        @let full = level.leaves - level.empty_leaves;
                        tr .now[i == FIRST.min(tree.levels.len() - 1)] data-level=(i) {
                            th scope="row" { button type="button" { (i) } }
                            (count(level.nodes())) (count(level.inner)) (count(level.leaves))
                            @if is_kd_tree { (count(level.empty_leaves)) }
                            (count(level.refs))
                            (number((full > 0).then(|| level.refs as f64 / full as f64), |v| format!("{v:.2}")))
                            (bar(Some(share(level)), most))
                            (number(Some(above), |v| format!("{v:.1}")))
                            (count(drawing.drawn as u64))
                        }
                    }
                }
            }
        },
    )
}

fn method(navigator: &Navigator<'_>) -> Markup {
    let [c_t, c_i] = navigator.costs;
    html! {
        section #method {
            h2 { "What is drawn" }
            dl.terms {
                dt { "Boxes" }
                dd {
                    "Of a BVH the boxes of its nodes, which overlap and need not fill space; of a kd-tree its cells, which do not and do. All "
                    "edges, those too that are behind something; faint where nothing that is seen lies in the box."
                }
                dt { "Drawn" }
                dd {
                    "Of a level with too many boxes those in which most of what is seen lies, and of equals the larger. Boxes outside of the "
                    "picture are not drawn."
                }
                dt { "Of the cost" }
                dd {
                    "What a level adds to the SAH cost of the tree: (" (c_t) " · Σ area of inner nodes + " (c_i)
                    " · Σ area × triangles of leaves) / area of the root."
                }
                dt { "A leaf" } dd { "Triangles in a leaf that has any, on average." }
            }
        }
    }
}

/// A picture as an address that holds all of it.
fn inside(picture: &RgbImage) -> Result<String> {
    let mut png = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut png, image::ImageFormat::Png)
        .map_err(|error| Error::Chart { chart: "the picture of the scene".into(), reason: error.to_string() })?;
    Ok(format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png.get_ref())))
}
