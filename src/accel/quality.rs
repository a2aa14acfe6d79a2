//! What build flags ask for: the method that makes a structure, its codes, its leaves.
//!
//! A flag changes the tree and never what rays hit. `PREFER_FAST_BUILD` sorts and joins, and nothing else. `PREFER_FAST_TRACE` merges
//! neighbours by surface area and moves subtrees to where they cost less, for about as long as a driver's build takes; its top levels
//! open instances. Without either, a build pays for what ten rays a triangle bring back.

use super::{ANY_HIT_ORDER, AccelOptions, REBRAID, Wide};
use crate::bvh::builder::{BuildOptions, Method, Primitives, Window};
use crate::bvh::child_order::ChildOrder;
use crate::bvh::codes::{CodeBounds, Codes};
use crate::bvh::reinsertion::ReinsertionOptions;
use crate::bvh::sah::Collapse;
use crate::bvh::wide::pairs::TRIANGLES_AT_MOST;
use crate::{Error, Result};
use ash::vk;

type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// Flags that a build may have.
const KNOWN: Flags = Flags::from_raw(
    Flags::ALLOW_UPDATE.as_raw()
        | Flags::ALLOW_COMPACTION.as_raw()
        | Flags::PREFER_FAST_TRACE.as_raw()
        | Flags::PREFER_FAST_BUILD.as_raw()
        | Flags::LOW_MEMORY.as_raw()
        | REBRAID.as_raw()
        | ANY_HIT_ORDER.as_raw(),
);

/// Primitives up to which a build without a preference is an LBVH: one workgroup makes it in one dispatch. Up to as many a fast trace
/// gets two passes of reinsertion, as opened instances want the nodes near the root good: they take 0.1 to 0.4 of the time of a driver's
/// fast trace (docs/notes/rays.md). Pairs of so few triangles save nothing.
const FEW: u32 = 2048;

/// Primitives from which on a bottom level without a preference has nodes of eight: of fewer, ten rays a triangle do not bring back what
/// they take.
const LARGE: u32 = 4096;

/// Entries of a top level that one node of eight holds: nothing comes of moving subtrees.
const ONE_NODE: u32 = 8;

/// Entries of a top level in nodes of eight up to which a quarter of a pass moves subtrees. Over more, builds with it took up to twice as
/// long as a driver's, and rays met 0.985 to 1.00 of what they meet without it (docs/notes/rays.md, "Many entries").
const MANY_ENTRIES: u32 = 1 << 14;

/// Records of wide structures, at most: what tracers can name of triangles, and fewer than the bits of an instance's record, above which
/// slots of a node lie.
const MOST_WIDE: u32 = TRIANGLES_AT_MOST;

/// Primitives up to which a fast trace gets one and a half passes of reinsertion, as a driver's build of few takes long, and up to which one;
/// of more it gets three quarters: what leaves a build no longer than a driver's on Mesa's lavapipe (docs/notes/memory.md).
const SOME: u32 = 1 << 15;
const MANY: u32 = 1 << 18;

const fn part_of_a_pass(part: u32, of: u32) -> ReinsertionOptions {
    ReinsertionOptions { rounds: ReinsertionOptions::FAST.rounds * part / of, ..ReinsertionOptions::FAST }
}

const MOST_OF_A_PASS: ReinsertionOptions = part_of_a_pass(3, 4);
const QUARTER_OF_A_PASS: ReinsertionOptions = part_of_a_pass(1, 4);

/// # Errors
/// Unknown flags, or two that exclude each other; codes that there are not.
pub(super) fn check(flags: Flags, options: &AccelOptions) -> Result<()> {
    for (field, codes) in [("bottom_codes", options.bottom_codes), ("top_codes", options.top_codes)] {
        if let Some(codes) = codes.filter(|codes| codes.with_bounds(codes.bounds) != Some(*codes)) {
            return Err(Error::Argument(format!(
                "{field} are {codes:?}, which there are not; take what Codes::with_bits and Codes::with_bounds give"
            )));
        }
    }
    if !KNOWN.contains(flags) {
        return Err(Error::Argument(format!("flags are {flags:?}; take some of {KNOWN:?}")));
    }
    if flags.contains(Flags::PREFER_FAST_TRACE | Flags::PREFER_FAST_BUILD) {
        return Err(Error::Argument("flags ask for a fast trace and for a fast build; take one".into()));
    }
    Ok(())
}

