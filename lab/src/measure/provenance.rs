//! Where figures come from: commit, time, processor, device, command.

use super::copy;
use crate::Result;
use crate::device::{Device, Found};
use ash::vk;
use std::process::Command;
use std::sync::OnceLock;

/// Commit of the program, with `+` behind it if the tree was dirty; `unknown` outside a checkout.
///
/// `HEDGEROW_COMMIT` at compile time decides where it is set (for packages), then the file `COMMIT` beside the program (in a
/// portable folder); otherwise git is asked in the folder that the program was compiled in.
pub fn commit() -> String {
    static COMMIT: OnceLock<String> = OnceLock::new();
    COMMIT.get_or_init(find_commit).clone()
}

fn find_commit() -> String {
    if let Some(commit) = option_env!("HEDGEROW_COMMIT") {
        return commit.to_owned();
    }
    let beside = std::env::current_exe().ok().map(|program| program.with_file_name("COMMIT"));
    if let Some(commit) = beside.and_then(|file| std::fs::read_to_string(file).ok()) {
        return commit.trim().to_owned();
    }
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(["-C", env!("CARGO_MANIFEST_DIR")]).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short=10", "HEAD"]) else { return "unknown".into() };
    let dirty = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|changes| !changes.is_empty());
    if dirty { commit + "+" } else { commit }
}

/// Now, RFC 3339 UTC, to the second.
pub fn now() -> String {
    jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

/// The command line of this process.
pub fn command() -> String {
    std::env::args().skip(1).fold("hedgerow".to_owned(), |line, word| line + " " + &word)
}

/// The machine that figures belong to. Figures of different machines are never compared.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Machine {
    /// Processor, as the system names it.
    pub cpu: String,
    /// Logical cores that this process may use.
    pub cores: usize,
    /// Bytes of main memory; `None` where the system does not say.
    pub memory: Option<u64>,
    /// Operating system and architecture.
    pub system: String,
}

impl Machine {
    /// This machine.
    pub fn this() -> Machine {
        let field = |file: &str, key: &str| {
            let text = std::fs::read_to_string(file).ok()?;
            let line = text.lines().find(|line| line.starts_with(key))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        let kilobytes = |text: String| text.split_whitespace().next()?.parse::<u64>().ok();
        Machine {
            cpu: field("/proc/cpuinfo", "model name").unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory: field("/proc/meminfo", "MemTotal").and_then(kilobytes).map(|k| k * 1024),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}

/// The device that was measured.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DeviceFacts {
    /// Its name.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// Discrete, integrated, CPU…
    pub kind: String,
    /// Vulkan version.
    pub vulkan: String,
    /// Subgroup size.
    pub subgroup: u32,
    /// Bytes of device memory.
    pub memory: u64,
    /// Bytes a second that a plain copy reads and writes, in GB/s (10⁹), both counted.
    pub copy_gb_s: Option<f64>,
}

/// What kind of device it is.
pub fn kind_of(found: &Found) -> &'static str {
    match found.kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
        vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
        vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
        vk::PhysicalDeviceType::CPU => "CPU",
        _ => "other",
    }
}

/// The Vulkan version of a device, as `1.3`.
pub fn vulkan_of(found: &Found) -> String {
    format!("{}.{}", vk::api_version_major(found.api_version), vk::api_version_minor(found.api_version))
}

impl DeviceFacts {
    /// What `device` says of itself, and the rate of a plain copy on it.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    pub fn of(device: &Device) -> Result<DeviceFacts> {
        let found = device.found();
        Ok(DeviceFacts {
            name: found.name.clone(),
            driver: found.driver.clone(),
            kind: kind_of(found).into(),
            vulkan: vulkan_of(found),
            subgroup: found.subgroup_size,
            memory: found.memory,
            copy_gb_s: Some(copy::rate_gb_s(device)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_rfc_3339_utc() {
        let now = now();
        assert!(now.parse::<jiff::Timestamp>().is_ok() && now.ends_with('Z') && now.len() == 20, "{now}");
    }

    #[test]
    fn the_commit_is_hexadecimal_or_unknown() {
        let commit = commit();
        let hash = commit.trim_end_matches('+');
        assert!(commit == "unknown" || hash.chars().all(|c| c.is_ascii_hexdigit()) && hash.len() >= 7, "{commit}");
    }
}
