//! Records of many folders on one page: shards of a sweep, and sweeps on several devices, which are kept apart.

use crate::experiments::accel::points::AccelEntry;
use crate::experiments::animate::points::AnimateEntry;
use crate::experiments::bench::matrix::Outcome;
use crate::experiments::bench::page::{Report, read_setting};
use crate::experiments::bench::results;
use crate::experiments::fly::points::FlyEntry;
use crate::experiments::{accel, animate, fly};
use crate::measure::provenance::{self, DeviceFacts, Machine};
use crate::measure::record::Record;
use crate::measure::setting::Setting;
use crate::report::columns::Table;
use crate::report::elements::{foot, page};
use crate::report::names::{distinct, slug};
use crate::report::numbers::{count, three_digits};
use crate::report::table::or_dash;
use crate::report::{beside, lines};
use crate::{Error, Result};
use maud::{Markup, html};
use std::path::{Path, PathBuf};

/// What is said where a folder does not say on which machine it was measured.
const UNKNOWN: &str = "not in the records";
/// In place of a driver, where everything was measured on the host.
const NO_DRIVER: &str = "without a device";

/// All that was measured on a device.
#[derive(Debug, Default)]
struct OfDevice {
    name: String,
    driver: String,
    machine: Option<Machine>,
    facts: Option<DeviceFacts>,
    /// Notes of the runs.
    notes: Vec<String>,
    results: Vec<Record>,
    accel: Vec<AccelEntry>,
    animate: Vec<AnimateEntry>,
    fly: Vec<FlyEntry>,
}

/// The records of `folders`, written into `output` with their pages: `index.html` is the page of the device, or, of several, a
/// table of all with a folder for the pages of each. Gives the path of `index.html`.
///
/// # Errors
/// A folder holds no records; a line of a file is not a record; a file cannot be written.
pub fn write(folders: &[PathBuf], output: &Path) -> Result<PathBuf> {
    let mut devices = Vec::new();
    for folder in folders {
        read(folder, &mut devices)?;
    }
    match &mut devices[..] {
        [device] => device.write(output)?,
        _ => {
            for device in &mut devices {
                device.write(&output.join(device.slug()))?;
            }
            let path = output.join("index.html");
            std::fs::write(&path, overview(&devices)).map_err(Error::file(&path))?;
        }
    }
    Ok(output.join("index.html"))
}

/// Adds what lies in a folder.
fn read(folder: &Path, devices: &mut Vec<OfDevice>) -> Result<()> {
    let has = |file: &str| folder.join(file).is_file();
    let [accel_file, animate_file, fly_file] = [beside::ACCEL, beside::ANIMATE, beside::FLY].map(|page| page.records);
    if ![results::FILE, accel_file, animate_file, fly_file].into_iter().any(has) {
        return Err(Error::Argument(format!(
            "{} holds none of {}, {accel_file}, {animate_file} and {fly_file}; name folders that hedgerow bench, accel, animate or fly \
             wrote",
            folder.display(),
            results::FILE
        )));
    }
    if has(results::FILE) {
        read_results(folder, devices)?;
    }
    if has(accel_file) {
        let entries = accel::page::read(folder)?;
        let setting = entries.iter().find_map(|entry| match entry {
            AccelEntry::Setting(setting) => Some(setting),
            _ => None,
        });
        if let Some(device) = setting.map(|setting| of_setting(devices, setting)) {
            device.accel.extend(entries);
        }
    }
    if has(animate_file) {
        let entries = animate::page::read(folder)?;
        let setting = entries.iter().find_map(|entry| match entry {
            AnimateEntry::Setting(setting) => Some(&setting.setting),
            _ => None,
        });
        if let Some(device) = setting.map(|setting| of_setting(devices, setting)) {
            device.animate.extend(entries);
        }
    }
    if has(fly_file) {
        let entries = fly::page::read(folder)?;
        let setting = entries.iter().find_map(|entry| match entry {
            FlyEntry::Setting(setting) => Some(&setting.setting),
            _ => None,
        });
        if let Some(device) = setting.map(|setting| of_setting(devices, setting)) {
            device.fly.extend(entries);
        }
    }
    Ok(())
}

/// The device of a run; one that is called as the processor, where it had none.
fn of_setting<'a>(devices: &'a mut Vec<OfDevice>, setting: &Setting) -> &'a mut OfDevice {
    let device = match &setting.device {
        Some(facts) => of(devices, &facts.name, &facts.driver),
        None => of(devices, &setting.machine.cpu, NO_DRIVER),
    };
    device.machine.get_or_insert(setting.machine.clone());
    device.facts = device.facts.take().or(setting.device.clone());
    device
}

