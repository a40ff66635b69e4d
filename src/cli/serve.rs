//! `surfel serve`

use super::progress::is_interrupted;
use super::{CommandFailure, Outcome, print, usage};
use anyhow::Context;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;
use surfel::pages::serve::{FileServer, SlowLine};

/// Serve the paged trees of a folder over http, to try them from another window or machine.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  surfel serve models                     then, in another terminal: surfel http://127.0.0.1:8080/town.surfel
  surfel serve models --delay-ms 50 --megabits 50      as over a slow line

It knows neither encryption nor users. For others than yourself use nginx or a bucket (docs/METHODS.md).")]
pub(crate) struct ServeArgs {
    /// Folder whose files are served
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Port to listen at; 0 is any that is free
    #[arg(long, value_name = "N", default_value_t = 8080)]
    port: u16,
    /// Address to listen at; 0.0.0.0 lets other machines in
    #[arg(long, value_name = "IP", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    address: IpAddr,
    /// Wait so long before each answer, and for each new connection
    #[arg(long, value_name = "MS", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=60_000))]
    delay_ms: u64,
    /// Send at most so many million bits a second [default: as fast as it goes]
    #[arg(long, value_name = "N", value_parser = parse_rate)]
    megabits: Option<f64>,
}

fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(rate) if (0.01..=1e6).contains(&rate) => Ok(rate),
        _ => Err("expected million bits a second, 0.01 to 1000000".to_owned()),
    }
}

pub(crate) fn run(args: &ServeArgs) -> Outcome {
    if !args.folder.is_dir() {
        return Err(usage(format!("{}: not a folder", args.folder.display())));
    }
    let line = SlowLine {
        delay: Duration::from_millis(args.delay_ms),
        bytes_per_second: args.megabits.map(|rate| rate * 1e6 / 8.0),
    };
    let address = SocketAddr::new(args.address, args.port);
    let failed = |error: std::io::Error| CommandFailure::Run(anyhow::Error::new(error));
    let server = FileServer::bind(&args.folder, address, line)
        .with_context(|| format!("cannot listen at {address}"))
        .map_err(CommandFailure::Run)?;
    let own = server.address().map_err(failed)?;
    print(&format!("http://{own}/\n"))?;
    let running = std::thread::spawn(move || server.run());
    while !running.is_finished() {
        if is_interrupted() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    match running.join() {
        Ok(ended) => ended.map_err(failed),
        Err(_) => Err(CommandFailure::Run(anyhow::anyhow!(
            "the server's thread ended"
        ))),
    }
}
