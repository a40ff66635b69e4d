//! Files made for harm, by every reader of the library: the corpus, and seeded damage to it.
//!
//! A campaign runs for longer, and prints what it did (docs/TRUST.md):
//!
//!     SURFEL_FUZZ_RUNS=1000000 cargo test --test fuzz -- --nocapture campaign
//!
//! `SURFEL_FUZZ_SEED` gives other damage, `SURFEL_FUZZ_TARGET` takes one target. Findings are left in
//! `target/fuzz-findings` with their cause; a repaired one becomes a file of the corpus. `SURFEL_FUZZ_CAREFUL=1` keeps each
//! input before it is read, for faults that end the process.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

#[path = "../common/mutate.rs"]
mod mutate;
mod repair;
mod runner;
mod targets;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use mutate::{FileMutator, Random};
use runner::TargetRunner;
use targets::{FuzzTarget, InputOutcome, TARGETS};

/// Counts what is allocated, so that an input that asks for much memory is seen.
#[global_allocator]
static MEMORY: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// Memory is counted for the whole process, so tests go one after the other.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    runner::set_up();
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A folder for inputs that are files, in memory where the system has such a place.
fn scratch() -> Arc<tempfile::TempDir> {
    let folder = tempfile::Builder::new();
    let made = ["/dev/shm", "/tmp"].iter().find_map(|place| {
        let mut builder = tempfile::Builder::new();
        builder.prefix("surfel-fuzz-").tempdir_in(place).ok()
    });
    Arc::new(made.unwrap_or_else(|| folder.tempdir().unwrap()))
}

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|e| panic!("{variable}={text}: {e}")),
    )
}

fn assert_nothing_found(runners: &[TargetRunner]) {
    let found: Vec<String> = runners
        .iter()
        .flat_map(|runner| &runner.figures.findings)
        .map(|finding| format!("{}, {}: {}", finding.target, finding.name, finding.cause))
        .collect();
    assert!(found.is_empty(), "see target/fuzz-findings: {found:#?}");
}

/// Every kept file, and each repaired finding, is read or refused as promised.
#[test]
fn the_corpus_is_read_or_refused() {
    let _alone = alone();
    let scratch = scratch();
    let mut runners = Vec::new();
    for target in TARGETS {
        let mut runner = TargetRunner::new(target, &scratch);
        runner.replay();
        assert!(
            runner.figures.opened > 0,
            "{}: no file is read",
            target.name
        );
        runners.push(runner);
    }
    assert_nothing_found(&runners);
}

/// The same damage on every run, as much of it as half a second gives each target.
#[test]
fn damaged_files_are_read_or_refused() {
    let _alone = alone();
    let scratch = scratch();
    let mut runners = Vec::new();
    for target in TARGETS {
        let mut runner = TargetRunner::new(target, &scratch);
        let start = Instant::now();
        let mut round = 0;
        // At least some, however slow the machine is.
        while round < 2 || (round < 200 && start.elapsed() < Duration::from_millis(500)) {
            runner.damage(50, 1000 + round);
            round += 1;
        }
        let figures = &runner.figures;
        println!(
            "{}: {} runs, {} opened",
            target.name, figures.runs, figures.opened
        );
        // Both outcomes, or different remarks, for this test to mean something.
        assert!(runner.kinds() > 2, "{}: all went the same way", target.name);
        runners.push(runner);
    }
    assert_nothing_found(&runners);
}

