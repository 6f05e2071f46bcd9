//! The program `vg`: photographs of one side of a vehicle in, a complete metric 3D Gaussian model out.
//!
//! A command prints its result on standard output once, when it is done; errors, warnings and progress go to standard
//! error. An error is one line, `vg: error: <cause>`.

mod align;
mod args;
mod cloud;
mod contact;
mod demo;
mod drawing;
mod eval;
mod files;
mod grid;
mod guard;
mod info;
mod interrupt;
mod job;
mod memory;
mod pareto;
mod raster;
mod reconstruct;
mod refine;
mod render;
mod report;
mod sample;
mod scene;
mod shown;

use args::{Cli, Command};
use clap::Parser;
use job::{Failure, Outcome};
use std::process::ExitCode;

fn main() -> ExitCode {
    interrupt::watch();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let outcome = match &cli.command {
        Command::Reconstruct(args) => reconstruct::run(args),
        Command::Refine(args) => refine::run(args),
        Command::Render(args) => render::run(args),
        Command::Info(args) => info::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Pareto(args) => pareto::run(args),
        Command::Report(args) => report::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Align(args) => align::run(args),
    };
    // An interrupted job prints no result and no error.
    if let Some(code) = interrupt::code() {
        return code;
    }
    if outcome.is_ok() {
        job::print_warnings();
    }
    match outcome.and_then(|outcome| job::print(&outcome)) {
        Ok(Outcome { complete: true, .. }) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::from(job::FAILED),
        Err(failure) => {
            job::print_error(&failure.message);
            ExitCode::from(failure.code)
        }
    }
}

/// Prints help and version as asked for; anything else is wrong usage, printed on one line.
fn usage(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind;
    let text = error.render().to_string();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            match job::print(&Outcome::done(text.trim_end())) {
                Ok(_) => ExitCode::SUCCESS,
                Err(Failure { code, .. }) => ExitCode::from(code),
            }
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprint!("{text}");
            ExitCode::from(job::USAGE)
        }
        _ => {
            job::print_error(&one_line(&text));
            ExitCode::from(job::USAGE)
        }
    }
}

/// The argument parser's message without its usage lines, on one line.
fn one_line(text: &str) -> String {
    let message = text.split("\n\nUsage:").next().unwrap_or(text);
    let message = message.split("\n\nFor more information").next().unwrap_or(message);
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let words: Vec<&str> = message.split_whitespace().collect();
    format!("{} (see --help)", words.join(" "))
}
