//! The program `vg`: photographs of one side of a vehicle in, a complete metric 3D Gaussian model out.
//!
//! What a command has to say goes to standard output, once, when it is done; errors, warnings and progress go to
//! standard error. An error is one line, `vg: error: <cause>`.

mod align;
mod args;
mod cloud;
mod contact;
mod demo;
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
    // A job that was told to end has nothing to say of it.
    if let Some(code) = interrupt::code() {
        return code;
    }
    if outcome.is_ok() {
        job::warn();
    }
    match outcome.and_then(|outcome| job::print(&outcome)) {
        Ok(Outcome { complete: true, .. }) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::from(job::FAILED),
        Err(failure) => {
            job::complain(&failure.message);
            ExitCode::from(failure.code)
        }
    }
}

/// Help and version as asked for; anything else in one line, and the code for wrong usage.
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
            job::complain(&one_line(&text));
            ExitCode::from(job::USAGE)
        }
    }
}

/// The argument parser's message without its usage lines, on one line.
fn one_line(text: &str) -> String {
    let said = text.split("\n\nUsage:").next().unwrap_or(text);
    let said = said.split("\n\nFor more information").next().unwrap_or(said);
    let said = said.strip_prefix("error: ").unwrap_or(said);
    let words: Vec<&str> = said.split_whitespace().collect();
    format!("{} (--help tells more)", words.join(" "))
}
