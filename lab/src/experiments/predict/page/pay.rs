//! Build time of every tree beside what its rays gain, and how many rays a build pays for.

use super::super::record::short;
use crate::experiments::predict::pay::{Gain, Pays, RayGain, gains};
use crate::experiments::predict::record::TreeRecord;
use crate::measure::geometric_mean;
use crate::report::elements::number;
use crate::report::numbers::{duration, one_decimal, three_digits, two_decimals, whole};
use crate::report::{Table, distinct};
use crate::subjects::retraced::TreeTracer;
use maud::{Markup, html};

/// A builder over all scenes.
struct Mean<'r> {
    builder: &'r str,
    build: Option<f64>,
    /// By each tracer: time of a ray over the reference's, and on how many scenes it is faster, and of how many.
    rays: [Option<(f64, [usize; 2])>; 2],
}

fn means<'r>(all: &[Gain<'r>]) -> Vec<Mean<'r>> {
    let of = |builder: &'r str| {
        let own: Vec<&Gain<'_>> = all.iter().filter(|gain| gain.tree.builder == builder).collect();
        let rays = [0, 1].map(|tracer| {
            let of_tracer: Vec<&RayGain> = own.iter().filter_map(|gain| gain.rays[tracer].as_ref()).collect();
            let ratio = geometric_mean(of_tracer.iter().map(|gain| gain.ns / (gain.ns + gain.less)))?;
            let is_faster = |gain: &&&RayGain| matches!(gain.pays, Pays::AtOnce | Pays::From(_));
            Some((ratio, [of_tracer.iter().filter(is_faster).count(), of_tracer.len()]))
        });
        Mean { builder, build: geometric_mean(own.iter().map(|gain| gain.build)), rays }
    };
    distinct(all.iter().map(|gain| gain.tree.builder.as_str())).into_iter().map(of).collect()
}

/// A cell with the rays from which on a build pays, sorted by them.
fn pays(gain: Option<&RayGain>) -> Markup {
    let Some(gain) = gain else { return number(None, whole) };
    let place = match gain.pays {
        Pays::AtOnce => 0.0,
        Pays::From(rays) => rays,
        Pays::Unclear => 1e17,
        Pays::UpTo(rays) => 1e18 - rays.min(9e17),
        Pays::Never => 1e18,
    };
    html! { td.number data-value=(place) { (gain.pays.in_words()) } }
}

pub(super) fn section(records: &[TreeRecord]) -> Markup {
    let all = gains(records);
    let Some(reference) = all.first().map(|gain| &gain.tree.reference) else {
        return html! { p { "There is no tree beside the reference." } };
    };
    let means = means(&all);
    let mut over_scenes = Table::new("Builders over all scenes", &means)
        .name("builder", |mean| short(mean.builder))
        .number("build", "× reference", |mean| mean.build, two_decimals);
    let mut table = Table::new("Builds and what they pay for", &all)
        .name("scene", |gain| &gain.tree.scene)
        .text("builder", |gain| short(&gain.tree.builder))
        .number("build", "ms", |gain| Some(gain.tree.build_ms.median), three_digits)
        .number("build", "× reference", |gain| Some(gain.build), two_decimals);
    for (at, tracer) in
        TreeTracer::ALL.into_iter().enumerate().filter(|(at, _)| all.iter().any(|gain| gain.rays[*at].is_some()))
    {
        over_scenes = over_scenes
            .number(
                "rays",
                &format!("× reference, {}", tracer.name()),
                move |mean| Some(mean.rays[at]?.0),
                two_decimals,
            )
            .text(&format!("faster on, {}", tracer.name()), move |mean| {
                mean.rays[at].map_or_else(|| "–".into(), |(_, [faster, scenes])| format!("{faster} of {scenes}"))
            });
        table = table
            .number("gain", &format!("ns a ray, {}", tracer.name()), move |gain| Some(gain.rays[at]?.less), one_decimal)
            .figure("pays", &format!("rays a build, {}", tracer.name()), move |gain| pays(gain.rays[at].as_ref()));
    }
    let of_reference = records.iter().filter(|record| record.is_reference());
    html! {
        p { "Against " b { (short(reference)) } ", which builds in "
            @for (i, record) in of_reference.enumerate() {
                @if i > 0 { ", " } (duration(record.build_ms.median)) " (" (record.scene) ")"
            }
            ". Times of a ray are those of all kinds together." }
        (over_scenes.html())
        h3 { "By scene" }
        (table.html())
    }
}
