//! Memory that the system has free, as far as it tells (Linux: of the machine and of the control group that a container is).

/// Bytes that are free without swapping; `None` where the system does not tell.
pub fn available() -> Option<u64> {
    least(machine("MemAvailable:"))
}

/// Bytes that a program can have before the system ends it: what is free, and of the machine the room to swap; `None` where the
/// system does not tell.
pub fn with_swap() -> Option<u64> {
    let free = machine("MemAvailable:");
    least(free.map(|free| free.saturating_add(machine("SwapFree:").unwrap_or(0))))
}

/// What the machine has, or the group where that is less.
fn least(machine: Option<u64>) -> Option<u64> {
    let number = |path: &str| {
        std::fs::read_to_string(path)
            .ok()?
            .trim()
            .parse::<u64>()
            .ok()
    };
    let group = match (
        number("/sys/fs/cgroup/memory.max"),
        number("/sys/fs/cgroup/memory.current"),
    ) {
        (Some(most), Some(used)) => Some(most.saturating_sub(used)),
        _ => None,
    };
    machine.into_iter().chain(group).min()
}

/// A line of /proc/meminfo, bytes.
fn machine(name: &str) -> Option<u64> {
    line_of(&std::fs::read_to_string("/proc/meminfo").ok()?, name)
}

fn line_of(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find(|line| line.starts_with(name))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_by_their_names() {
        let text = "MemTotal:  100 kB\nMemAvailable:   8 kB\nSwapFree: x kB\n";
        assert_eq!(line_of(text, "MemAvailable:"), Some(8192));
        assert_eq!(line_of(text, "SwapFree:"), None);
        assert_eq!(line_of("MemTotal: 100 kB\n", "MemAvailable:"), None);
        assert!(with_swap() >= available());
    }
}
