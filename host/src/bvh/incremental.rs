//! Incremental construction: one primitive after the other is put where it costs least, and after each batch the worst of the
//! nodes that it has changed are taken out and their children put in again.
//!
//! Bittner, Hapala, Havran 2015, "Incremental BVH Construction for Ray Tracing"; Frantál 2019, section 3.5. Two primitives that
//! follow each other and lie close together are put in as one subtree. What the papers leave open:
//!
//! - A pair is tried from the first primitive that is not in one yet.
//! - Marked are all nodes above what was put in, up to the root. The fraction that is taken out is one of the marked nodes.
//! - Where [`IncrementalOptions::search`] is more than 1, that many subtrees look for their places at once, on the tree as it is, and
//!   are put in one after the other. One whose place was taken meanwhile goes on looking below it. The tree is another one then, but
//!   the same for any number of threads.

use super::bounds::{Bounds, Item};
use super::insertion::{
    Inefficiency, InsertionTree, Link, ROOT, Search, Selection, check_fraction, part_of, reinsert, shuffle,
};
use super::topology::Topology;
use hedgerow::{Error, Result};
use rayon::prelude::*;

/// How a tree grows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IncrementalOptions {
    /// How many primitives are put in between two optimisations, at least 1.
    pub batch: u32,
    /// The part of the changed nodes that are taken out behind a batch, more than 0 and at most 1.
    pub fraction: f32,
    /// Two primitives are put in together if the area around both is less than this times the sum of theirs; 0 for never.
    pub coherence: f32,
    /// Which primitive comes first.
    pub order: IncrementalOrder,
    /// How many subtrees look for their places at once: 1 to [`IncrementalOptions::MOST_SEARCHES`].
    pub search: u32,
}

/// The order in which primitives are put in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IncrementalOrder {
    /// That of the input.
    File,
    /// One that looks random, and is the same each time.
    Shuffled,
}

impl IncrementalOptions {
    /// The paper's.
    pub const PAPER: IncrementalOptions =
        IncrementalOptions { batch: 8000, fraction: 0.01, coherence: 1.5, order: IncrementalOrder::File, search: 1 };
    /// More searches at once than this are not possible.
    pub const MOST_SEARCHES: u32 = 1 << 16;

    /// Whether they can be used.
    ///
    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        let IncrementalOptions { batch, fraction, coherence, search, .. } = *self;
        check_fraction(fraction)?;
        if batch == 0 {
            return Err(Error::Argument("a batch of 0 primitives cannot be used; take 1 or more primitives".into()));
        }
        if coherence.is_nan() || coherence < 0.0 {
            return Err(Error::Argument(format!("a coherence of {coherence} cannot be used; take 0 or more")));
        }
        if !(1..=IncrementalOptions::MOST_SEARCHES).contains(&search) {
            let most = IncrementalOptions::MOST_SEARCHES;
            return Err(Error::Argument(format!("{search} searches at once are not possible; take 1 to {most}")));
        }
        Ok(())
    }
}

/// The tree over the primitives of `items`.
pub(super) fn build(items: &[Item], options: &IncrementalOptions) -> Topology {
    let mut shuffled;
    let items = match options.order {
        IncrementalOrder::File => items,
        IncrementalOrder::Shuffled => {
            shuffled = items.to_vec();
            shuffle(&mut shuffled);
            &shuffled
        }
    };
    let mut grown = Grown::new(items.len());
    let mut rest = items;
    let mut searches = vec![Search::default()];
    let mut selection = Selection::default();
    while !rest.is_empty() {
        let mut left_in_batch = options.batch as usize;
        while left_in_batch > 0 && !rest.is_empty() {
            let before = rest.len();
            grown.insert_next(&mut rest, options, &mut searches);
            left_in_batch = left_in_batch.saturating_sub(before - rest.len());
        }
        grown.optimise(options.fraction, &mut searches[0], &mut selection);
    }
    grown.tree.topology()
}

/// A tree that grows.
struct Grown {
    tree: InsertionTree,
    /// The nodes from this one on are free.
    used: u32,
    /// Nodes that have changed since the last optimisation: a list, and for each node whether it is in it. Where a node is, all
    /// above it are.
    marked: Vec<u32>,
    is_marked: Vec<bool>,
    /// Room for those that look for places at once.
    group: Vec<Item>,
    /// Where each of them found one, and what hung there.
    places: Vec<(Link, u32)>,
}

impl Grown {
    fn new(count: usize) -> Grown {
        let tree = InsertionTree::with_room(count);
        let is_marked = vec![false; tree.room()];
        Grown { tree, used: 0, marked: Vec::new(), is_marked, group: Vec::new(), places: Vec::new() }
    }