/// Entries of a top level over so many instances; `None` if none of them is opened, as an opened instance cannot be refitted, and one alone
/// overlaps no other.
pub(super) fn opened_to(flags: Flags, options: &AccelOptions, instance_count: u32) -> Option<u32> {
    let asked = flags.intersects(REBRAID | Flags::PREFER_FAST_TRACE) && !flags.contains(Flags::ALLOW_UPDATE);
    let opens = asked && options.rebraid_budget > 1.0 && instance_count > 1;
    // What is too much is refused by the builder.
    opens.then(|| (f64::from(instance_count) * f64::from(options.rebraid_budget)).ceil() as u32)
}

/// What the builder is asked for over so many primitives, or entries of a top level.
pub(super) fn build_options(flags: Flags, options: &AccelOptions, primitives: Primitives, count: u32) -> BuildOptions {
    let is_top = primitives == Primitives::Instances;
    let is_wide = is_wide(flags, options, primitives, count);
    let unpaired = BuildOptions {
        method: if is_top { Method::Lbvh } else { bottom_method(flags, count) },
        // Of two leaves there is nothing to move, and of those that are in one node of eight nothing comes of it.
        optimise: if is_top { top_optimise(flags, is_wide, count) } else { bottom_optimise(flags, count) }
            .filter(|_| count > if is_top && is_wide { ONE_NODE } else { 2 }),
        codes: Some(codes(flags, options, is_top, count)),
        bits_up_to: (is_top && options.top_codes.is_none()).then(|| top_bits(flags)),
        // An instance costs more than a node whatever its box: one a leaf.
        collapse: if is_top { Collapse::OFF } else { collapse(flags, is_wide) },
        child_order: flags.contains(ANY_HIT_ORDER).then_some(ChildOrder::MoreHitsForItsCost),
        primitives,
        build_flags: flags.as_raw() & 0x1f,
        ..BuildOptions::DEFAULT
    };
    BuildOptions { pairs: count > FEW && unpaired.can_pair(), ..unpaired }
}

/// Whether a structure gets quantised nodes of eight: they cannot be refitted.
pub(super) fn is_wide(flags: Flags, options: &AccelOptions, primitives: Primitives, count: u32) -> bool {
    let is_top = primitives == Primitives::Instances;
    let is_quick = if is_top { flags.contains(Flags::PREFER_FAST_BUILD) } else { is_quick(flags, count) };
    let is_asked = match options.wide {
        Wide::Never => false,
        Wide::ByFlags => flags.contains(Flags::PREFER_FAST_TRACE) || (!is_top && count >= LARGE),
        Wide::Always => true,
    };
    is_asked && !flags.contains(Flags::ALLOW_UPDATE) && count <= MOST_WIDE && !is_quick
}

/// Whether a bottom level is an LBVH.
fn is_quick(flags: Flags, count: u32) -> bool {
    flags.contains(Flags::PREFER_FAST_BUILD) || (!flags.contains(Flags::PREFER_FAST_TRACE) && count <= FEW)
}