/// Adds the results of a folder. Those of builders on the host belong to the device beside which they were measured.
fn read_results(folder: &Path, devices: &mut Vec<OfDevice>) -> Result<()> {
    let records = results::read(folder)?;
    let setting = read_setting(folder)?;
    let facts = setting.as_ref().and_then(|setting| setting.device.clone());
    let is_of_host = |record: &Record| record.subgroup == 0;
    let own = records.iter().find(|record| !is_of_host(record)).map(|r| (r.device.clone(), r.driver.clone()));
    let own = facts.as_ref().map(|facts| (facts.name.clone(), facts.driver.clone())).or(own);
    for record in records {
        let (name, driver) = match &own {
            Some(own) if is_of_host(&record) => own.clone(),
            _ => (record.device.clone(), record.driver.clone()),
        };
        let device = of(devices, &name, &driver);
        // Measured twice: the later counts.
        let is_same = |other: &Record| (&other.scene, &other.builder) == (&record.scene, &record.builder);
        match device.results.iter_mut().find(|other| is_same(other)) {
            Some(other) if other.when <= record.when => *other = record,
            Some(_) => {}
            None => device.results.push(record),
        }
    }
    if let (Some((name, driver)), Some(setting)) = (own, setting) {
        let device = of(devices, &name, &driver);
        device.machine.get_or_insert(setting.machine);
        device.facts = device.facts.take().or(facts);
        device.notes.extend(setting.notes);
    }
    Ok(())
}

/// The device of this name and driver.
fn of<'a>(devices: &'a mut Vec<OfDevice>, name: &str, driver: &str) -> &'a mut OfDevice {
    let found = devices.iter().position(|device| device.name == name && device.driver == driver);
    let found = found.unwrap_or_else(|| {
        devices.push(OfDevice { name: name.to_owned(), driver: driver.to_owned(), ..OfDevice::default() });
        devices.len() - 1
    });
    &mut devices[found]
}

impl OfDevice {
    /// The folder of its pages, where there are several devices.
    fn slug(&self) -> String {
        slug(&format!("{} {}", self.name, self.driver))
    }

    /// Its records and pages.
    fn write(&mut self, folder: &Path) -> Result<()> {
        // One scene's together, whichever shard measured it.
        self.results.sort_by(|a, b| a.scene.cmp(&b.scene));
        let mut file = results::create(folder)?;
        self.results.iter().try_for_each(|record| file.append(record))?;
        if !self.accel.is_empty() {
            lines::write(folder, std::mem::take(&mut self.accel))?;
        }
        if !self.animate.is_empty() {
            lines::write(folder, std::mem::take(&mut self.animate))?;
        }
        if !self.fly.is_empty() {
            lines::write(folder, std::mem::take(&mut self.fly))?;
        }
        self.report().write(folder)
    }

    fn report(&self) -> Report {
        let unknown = Machine { cpu: UNKNOWN.to_owned(), cores: 0, memory: None, system: UNKNOWN.to_owned() };
        let mut commits: Vec<&str> = self.results.iter().map(|record| record.commit.as_str()).collect();
        commits.sort_unstable();
        commits.dedup();
        let outcome = |record: &Record| Outcome {
            choice: None,
            traffic: vec![None; record.build.phases.len()],
            faults: if record.valid == Some(false) { vec!["see the run's own page".to_owned()] } else { Vec::new() },
            record: record.clone(),
        };
        let outcomes: Vec<Outcome> = self.results.iter().map(outcome).collect();
        let baseline = outcomes.iter().any(|o| o.record.builder == "driver-fast-build");
        let setting = Setting {
            machine: self.machine.clone().unwrap_or(unknown),
            device: self.facts.clone(),
            commit: commits.join(", "),
            when: self.results.iter().map(|record| record.when.clone()).max().unwrap_or_default(),
            command: provenance::command(),
            options: Vec::new(),
            notes: distinct(self.notes.iter().cloned()),
        };
        Report { outcomes, baseline: baseline.then(|| "driver-fast-build".to_owned()), ..Report::new(setting) }
    }
}

/// The page of several devices: a table of each, and the way to its own pages.
fn overview(devices: &[OfDevice]) -> String {
    let body = html! {
        header.hero {
            p.kicker { "hedgerow benchmark" }
            h1 { (devices.len()) " devices" }
            p.lead { "Each device by itself: figures of different machines are not compared." }
        }
        main { @for device in devices { (section(device)) } }
        (foot(&provenance::commit(), &provenance::now()))
    };
    page(&format!("hedgerow: {} devices", devices.len()), &body)
}

fn section(device: &OfDevice) -> Markup {
    let yes_or_no = |is_valid| if is_valid { "yes" } else { "no" }.to_owned();
    let table = Table::new(format!("Results of {}", device.name), &device.results)
        .text("scene", |record| &record.scene)
        .number("triangles", "", |record| Some(record.triangles as f64), count)
        .cell("builder", |record| html! { td { code { (record.builder) } } })
        .number("build", "ms", |record| Some(record.build.median_ms), three_digits)
        .number("build", "Mtri/s", |record| Some(record.mtris_s()), three_digits)
        .number("SAH cost", "", |record| record.quality.sah, three_digits)
        .number("all rays", "Mrays/s", |record| record.mrays_s(), three_digits)
        .text("valid", move |record| or_dash(record.valid, yes_or_no));
    html! {
        section {
            h2 { (device.name) }
            p { (device.driver) ". " a href={ (device.slug()) "/index.html" } { "All charts and figures of this device" } }
            (table.html())
        }
    }
}
