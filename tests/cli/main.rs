//! The program from outside: what it prints and writes, its exit codes, what it leaves behind.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod auto;
mod bench;
mod chart;
#[path = "../common/models.rs"]
mod common_models;
mod compare;
mod costs;
mod cross_section;
mod damage;
mod documents;
mod harness;
mod join;
#[cfg(unix)]
mod lost;
mod models;
mod motion;
mod packages;
mod patches;
mod photos;
mod pictures;
mod placing;
mod profile;
mod reproduce;
mod scans;
mod stability;
mod stats;
mod streams;
mod usage;
#[cfg(target_os = "linux")]
mod write_faults;
mod writing;
