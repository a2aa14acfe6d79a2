//! `hedgerow devices`: every Vulkan device, what it lacks, and which one we would pick.

use super::{Common, Json, tables};
use crate::device;
use crate::device::Found;
use crate::measure::provenance::{kind_of, vulkan_of};
use crate::report::numbers::bytes;
use comfy_table::Table;
use std::io::Write;
use std::path::PathBuf;

/// List the Vulkan devices, what they lack, and mark the one we would pick
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Write the list as JSON, to stdout or to a file
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    json: Option<PathBuf>,
}

/// One device, as `--json` writes it.
#[derive(serde::Serialize)]
struct Row<'a> {
    index: usize,
    name: &'a str,
    driver: &'a str,
    kind: String,
    api_version: String,
    subgroup_size: u32,
    memory_bytes: u64,
    /// Ways to trace rays through the driver's own acceleration structures: `query`, `pipeline`.
    driver_tracing: Vec<&'static str>,
    optional: Vec<&'static str>,
    missing: &'a [String],
    picked: bool,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let found = device::list(common.device())?;
    let rows: Vec<_> = found.iter().map(row).collect();
    let json = Json { json: arguments.json.clone() };
    json.write_each([&rows])?;
    if !json.takes_stdout() {
        writeln!(std::io::stdout(), "{}", table(&rows))?;
    }
    Ok(())
}

fn row(found: &Found) -> Row<'_> {
    Row {
        index: found.index,
        name: &found.name,
        driver: &found.driver,
        kind: kind_of(found).trim_end_matches(" GPU").to_lowercase(),
        api_version: vulkan_of(found),
        subgroup_size: found.subgroup_size,
        memory_bytes: found.memory,
        driver_tracing: found.driver_tracing.iter().map(|way| way.name()).collect(),
        optional: found.optional.names(),
        missing: &found.missing,
        picked: found.picked,
    }
}

fn table(rows: &[Row<'_>]) -> Table {
    let header =
        ["", "#", "device", "driver", "kind", "Vulkan", "subgroup", "memory", "driver's rays", "optional", "lacks"];
    let mut table = tables::table(&header, header.len());
    for row in rows {
        let lacks = if row.missing.is_empty() { "nothing".into() } else { row.missing.join(", ") };
        table.add_row([
            if row.picked { "*" } else { "" }.to_owned(),
            row.index.to_string(),
            row.name.to_owned(),
            row.driver.to_owned(),
            row.kind.clone(),
            row.api_version.clone(),
            row.subgroup_size.to_string(),
            bytes(row.memory_bytes),
            or_none(&row.driver_tracing),
            or_none(&row.optional),
            lacks,
        ]);
    }
    table
}

fn or_none(names: &[&str]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
