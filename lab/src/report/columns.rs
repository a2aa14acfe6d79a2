//! Tables of a page: each column says once what it is called and what its cells hold.

use super::elements::{number, scroll};
use crate::measure::statistics::Spread;
use maud::{Markup, html};

/// A table over rows of a kind, which is sorted by pressing a heading.
pub struct Table<'a, R> {
    label: String,
    caption: Option<&'a str>,
    id: Option<&'a str>,
    rows: Vec<R>,
    columns: Vec<(Markup, Cell<'a, R>)>,
}

/// The cell of a row.
type Cell<'a, R> = Box<dyn Fn(&R) -> Markup + 'a>;

impl<'a, R> Table<'a, R> {
    /// With its label, for those who cannot see it; no columns yet.
    pub fn new(label: impl Into<String>, rows: impl IntoIterator<Item = R>) -> Self {
        Table { label: label.into(), caption: None, id: None, rows: rows.into_iter().collect(), columns: Vec::new() }
    }

    /// With an identifier, for links and scripts.
    pub fn id(self, id: &'a str) -> Self {
        Table { id: Some(id), ..self }
    }

    /// With a caption that is not its label.
    pub fn caption(self, caption: &'a str) -> Self {
        Table { caption: Some(caption), ..self }
    }

    /// What the row is called.
    pub fn name<T: ToString>(self, heading: &str, of: impl Fn(&R) -> T + 'a) -> Self {
        self.cell(heading, move |row| {
            let name = of(row).to_string();
            html! { th scope="row" data-value=(name) { (name) } }
        })
    }

    /// A word.
    pub fn text<T: ToString>(self, heading: &str, of: impl Fn(&R) -> T + 'a) -> Self {
        self.cell(heading, move |row| {
            let text = of(row).to_string();
            html! { td data-value=(text) { (text) } }
        })
    }

    /// Cells of any kind.
    pub fn cell(self, heading: &str, of: impl Fn(&R) -> Markup + 'a) -> Self {
        self.column(heading, "", false, of)
    }

    /// A figure; a dash where it was not measured.
    pub fn number(
        self,
        heading: &str,
        unit: &str,
        of: impl Fn(&R) -> Option<f64> + 'a,
        text: fn(f64) -> String,
    ) -> Self {
        self.figure(heading, unit, move |row| number(of(row), text))
    }

    /// The median of a spread, its least and greatest below.
    pub fn spread(
        self,
        heading: &str,
        unit: &str,
        of: impl Fn(&R) -> Option<Spread> + 'a,
        text: fn(f64) -> String,
    ) -> Self {
        self.figure(heading, unit, move |row| match of(row) {
            Some(Spread { median, min, max, .. }) => html! {
                td.number data-value=(median) { (text(median)) small { (text(min)) " – " (text(max)) } }
            },
            None => number(None, text),
        })
    }

    /// Cells with figures of any kind.
    pub fn figure(self, heading: &str, unit: &str, of: impl Fn(&R) -> Markup + 'a) -> Self {
        self.column(heading, unit, true, of)
    }

    /// A column, whose heading sorts it when pressed.
    fn column(mut self, name: &str, unit: &str, is_number: bool, of: impl Fn(&R) -> Markup + 'a) -> Self {
        let heading = html! {
            th scope="col" .number[is_number] aria-sort="none" {
                button type="button" { (name) @if !unit.is_empty() { " " small { (unit) } } }
            }
        };
        self.columns.push((heading, Box::new(of)));
        self
    }

    /// The table.
    pub fn html(self) -> Markup {
        self.with_context(std::iter::empty())
    }

    /// The table with rows below that are context, which is not sorted.
    pub fn with_context(self, context: impl Iterator<Item = Markup>) -> Markup {
        let mut context = context.peekable();
        let table = html! {
            table.sortable id=[self.id] {
                caption.hidden { (self.caption.unwrap_or(&self.label)) }
                thead { tr { @for (heading, _) in &self.columns { (heading) } } }
                tbody { @for row in &self.rows { tr { @for (_, cell) in &self.columns { (cell(row)) } } } }
                @if context.peek().is_some() { tbody.context { @for row in context { tr { (row) } } } }
            }
        };
        scroll(&self.label, table)
    }
}