/// Fewer primitives, of which another method or form may need more memory than `count` in that of `count`.
pub(super) fn fewer_of_another_form(
    flags: Flags,
    options: &AccelOptions,
    primitives: Primitives,
    count: u32,
) -> impl Iterator<Item = u32> {
    let options = *options;
    let entries_of = move |count| opened_to(flags, &options, count).unwrap_or(count);
    let made = move |count| match primitives {
        Primitives::Instances => {
            let entries = entries_of(count);
            let is_wide = is_wide(flags, &options, primitives, entries);
            (top_optimise(flags, is_wide, entries).filter(|_| entries > ONE_NODE).is_some(), is_wide)
        }
        _ => (is_quick(flags, count), is_wide(flags, &options, primitives, count)),
    };
    // The most instances that have at most so many entries: one has one, and more have more.
    let instances_of = |entries| {
        let (mut least, mut most) = (1, entries);
        while least < most {
            let middle = u32::midpoint(least, most + 1);
            if entries_of(middle) <= entries { least = middle } else { most = middle - 1 }
        }
        least
    };
    let fewer = match primitives {
        Primitives::Instances => [ONE_NODE, MANY_ENTRIES].map(instances_of),
        _ => [FEW, LARGE - 1],
    };
    fewer.into_iter().filter(move |&fewer| fewer < count && made(fewer) != made(count))
}

fn bottom_method(flags: Flags, count: u32) -> Method {
    if is_quick(flags, count) { Method::Lbvh } else { Method::Hploc(Window::DEFAULT) }
}

fn bottom_optimise(flags: Flags, count: u32) -> Option<ReinsertionOptions> {
    let rounds = match count {
        count if count <= FEW => ReinsertionOptions::MEDIUM,
        count if count <= SOME => part_of_a_pass(3, 2),
        count if count <= MANY => ReinsertionOptions::FAST,
        _ => MOST_OF_A_PASS,
    };
    flags.contains(Flags::PREFER_FAST_TRACE).then_some(rounds)
}

/// A top level has few entries and all rays go through it: most of a pass of reinsertion brings back more than it takes; with a whole one
/// some take longer than a driver's. Of what becomes nodes of eight a quarter brings back as much. H-PLOC before that would not gain more,
/// and a tree of opened instances less.
fn top_optimise(flags: Flags, is_wide: bool, entries: u32) -> Option<ReinsertionOptions> {
    let rounds = if is_wide { QUARTER_OF_A_PASS } else { MOST_OF_A_PASS };
    let is_moved = !(is_wide && entries > MANY_ENTRIES);
    (is_moved && !flags.contains(Flags::PREFER_FAST_BUILD)).then_some(rounds)
}

/// A fast build sorts by 8 bits less; low memory keeps codes in one word, which saves 8 bytes of scratch a primitive. What lies far from
/// the others would put them all into one cell of a top level: its bounds are robust, with what is far apart, so that rays begin at the rest.
fn codes(flags: Flags, options: &AccelOptions, is_top: bool, count: u32) -> Codes {
    if let Some(codes) = if is_top { options.top_codes } else { options.bottom_codes } {
        return codes;
    }
    let codes = Codes::for_count(count);
    let bits = if flags.contains(Flags::PREFER_FAST_BUILD) { codes.bits.saturating_sub(8).max(8) } else { codes.bits };
    let bounds = if is_top { CodeBounds::Apart } else { CodeBounds::Full };
    Codes { bounds, ..codes }.with_bits(if flags.contains(Flags::LOW_MEMORY) { bits.min(32) } else { bits })
}

/// The most bits of a top level's codes, where the device chooses.
fn top_bits(flags: Flags) -> u32 {
    if flags.contains(Flags::LOW_MEMORY) { 32 } else { 64 }
}

/// How subtrees are collapsed: where memory counts, tests are taken to be cheaper than they are, or in nodes of eight steps to be dearer, so
/// that leaves are larger and nodes fewer. In nodes of two compacted structures then have 56 to 59 bytes a triangle instead of 64 to 70 on eleven
/// scenes of twelve.
fn collapse(flags: Flags, is_wide: bool) -> Collapse {
    match (flags.intersects(Flags::ALLOW_COMPACTION | Flags::LOW_MEMORY), is_wide) {
        (true, true) | (false, false) => Collapse::SAH,
        (true, false) => Collapse { c_i: 1.25, ..Collapse::SAH },
        (false, true) => Collapse::WIDE,
    }
}