    /// Puts in the first of `rest`, or as many subtrees as are to look for places at once.
    fn insert_next(&mut self, rest: &mut &[Item], options: &IncrementalOptions, searches: &mut Vec<Search>) {
        // In a tree that is not large beside what is put into it, all would find the same few places.
        let is_large = self.tree.at(ROOT).weight() > 16 * options.search;
        if options.search == 1 || !is_large {
            let Some(item) = self.next_subtree(rest, options.coherence) else { return };
            let link = if self.tree.at(ROOT).weight() > 0 { searches[0].best_link(&self.tree, &item) } else { ROOT };
            return self.put_in(item, link);
        }
        self.group.clear();
        while self.group.len() < options.search as usize {
            let Some(item) = self.next_subtree(rest, options.coherence) else { break };
            self.group.push(item);
        }
        self.places.resize(self.group.len(), (ROOT, 0));
        self.find_places(searches);
        for at in 0..self.group.len() {
            let (item, (link, was)) = (self.group[at], self.places[at]);
            let is_taken = self.id_at(link) != was;
            let link = if is_taken { searches[0].best_link_below(&self.tree, &item, link) } else { link };
            self.put_in(item, link);
        }
    }

    /// What hangs at a link: a leaf or a node, and which.
    fn id_at(&self, link: Link) -> u32 {
        let item = self.tree.at(link);
        item.primitive() << 1 | u32::from(item.weight() > 1)
    }

    /// Places of the group in the tree as it is.
    fn find_places(&mut self, searches: &mut Vec<Search>) {
        let pieces = rayon::current_num_threads().min(self.group.len()).max(1);
        if searches.len() < pieces {
            searches.resize_with(pieces, Search::default);
        }
        let size = self.group.len().div_ceil(pieces).max(1);
        let mut places = std::mem::take(&mut self.places);
        let work = places.par_chunks_mut(size).zip(self.group.par_chunks(size)).zip(searches.par_iter_mut());
        work.for_each(|((places, items), search)| {
            for (place, item) in places.iter_mut().zip(items) {
                let link = search.best_link(&self.tree, item);
                *place = (link, self.id_at(link));
            }
        });
        self.places = places;
    }

    /// The first item, or the first two as one subtree if they lie close together.
    fn next_subtree(&mut self, rest: &mut &[Item], coherence: f32) -> Option<Item> {
        let (&first, behind) = rest.split_first()?;
        *rest = behind;
        let Some((&second, behind)) = behind.split_first() else { return Some(first) };
        let area = |bounds: Bounds| bounds.half_area();
        let around = area(first.bounds().union(second.bounds()));
        let sum = area(first.bounds()) + area(second.bounds());
        // Points and lines are close: their areas say nothing.
        if !(around < coherence * sum || (around == 0.0 && coherence > 0.0)) {
            return Some(first);
        }
        *rest = behind;
        let free = self.free_node();
        Some(self.tree.join([first, second], free))
    }

    fn free_node(&mut self) -> u32 {
        self.used += 1;
        self.used - 1
    }

    fn put_in(&mut self, item: Item, link: Link) {
        let is_first = self.tree.at(ROOT).weight() == 0;
        let node = if is_first { 0 } else { self.free_node() };
        self.tree.put_in(item, link, node);
        if item.weight() > 1 {
            self.mark(item.primitive());
        } else if !is_first {
            self.mark(node);
        }
    }

    fn mark(&mut self, node: u32) {
        let Grown { tree, marked, is_marked, .. } = self;
        for node in tree.path(node) {
            if std::mem::replace(&mut is_marked[node as usize], true) {
                break;
            }
            marked.push(node);
        }
    }

    /// Reinserts the worst nodes of those that are marked, and forgets the marks.
    fn optimise(&mut self, fraction: f32, search: &mut Search, selection: &mut Selection) {
        let wanted = part_of(self.marked.len(), fraction);
        for node in selection.worst_of(&self.tree, Inefficiency::Combined, &self.marked, wanted) {
            reinsert(&mut self.tree, node, search);
        }
        for node in self.marked.drain(..) {
            self.is_marked[node as usize] = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_their_ranges_are_refused() {
        let paper = IncrementalOptions::PAPER;
        assert!(paper.check().is_ok());
        for (options, says) in [
            (IncrementalOptions { batch: 0, ..paper }, "take 1 or more primitives"),
            (IncrementalOptions { fraction: 1.5, ..paper }, "more than 0 and at most 1"),
            (IncrementalOptions { coherence: f32::NAN, ..paper }, "take 0 or more"),
            (IncrementalOptions { search: 0, ..paper }, "take 1 to 65536"),
        ] {
            let error = options.check().expect_err("wrong").to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
