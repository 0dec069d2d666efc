//! Memory of the machine, as far as the system reports it: on Linux, from world-readable files.

use std::fs;
use std::path::{Path, PathBuf};

/// Returns the bytes of memory that this process may use: all of the machine, or the limit of its container
/// or user. `None` if unknown.
///
/// On Linux the minimum of: the memory of the machine; `memory.max` (cgroup v2) or `memory.limit_in_bytes`
/// (v1) of the groups of the process; half of `ulimit -v`, which limits address space; a process reserves
/// more of that than it fills.
pub fn memory_limit() -> Option<u64> {
    let text = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let of_groups = group_files(&text("/proc/self/cgroup"))
        .into_iter()
        .filter_map(|path| fs::read_to_string(path).ok()?.trim().parse().ok());
    let all = [machine_bytes(&text("/proc/meminfo")), address_space_limit().map(|n| n / 2)];
    all.into_iter().flatten().chain(of_groups).min()
}

/// Returns the resident memory of this process in bytes; `None` if unknown.
pub fn resident_bytes() -> Option<u64> {
    resident(&fs::read_to_string("/proc/self/status").ok()?)
}

/// Returns the address space limit of this process in bytes, as `ulimit -v` sets it; `None` without a limit.
pub fn address_space_limit() -> Option<u64> {
    parse_address_space_limit(&fs::read_to_string("/proc/self/limits").ok()?)
}

/// Returns the bytes of a `/proc` line of the form `Name:   123 kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

fn machine_bytes(meminfo: &str) -> Option<u64> {
    kilobytes(meminfo, "MemTotal")
}

fn resident(status: &str) -> Option<u64> {
    kilobytes(status, "VmRSS")
}

/// Returns the soft limit of the address space; `None` without one.
fn parse_address_space_limit(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Returns the files with the limits of the cgroups of a process, and of their ancestors. In a container the
/// path may be the host's, and then the group itself is at the top.
fn group_files(cgroup: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for line in cgroup.lines() {
        let mut fields = line.splitn(3, ':');
        let (Some(_), Some(controllers), Some(path)) = (fields.next(), fields.next(), fields.next()) else {
            continue;
        };
        let (top, name) = if controllers.is_empty() {
            ("/sys/fs/cgroup", "memory.max")
        } else if controllers.split(',').any(|c| c == "memory") {
            ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
        } else {
            continue;
        };
        let path = Path::new(path.trim_start_matches('/'));
        files.extend(path.ancestors().map(|group| Path::new(top).join(group).join(name)));
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn system_files_are_parsed() {
        assert_eq!(machine_bytes("MemTotal:       24689764 kB\nMemFree: 1 kB\n"), Some(24_689_764 << 10));
        assert_eq!(resident("Name:\tx\nVmRSS:\t    2048 kB\n"), Some(2 << 20));
        let limits =
            |n: &str| format!("Max cpu time  unlimited\nMax address space         {n}   {n}  bytes\n");
        assert_eq!(parse_address_space_limit(&limits("1073741824")), Some(1 << 30));
        assert_eq!(parse_address_space_limit(&limits("unlimited")), None);
        assert_eq!([machine_bytes(""), resident(""), parse_address_space_limit("")], [None; 3]);
    }

    #[test]
    fn limits_of_a_group_and_its_ancestors_apply() {
        let names = |text: &str| {
            group_files(text).into_iter().map(|p| p.to_string_lossy().into_owned()).collect::<Vec<_>>()
        };
        assert_eq!(
            names("0::/a/b\n"),
            ["/sys/fs/cgroup/a/b/memory.max", "/sys/fs/cgroup/a/memory.max", "/sys/fs/cgroup/memory.max"]
        );
        assert_eq!(
            names("5:cpu:/x\n4:memory,hugetlb:/d\nnonsense\n"),
            ["/sys/fs/cgroup/memory/d/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.limit_in_bytes"]
        );
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_reports_its_memory() {
        let (all, taken) =
            (memory_limit().expect("Linux reports it"), resident_bytes().expect("Linux reports it"));
        assert!(taken > 0 && all > taken, "{taken} of {all}");
    }
}
