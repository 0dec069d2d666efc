//! How much memory there is, as far as the system tells: on Linux, by files that anybody may read.

use std::fs;
use std::path::{Path, PathBuf};

/// Bytes of memory that this process may take: all of the machine, or what its container or its user has set as a limit.
/// `None` where nothing tells.
///
/// On Linux the least of: the memory of the machine; `memory.max` (cgroup v2) or `memory.limit_in_bytes` (v1) of the groups
/// that the process is in; half of `ulimit -v`, which counts addresses, of which a process takes more than it fills.
pub fn memory() -> Option<u64> {
    let text = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let of_groups = group_files(&text("/proc/self/cgroup"))
        .into_iter()
        .filter_map(|path| fs::read_to_string(path).ok()?.trim().parse().ok());
    let all = [machine_bytes(&text("/proc/meminfo")), addresses().map(|n| n / 2)];
    all.into_iter().flatten().chain(of_groups).min()
}

/// Bytes of memory that this process has filled by now; `None` where nothing tells.
pub fn taken() -> Option<u64> {
    resident(&fs::read_to_string("/proc/self/status").ok()?)
}

/// Bytes of addresses that this process may have, as `ulimit -v` sets them; `None` without a limit.
pub fn addresses() -> Option<u64> {
    addresses_in(&fs::read_to_string("/proc/self/limits").ok()?)
}

/// A line of `/proc` of the form `Name:   123 kB`.
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

/// The soft limit on addresses; `None` without one.
fn addresses_in(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// The files that hold the limits of the groups that a process is in, and of the groups round these. In a container the
/// path may be that of the host, and then the group itself is at the top.
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
    fn files_of_the_system_are_understood() {
        assert_eq!(machine_bytes("MemTotal:       24689764 kB\nMemFree: 1 kB\n"), Some(24_689_764 << 10));
        assert_eq!(resident("Name:\tx\nVmRSS:\t    2048 kB\n"), Some(2 << 20));
        let limits =
            |n: &str| format!("Max cpu time  unlimited\nMax address space         {n}   {n}  bytes\n");
        assert_eq!(addresses_in(&limits("1073741824")), Some(1 << 30));
        assert_eq!(addresses_in(&limits("unlimited")), None);
        assert_eq!([machine_bytes(""), resident(""), addresses_in("")], [None; 3]);
    }

    #[test]
    fn limits_of_a_group_and_of_those_round_it() {
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
    fn this_machine_tells() {
        let (all, taken) = (memory().expect("Linux tells"), taken().expect("Linux tells"));
        assert!(taken > 0 && all > taken, "{taken} of {all}");
    }
}
