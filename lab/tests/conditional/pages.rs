//! What the tests of the report's pages share: where made-up records were measured, and what a reader sees.
#![allow(dead_code, reason = "each test binary uses its part")]

use hedgerow_lab::measure::provenance::{DeviceFacts, Machine};
use hedgerow_lab::measure::setting::Setting;

/// A machine that nobody has.
pub fn machine() -> Machine {
    Machine { cpu: "AMD EPYC 9R14".into(), cores: 2, memory: Some(8 << 30), system: "linux x86_64".into() }
}

/// Its device.
pub fn device_facts() -> DeviceFacts {
    DeviceFacts {
        name: "llvmpipe (LLVM 19.1.7, 256 bits)".into(),
        driver: "Mesa 26.1.6".into(),
        kind: "CPU".into(),
        vulkan: "1.4".into(),
        subgroup: 8,
        memory: 8 << 30,
        copy_gb_s: Some(18.3),
    }
}

/// Where and how nothing was measured.
pub fn setting(command: &str, runs: &str) -> Setting {
    Setting {
        machine: machine(),
        device: Some(device_facts()),
        commit: "abc1234".into(),
        when: "2026-11-21T10:00:00Z".into(),
        command: command.into(),
        options: vec![("Runs".into(), runs.into())],
        notes: vec!["a note & more".into()],
    }
}

/// What a reader sees of a page: its text without its markup, elements parted by `between`.
pub fn text(page: &str, between: &str) -> String {
    let body = &page[page.find("<body>").expect("a body")..];
    let parts = body.split('<').map(|part| part.split_once('>').map_or(part, |(_, text)| text));
    parts.collect::<Vec<_>>().join(between).replace('\u{2009}', "")
}