/// As many runs as the variable says, the same time for each target; a table at the end. Rounds are numbered, so a seed
/// gives the same damage however fast the machine is.
#[test]
fn campaign() {
    let Some(runs) = number("SURFEL_FUZZ_RUNS") else {
        println!("SURFEL_FUZZ_RUNS is not set: no campaign");
        return;
    };
    const ROUND: u64 = 256;
    let _alone = alone();
    let seed = number("SURFEL_FUZZ_SEED").unwrap_or(1);
    let wanted = std::env::var("SURFEL_FUZZ_TARGET").ok();
    let scratch = scratch();
    let mut runners: Vec<TargetRunner> = TARGETS
        .iter()
        .filter(|target| wanted.as_deref().is_none_or(|name| name == target.name))
        .map(|target| TargetRunner::new(target, &scratch))
        .collect();
    assert!(!runners.is_empty(), "no target of this name");
    let mut done = 0;
    let mut rounds = vec![0_u64; runners.len()];
    let mut spent = vec![Duration::ZERO; runners.len()];
    let mut last_table = Instant::now();
    while done < runs {
        let index = (0..runners.len())
            .min_by_key(|&index| spent[index])
            .unwrap();
        let begin = Instant::now();
        let place = TARGETS
            .iter()
            .position(|t| t.name == runners[index].target.name);
        let mut mixed = Random(seed ^ (rounds[index] << 8) ^ place.unwrap() as u64);
        runners[index].damage(ROUND, mixed.next());
        spent[index] += begin.elapsed();
        rounds[index] += 1;
        done += ROUND;
        if done >= runs || last_table.elapsed() > Duration::from_secs(60) {
            last_table = Instant::now();
            print_table(&runners);
            let seconds: f64 = spent.iter().map(Duration::as_secs_f64).sum();
            let rate = done as f64 / seconds;
            println!(
                "{done} runs in {seconds:.0} s, the making of damage included: {rate:.0} a second"
            );
        }
    }
    assert_nothing_found(&runners);
}

fn print_table(runners: &[TargetRunner]) {
    println!("| target | runs | runs/s | opened | findings | most memory, MiB | slowest, ms |");
    println!("|---|---|---|---|---|---|---|");
    let mut total = (0, Duration::ZERO, 0);
    for runner in runners {
        let f = &runner.figures;
        total = (
            total.0 + f.runs,
            total.1 + f.time,
            total.2 + f.findings.len(),
        );
        println!(
            "| {} | {} | {:.0} | {:.0} % | {} | {:.1} | {:.0} |",
            runner.target.name,
            f.runs,
            f.runs as f64 / f.time.as_secs_f64(),
            100.0 * f.opened as f64 / f.runs as f64,
            f.findings.len(),
            f.most_memory as f64 / f64::from(1 << 20),
            f.slowest.as_secs_f64() * 1e3
        );
    }
    let rate = total.0 as f64 / total.1.as_secs_f64();
    println!("| all | {} | {rate:.0} | | {} | | |", total.0, total.2);
}

#[test]
fn damage_is_the_same_for_the_same_seed() {
    let damage = |seed| {
        let mut mutator = FileMutator {
            random: Random(seed),
            words: &["vertex"],
        };
        let text = b"element vertex 4\n0 1 2\n3 4 5\n";
        (0..200)
            .map(|_| mutator.damaged(text, b"other", 400))
            .collect::<Vec<_>>()
    };
    assert_eq!(damage(7), damage(7));
    assert_ne!(damage(7), damage(8));
    assert!(damage(7).iter().all(|bytes| bytes.len() <= 400));
}

/// Planted faults: each oracle is seen to fail.
#[test]
fn broken_promises_are_seen() {
    const fn planted(
        run: fn(&std::path::Path, &str, &[u8]) -> Result<InputOutcome, String>,
    ) -> FuzzTarget {
        FuzzTarget {
            name: "planted",
            words: &[],
            run,
            more_memory: 0,
            has_parts: false,
        }
    }
    const FINE: InputOutcome = InputOutcome {
        is_opened: true,
        class: 1,
    };
    static FAULTS: [FuzzTarget; 4] = [
        planted(|_, _, bytes| {
            assert!(bytes.is_empty(), "no bytes wanted");
            Ok(FINE)
        }),
        planted(|_, _, _| {
            std::hint::black_box(vec![0_u8; 80 << 20]);
            Ok(FINE)
        }),
        planted(|_, _, _| Err("a promise".to_owned())),
        planted(|_, _, _| Ok(FINE)),
    ];
    let _alone = alone();
    let scratch = scratch();
    let wanted = ["no bytes wanted", "bytes for a file of 3", "a promise", ""];
    for (target, wanted) in FAULTS.iter().zip(wanted) {
        let mut runner = TargetRunner::with(target, Vec::new(), &scratch);
        runner.run("a", b"abc");
        runner.run("a", b"abc");
        let causes: Vec<&str> = runner
            .figures
            .findings
            .iter()
            .map(|finding| finding.cause.as_str())
            .collect();
        match causes[..] {
            [] => assert_eq!(wanted, ""),
            [cause] => assert!(!wanted.is_empty() && cause.contains(wanted), "{cause}"),
            _ => panic!("the same cause twice: {causes:?}"),
        }
    }
}
