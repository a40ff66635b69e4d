//! How much memory is free, and what a generated model takes, so that one that does not fit is refused by name instead of
//! ending the program.

use super::BenchError;

/// Bytes that a generated statue takes at most while its tree is built and it is drawn on a software device, a triangle: 66
/// of tree and mesh in tree order, 24 of the mesh before that or what building needs, 10 of vertices on the device. (The
/// highest resident memory seen with 50 million triangles was 76 a triangle.)
const BYTES_A_TRIANGLE: u64 = 100;

/// Bytes that a generated model of so many triangles takes at most.
pub fn needed(triangles: u64) -> u64 {
    triangles.saturating_mul(BYTES_A_TRIANGLE)
}

/// Bytes that are free, as far as the system tells (Linux: what is available of the machine and of the control group).
pub fn available() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = read("/proc/meminfo").and_then(|text| meminfo(&text));
    let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
    let group = match (
        number("/sys/fs/cgroup/memory.max"),
        number("/sys/fs/cgroup/memory.current"),
    ) {
        (Some(most), Some(used)) => Some(most.saturating_sub(used)),
        _ => None,
    };
    machine.into_iter().chain(group).min()
}

/// The line `MemAvailable` of /proc/meminfo, bytes.
fn meminfo(text: &str) -> Option<u64> {
    let line = text.lines().find(|l| l.starts_with("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    kib.checked_mul(1024)
}

/// Refuses a model for which too little memory is free. Where the system does not tell, it is tried.
///
/// # Errors
/// [`BenchError::Memory`].
pub fn require(model: &str, triangles: u64, available: Option<u64>) -> Result<(), BenchError> {
    match available {
        Some(available) if available < needed(triangles) => Err(BenchError::Memory {
            model: model.to_owned(),
            needed: needed(triangles),
            available,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_does_not_fit_is_named() {
        let text = "MemTotal:  100 kB\nMemAvailable:   8 kB\n";
        assert_eq!(meminfo(text), Some(8192));
        assert_eq!(meminfo("MemTotal: 100 kB\n"), None);
        let error = require("statue of 64 M", 64_000_000, Some(1 << 30));
        assert!(
            matches!(
                &error,
                Err(BenchError::Memory {
                    needed: 6_400_000_000,
                    ..
                })
            ),
            "{error:?}"
        );
        assert!(error.is_err_and(|e| {
            e.to_string()
                .contains("statue of 64 M needs about 6400000000 bytes")
        }));
        assert!(require("statue", 64_000_000, Some(16 << 30)).is_ok());
        assert!(require("statue", u64::MAX, None).is_ok());
    }
}
